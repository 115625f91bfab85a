"""Frames of other renderers made a sequence, and whether they are as they should be."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence
from onespp.render.foreign.channel_maps import LAYOUTS
from onespp.render.foreign.convert import Conventions, import_foreign, sequence_name
from onespp.render.games202.convert import import_games202
from onespp.render.games202.layout import find_files, has_matrices

from .caller import caller, public


@public
def import_frames(folder: str | Path, out: str | Path | None = None, *, layout: str = "auto",
                  channels: Mapping[str, str] | None = None, fov: float | None = None,
                  motion_from: str = "current", motion_up: bool | None = None,
                  reference: str | Path | None = None, fps: float = 24.0, check: bool = True,
                  overwrite: bool = False) -> FrameSequence:
    """A sequence of the frames of another renderer.

    Args:
        folder: with the frames in the layout of the GAMES202 assignment, or with EXR files whose
            names end in the frame's number: scanlines or tiles, in one part or several, half or
            float.
        out: folder of the sequence; default data/NAME.
        layout: "games202", "blender", "mitsuba", or "auto".
        channels: where an image is in the files, by name: "color", "albedo", "normal",
            "position", "depth" (camera-space z), "distance" (along the ray), "id", "motion"
            (pixels to where the surface was); as {"normal": "ViewLayer.Normal"}, or "none".
        fov: degrees across the image's width, where there are distances and no positions.
        motion_from: "previous" for motion that begins where the surface was.
        motion_up: whether motion has y up; default as the layout has it.
        reference: folder with ground truth, numbered as the frames.
        fps: frames a second, for the movie.
        check: refuse frames of the assignment's layout with other conventions than its own.
        overwrite: replace another sequence at `out`.

    Raises:
        InputError: no frames, or a file of one is missing, damaged, or disagrees with the rest.
    """
    folder = Path(folder)
    if layout not in LAYOUTS:
        raise InputError(f"--layout is '{layout}': use {', '.join(LAYOUTS)}")
    if motion_from not in ("current", "previous"):
        raise InputError(f"motion_from is '{motion_from}': use current or previous")
    theirs = layout == "games202" or (layout == "auto" and not channels and has_matrices(folder))
    conventions = Conventions(layout, channels or {}, fov, motion_from, motion_up)
    if theirs and (reference is not None or conventions != Conventions(layout)):
        raise InputError(f"{folder} is read in the assignment's layout, which says where channels, "
                         "references and the camera are: leave options for them out, or give "
                         "another --layout")
    out = Path(out) if out else Path("data") / (
        find_files(folder).name if theirs else sequence_name(folder))
    notes: list[str] = []
    with writing(out, "render", alone=overwrite):
        if theirs:
            sequence = import_games202(folder, out, fps=fps, overwrite=overwrite, check=check,
                                       command=caller().command(), tell=notes.append)
        else:
            sequence = import_foreign(
                folder, out, conventions, reference=None if reference is None else Path(reference),
                fps=fps, overwrite=overwrite, command=caller().command(), tell=notes.append)
    for sentence in (*notes, *unfit_methods(sequence)):
        caller().inform(sentence)
    return sequence


def unfit_methods(sequence: FrameSequence) -> list[str]:
    """Which methods cannot run on a sequence's frames, and for want of what: sentences."""
    from onespp.denoise.catalog import METHODS, build  # loads Dr.Jit

    lacking: dict[tuple[str, ...], list[str]] = {}
    for name in METHODS:
        missing = tuple(c for c in build(name).needs if c not in sequence.channels)
        if missing:
            lacking.setdefault(missing, []).append(name)
    return [f"without {' and '.join(missing)} there is no {', '.join(names)}"
            for missing, names in lacking.items()]
