"""The commands `render`, `import` and `export`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api import rendering as api
from onespp.api.loading import animate, load
from onespp.render.files.frame_ranges import parse_frames
from onespp.render.files.sequence import FrameSequence

from .arguments import parse_settings, parse_size
from .options import render_options, use
from .terminal import progress


@click.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@click.option("--part", metavar="K/N",
              help="Every N-th frame only, from the K-th on, also beside processes that render the "
              "other parts into the same folder; then the same command without it checks that all "
              "is there.")
@render_options
def render(scene: str, out: Path | None, device: str, threads: int | None, **options) -> None:
    """Render SCENE (a name, or a file of Python, Mitsuba or glTF) at one sample a pixel.

    Running the same command again renders what is missing.
    """
    use(device, threads)
    sequence = render_to(scene, out, **options)
    part = f"part {options['part']} of " if options["part"] else ""
    click.echo(f"rendered {part}{len(sequence.frames)} frames into {sequence.folder}")


def render_to(name: str, out: Path | None, *, frames: str | None = None, size: str | None = None,
              define: tuple[str, ...] = (), sensor: int = 0, camera: str | None = None,
              moves: tuple[str, ...] = (), **options) -> FrameSequence:
    """Do what the options of a command ask."""
    scene = animate(load(name, define=parse_settings(define), sensor=sensor), camera=camera,
                    moves=parse_settings(moves, "--move", last=True))
    return api.render(scene, out or Path("data") / scene.name,
                      frames=None if frames is None else parse_frames(frames),
                      size=None if size is None else parse_size(size), **options)


DATA_SET_FORMATS = ("zarr", "webdataset", "noisebase")


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder for the files; default FOLDER/games202, of a data set FOLDER-FORMAT.")
@click.option("--format", "layout", type=click.Choice(["games202", *DATA_SET_FORMATS]),
              default="games202", show_default=True,
              help="The other layout; of a data set zarr, webdataset or noisebase.")
def export(folder: Path, out: Path | None, layout: str) -> None:
    """Write the frames of the sequence, or of the data set, in FOLDER in another layout."""
    if layout in DATA_SET_FORMATS:
        _export_data_set(folder, out or folder.with_name(f"{folder.name}-{layout}"), layout)
        return
    from onespp.render.games202.convert import export_games202

    sequence = FrameSequence.open(folder)
    out = out or folder / layout
    export_games202(sequence, out)
    click.echo(f"exported {len(sequence.frames)} frames to {out}")


def _export_data_set(folder: Path, out: Path, layout: str) -> None:
    from onespp.clips.export import export as export_data_set
    from onespp.datasets.folder import DataSet

    with progress() as report:
        count = export_data_set(DataSet.open(folder), layout, out, report)
    click.echo(f"exported {count} renders of sequences to {out}")
