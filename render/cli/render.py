"""The commands `render`, `import` and `export`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.channels import OFFERED, REPLAY
from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import parse_frames
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence
from onespp.render.host.memory import require_memory
from onespp.scenes import catalog

from .arguments import parse_size
from .options import overwrite_option, render_options, use
from .terminal import command_line, note, progress


@click.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@render_options
def render(scene: str, out: Path | None, device: str, threads: int | None, **options) -> None:
    """Render SCENE (a name, or a path to a scene file) at one sample a pixel.

    Running the same command again renders what is missing.
    """
    use(device, threads)
    sequence = render_to(scene, out, **options)
    click.echo(f"rendered {len(sequence.frames)} frames into {sequence.folder}")


def render_to(scene_name: str, out: Path | None, *, frames: str | None = None,
              size: str | None = None, seed: int = 0, reference_spp: int | None = None,
              reference_error: float | None = None, antialias: bool = False,
              channels: str | None = None, half: bool = False, direct: str = "resampled",
              sampler: str = "zsobol", jitter: str = "none",
              overwrite: bool = False) -> FrameSequence:
    """Do what the options of a command ask."""
    scene = catalog.load(scene_name)
    height, width = parse_size(size) if size is not None else (scene.height, scene.width)
    numbers = parse_frames(frames) if frames is not None else tuple(range(scene.frames))
    if seed < 0:
        raise InputError(f"--seed is {seed}: use 0 or more")
    require_memory(height, width)
    names, added = channel_names(channels)
    from onespp.render.job import RenderJob, render_sequence  # imports Mitsuba
    from onespp.render.references import reference_notes

    job = RenderJob(scene, numbers, height, width, seed, reference_spp, antialias, names,
                    direct, sampler, command_line(), added, channels == "training",
                    half, reference_error, jitter)
    out = out or Path("data") / scene.name
    with writing(out, "render", alone=overwrite), progress() as report:
        sequence = render_sequence(job, out, overwrite=overwrite, progress=report, tell=note)
    if job.fewest_spp is not None:
        for sentence in reference_notes(sequence, numbers, reference_spp):
            click.echo(sentence)
    return sequence


def channel_names(text: str | None) -> tuple[tuple[str, ...] | None, tuple[str, ...]]:
    """The channels asked for, None for the default ones, and those to add to them."""
    if text in (None, "training"):
        return None, ()
    added = text.startswith("+")
    names = [name.strip() for name in text[added:].split(",") if name.strip()]
    names = [n for name in names for n in (REPLAY if name == "gradient" else (name,))]
    unknown = [name for name in names if name not in OFFERED]
    if unknown or not names:
        raise InputError(f"--channels names {unknown[0] if unknown else 'nothing'}: "
                         f"use some of {', '.join(OFFERED)}")
    chosen = tuple(name for name in OFFERED if name in names)
    return (None, chosen) if added else (chosen, ())


FORMATS = click.option("--format", "layout", type=click.Choice(["games202"]), default="games202",
                       show_default=True, help="The other layout.")


@click.command("import")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/NAME, NAME that of the folder, or of the "
              "one that `input/` is in.")
@click.option("--fps", type=float, default=24.0, show_default=True, metavar="N",
              help="Frames a second, for the movie.")
@click.option("--check/--no-check", default=True, show_default=True,
              help="Refuse frames whose matrices, depth or normals follow other conventions.")
@overwrite_option
@FORMATS
def import_(folder: Path, out: Path | None, fps: float, check: bool, overwrite: bool,
            layout: str) -> None:
    """Make a sequence of FOLDER, which holds frames in another layout.

    FOLDER has beauty_0.exr and so on, or a folder `input` that has. Results (result_0.exr; or in
    `output`) and references (reference_0.exr; or in `reference`) beside them come along.
    """
    from onespp.render.games202.convert import import_games202
    from onespp.render.games202.layout import find_files

    out = out or Path("data") / find_files(folder).name
    notes: list[str] = []
    with writing(out, "render", alone=overwrite):
        sequence = import_games202(folder, out, fps=fps, overwrite=overwrite, check=check,
                                   command=command_line(), tell=notes.append)
    click.echo(f"imported {len(sequence.frames)} frames into {sequence.folder}")
    for sentence in notes:
        click.echo(sentence)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder for the files; default FOLDER/games202.")
@FORMATS
def export(folder: Path, out: Path | None, layout: str) -> None:
    """Write the frames of the sequence in FOLDER in another layout."""
    from onespp.render.games202.convert import export_games202

    sequence = FrameSequence.open(folder)
    out = out or folder / layout
    export_games202(sequence, out)
    click.echo(f"exported {len(sequence.frames)} frames to {out}")
