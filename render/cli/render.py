"""The commands `render`, `import` and `export`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api import rendering as api
from onespp.api.loading import animate, load
from onespp.render.files.frame_ranges import parse_frames
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence

from .arguments import parse_settings, parse_size
from .options import overwrite_option, render_options, use
from .terminal import command_line


@click.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@render_options
def render(scene: str, out: Path | None, device: str, threads: int | None, **options) -> None:
    """Render SCENE (a name, a Python file, or a Mitsuba XML file) at one sample a pixel.

    Running the same command again renders what is missing.
    """
    use(device, threads)
    sequence = render_to(scene, out, **options)
    click.echo(f"rendered {len(sequence.frames)} frames into {sequence.folder}")


def render_to(name: str, out: Path | None, *, frames: str | None = None, size: str | None = None,
              define: tuple[str, ...] = (), sensor: int = 0, camera: str | None = None,
              moves: tuple[str, ...] = (), **options) -> FrameSequence:
    """Do what the options of a command ask."""
    scene = animate(load(name, define=parse_settings(define), sensor=sensor), camera=camera,
                    moves=parse_settings(moves, "--move", last=True))
    return api.render(scene, out or Path("data") / scene.name,
                      frames=None if frames is None else parse_frames(frames),
                      size=None if size is None else parse_size(size), **options)


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
