"""`onespp import`: a sequence of frames from elsewhere."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api.importing import import_frames
from onespp.render.foreign.channel_maps import LAYOUTS

from .arguments import parse_settings
from .options import overwrite_option


@click.command("import")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/NAME, NAME that of the folder, or of the "
              "one that `input/` is in.")
@click.option("--layout", "--format", "layout", type=click.Choice(LAYOUTS), default="auto",
              show_default=True, help="Whose files they are.")
@click.option("--channel", "channels", multiple=True, metavar="NAME=SOURCE",
              help="Where an image is in the EXR files, as normal=ViewLayer.Normal, or none; of "
                   "color, albedo, normal, position, depth (camera-space z), distance (along the "
                   "ray), id, motion. May be given several times.")
@click.option("--fov", type=float, metavar="DEGREES",
              help="How wide the camera sees across the image, where there are distances and no "
                   "positions.")
@click.option("--motion", "motion_from", type=click.Choice(["current", "previous"]),
              default="current", show_default=True,
              help="Where motion vectors begin: at the pixel, and lead to where it was, or there.")
@click.option("--motion-y", type=click.Choice(["down", "up"]),
              help="Where their y points; default up for Blender, else down.")
@click.option("--reference", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder with ground truth, numbered as the frames.")
@click.option("--fps", type=float, default=24.0, show_default=True, metavar="N",
              help="Frames a second, for the movie.")
@click.option("--check/--no-check", default=True, show_default=True,
              help="Refuse frames whose matrices, depth or normals follow other conventions.")
@overwrite_option
def import_(folder: Path, out: Path | None, channels: tuple[str, ...], motion_y: str | None,
            **options) -> None:
    """Make a sequence of FOLDER, which holds frames of another renderer.

    GAMES202: beauty_0.exr and so on, or a folder `input` that has them. Results (result_0.exr; or
    in `output`) and references (reference_0.exr; or in `reference`) beside them come along.

    Others: EXR files whose names end in the frame's number, one a frame or one a pass. What is
    known by its name is taken, and what is missing is told. See also `onespp check`.
    """
    sequence = import_frames(folder, out, channels=parse_settings(
        channels, "--channel", form="NAME=SOURCE, as in normal=ViewLayer.Normal"),
                             motion_up=None if motion_y is None else motion_y == "up", **options)
    click.echo(f"imported {len(sequence.frames)} frames into {sequence.folder}")
