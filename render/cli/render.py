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
