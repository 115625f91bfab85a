"""Rendering into a folder, and opening what is there."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Iterable
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING

from onespp.render.channels import asked_channels
from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import parse_frames, part_of
from onespp.render.files.lock import writing, writing_share
from onespp.render.files.manifest import DIRECT, JITTERS, SAMPLERS
from onespp.render.files.sequence import FrameSequence
from onespp.render.host.memory import require_memory
from onespp.render.host.turns import turn
from onespp.scenes import catalog
from onespp.scenes.description import Scene

from .caller import caller, public
from .loading import load

if TYPE_CHECKING:
    from onespp.render.job import RenderJob

LARGEST_SIDE = 16384


@public
def render(scene: str | Path | Scene, out: Path | str | None = None, *,
           frames: int | Iterable[int] | None = None, size: tuple[int, int] | None = None,
           seed: int = 0, reference_spp: int | None = None, reference_error: float | None = None,
           antialias: bool = False, channels: str | Iterable[str] | None = None,
           half: bool = False, direct: str = "resampled", sampler: str = "zsobol",
           jitter: str = "none", overwrite: bool = False, part: str | None = None) -> FrameSequence:
    """Render frames of a scene at one sample a pixel.

    What the folder holds already is not rendered again: the same call goes on where it was stopped.

    Args:
        scene: as for `load`: a name of `onespp.scenes()`, the path of a `.py` file or of a Mitsuba
            3 `.xml` or a glTF file, or a `Scene`.
        out: folder of the sequence. None: a temporary one that is removed when Python ends, so
            that a cell can be run again with other sizes; give a folder to keep the frames.
        frames: how many, from frame 0 on, or their numbers, increasing; default all.
        size: (height, width), pixels; default the scene's.
        seed: of all random numbers, 0 or more.
        reference_spp: also render ground truth with so many samples a pixel.
        reference_error: also render ground truth, of as many samples as it takes to know the PSNR
            of a method of 40 dB to so many dB. Instead of `reference_spp`.
        antialias: box-filter the reference over each pixel instead of its centre.
        channels: what frames carry, a list of names; default what says something about the scene.
            A text as for `--channels`: "+gradient" adds to the default, "training" is what
            methods read.
        half: store radiance and guides in half precision.
        direct: "resampled" (all lights, with visibility apart) or "mis", as Mitsuba's path.
        sampler: "zsobol", "bluenoise" or "pcg".
        jitter: "halton" moves all rays of a frame by an offset of its own within the pixel, for
            temporal anti-aliasing (compare with references of `antialias`); "none".
        overwrite: replace another sequence in the folder.
        part: "K/N" renders every N-th frame only, from the K-th on. Other processes may render the
            other parts into the folder at the same time; the same call without it, in the end,
            checks that all is there.

    Returns:
        The sequence. Its frames have (h, w, 3) float32 linear Rec. 709 radiance in `color`, and
        guides; `read_frame(i)` gives one, iterating over the sequence all of them.

    Raises:
        InputError: a parameter that cannot be used, or the folder holds something else.
        SceneError: no such scene, or it cannot be built.
        KeyboardInterrupt: at the end of a step; what was finished is kept in the folder.

    Example:
        >>> import onespp
        >>> sequence = onespp.render("box", frames=2, size=(12, 16))
        >>> sequence.frames, sequence.read_frame(1)["color"].shape
        ([0, 1], (12, 16, 3))
    """
    made = load(scene)
    height, width = (made.height, made.width) if size is None else checked_size(size)
    numbers = _numbers(frames, made)
    if seed < 0:
        raise InputError(f"--seed is {seed}: use 0 or more")
    _check_choice("direct", direct, DIRECT)
    _check_choice("sampler", sampler, SAMPLERS)
    _check_choice("jitter", jitter, JITTERS)
    require_memory(height, width)
    text = channels if channels is None or isinstance(channels, str) else ",".join(channels)
    names, added = asked_channels(text)
    with turn():
        from onespp.render.job import RenderJob, render_sequence  # imports Mitsuba
        from onespp.render.references import reference_notes

    who = caller()
    job = RenderJob(made, numbers, height, width, seed, reference_spp, antialias, names,
                    direct, sampler, who.command(), added, text == "training",
                    half, reference_error, jitter)
    folder = _temporary() if out is None else Path(out)
    chosen = None if part is None else _chosen(job, part, overwrite)
    held = (writing(folder, "render", alone=overwrite) if part is None else
            writing_share(folder, "render", part.replace("/", "-of-")))
    with held, who.progress() as report:
        sequence = render_sequence(job, folder, overwrite=overwrite, progress=report, tell=who.tell,
                                   part=chosen)
    if chosen is not None:
        return sequence
    if job.fewest_spp is not None:
        for sentence in reference_notes(sequence, numbers, reference_spp):
            who.inform(sentence)
    return sequence


@public
def open(folder: Path | str) -> FrameSequence:
    """The sequence in a folder, which `render` or an import made.

    Raises:
        InputError: there is none, or its manifest is damaged.

    Example:
        >>> import onespp
        >>> there = onespp.render("box", frames=1, size=(12, 16)).folder
        >>> onespp.open(there).frames
        [0]
    """
    return FrameSequence.open(folder)


@public
def scenes() -> dict[str, str]:
    """The scenes that `render` knows by name, and what each one is.

    Example:
        >>> import onespp
        >>> "box" in onespp.scenes()
        True
    """
    return {name: catalog.load(name).about for name in catalog.names()}


def checked_size(size: tuple[int, int]) -> tuple[int, int]:
    """(height, width) as plain ints; InputError where they are none."""
    try:
        height, width = size
    except (TypeError, ValueError):
        raise InputError(f"--size is {size!r}: use (height, width), as (360, 640)") from None
    for side in (height, width):
        if not isinstance(side, Integral) or not 1 <= side <= LARGEST_SIDE:
            raise InputError(f"--size is {size!r}: use (height, width) of whole numbers from 1 "
                             f"to {LARGEST_SIDE}")
    return int(height), int(width)


def _numbers(frames: int | Iterable[int] | None, scene: Scene) -> tuple[int, ...]:
    if frames is None:
        return tuple(range(scene.frames))
    if isinstance(frames, Integral):
        if frames < 1:
            raise InputError(f"--frames is {frames}: use 1 or more, or a list of frame numbers")
        return tuple(range(int(frames)))
    if isinstance(frames, str) or not isinstance(frames, Iterable):
        raise InputError(f"--frames is {frames!r}: use how many, or their numbers, as "
                         "range(4, 8)")
    return parse_frames(",".join(map(str, frames)))


def _chosen(job: RenderJob, part: str, overwrite: bool) -> list[int]:
    """The frames of a part; InputError where what is asked for takes all of them."""
    chosen = part_of(job.frames, part)
    if not chosen:
        raise InputError(f"--part {part} of {len(job.frames)} frames has none: use fewer parts")
    for name, asked, why in (
            ("--overwrite", overwrite, "removes what others render: remove the folder first"),
            ("--reference-error", job.reference_error is not None,
             "looks at all frames: use --reference-spp, or ask for the error in the end, without "
             "--part")):
        if asked:
            raise InputError(f"{name} does not go with --part, as it {why}")
    return chosen


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f"--{name} is {value!r}: use {' or '.join(choices)}")


_temporary_folders: list[tuple[int, str]] = []


def _temporary() -> Path:
    """A new folder that is removed when this process ends."""
    if not _temporary_folders:
        atexit.register(_remove_temporary)
    _temporary_folders.append((os.getpid(), tempfile.mkdtemp(prefix="onespp-")))
    return Path(_temporary_folders[-1][1])


def _remove_temporary() -> None:
    for process, folder in _temporary_folders:
        if process == os.getpid():  # not the folders of the process that this one was forked from
            shutil.rmtree(folder, ignore_errors=True)
