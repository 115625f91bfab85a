"""Renders an animation into a folder: frames, then references; goes on where it stopped."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from onespp.render.files.json_file import checked
from onespp.render.files.manifest import Manifest, first_difference
from onespp.render.files.sequence import FrameSequence, another
from onespp.render.host.machine import machine
from onespp.render.host.versions import versions
from onespp.render.tracer.reference import SampleSums, pass_sizes, render_reference
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene
from onespp.scenes.fingerprint import fingerprint, later_fingerprints

from .errors import InputError
from .host import backend

SECONDS_BETWEEN_SAVES = 10.0

_MOST_SPP = 1 << 22  # of another job's progress: a damaged file may claim anything

_SAVED = {"total", "squares", "passes", "samples", "spp", "antialias"}

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class RenderJob:
    """What to render.

    Attributes:
        frames: frame numbers. height, width: pixels. seed: of all random numbers.
        reference_spp: samples a pixel of the reference, None for none.
        antialias: the reference is box-filtered over each pixel instead of through its centre.
        channels: what each frame carries, see `render/channels.py`; None: all that says something
            about this scene. added: channels beside those.
        direct, sampler: the estimator of direct light and the random numbers of the frames, see
            `render/renderer.py`. (References always compare candidates
            and are always Sobol.)
        command: the command line, for the manifest.
    """

    scene: Scene
    frames: Sequence[int]
    height: int
    width: int
    seed: int = 0
    reference_spp: int | None = None
    antialias: bool = False
    channels: Sequence[str] | None = None
    direct: str = "resampled"
    sampler: str = "zsobol"
    command: str = ""
    added: Sequence[str] = ()

    @cached_property
    def renderer(self) -> Renderer:
        return Renderer(self.scene, self.height, self.width, direct=self.direct,
                        sampler=self.sampler)

    def channel_names(self) -> tuple[str, ...]:
        """The channels asked for, or else what the renderer has to say about the scene."""
        names = self.renderer.channels if self.channels is None else self.channels
        return tuple(dict.fromkeys((*names, *self.added)))

    def manifest(self) -> Manifest:
        return checked(
            Manifest, "the sequence",
            scene=self.scene.name, about=self.scene.about, fingerprint=fingerprint(self.scene),
            later=later_fingerprints(self.scene, self.frames), frames=tuple(self.frames),
            width=self.width, height=self.height, fps=self.scene.fps,
            seed=self.seed, reference_spp=self.reference_spp, max_depth=self.scene.max_depth,
            direct=self.direct, sampler=self.sampler,
            reference_filter="box" if self.antialias else "centre",
            channels=self.channel_names(), objects=self.scene.object_names,
            device=backend.choose(), machine=machine(backend.choose()),
            versions=versions("mitsuba", "drjit", "numpy"),
            commands=(self.command,) if self.command else (),
            created=datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"))


def render_sequence(job: RenderJob, folder: Path, *, overwrite: bool = False,
                    on_frames: Report = lambda done, note: None,
                    on_references: Report = lambda done, note: None) -> FrameSequence:
    """Render what the folder does not hold yet.

    Args:
        on_frames: told the number of frames done. on_references: told the number of references
            done, in fractions.

    Raises:
        InputError: the folder holds something else, or the disk refuses.
        SceneError: the scene cannot be built.
    """
    if job.reference_spp is not None:
        pass_sizes(job.reference_spp)
    job.scene.try_frames(job.frames)  # they may lie beyond those that the scene file was tried at
    _ = job.renderer  # a scene that can't be built replaces nothing
    manifest = job.manifest()
    if not overwrite:
        _check_later_frames(job, folder, manifest)
    sequence = FrameSequence.create(folder, manifest, overwrite)
    provenance = {"software": f"onespp {versions()['onespp']}", "scene": job.scene.name,
                  "sceneFingerprint": sequence.manifest.fingerprint, "seed": str(job.seed),
                  "maxDepth": str(job.scene.max_depth), "direct": job.direct,
                  "sampler": job.sampler}
    for done, index in enumerate(job.frames, 1):
        if not sequence.frame_is_whole(index):
            frame = job.renderer.frame(index, job.seed, job.channel_names())
            sequence.write_frame(frame, provenance | {"frame": str(index), "spp": "1"})
        on_frames(done, "")
    if job.reference_spp is not None:
        for done, index in enumerate(job.frames):
            if not _has_reference(sequence, index, job):
                _render_reference(job, sequence, index, provenance,
                                  lambda part, done=done: on_references(done + part, ""))
            on_references(done + 1, "")
        sequence = sequence.with_reference_spp()
    return sequence


def _check_later_frames(job: RenderJob, folder: Path, manifest: Manifest) -> None:
    """InputError if the folder's frames after the scene's last one are of another scene.

    The scene's fingerprint ends with its last frame, but any frame can be asked for.
    """
    if not (folder / "manifest.json").exists():
        return
    there = FrameSequence.open(folder)
    if first_difference(there.manifest, manifest) is not None:
        return  # said by those who continue it
    made = [i for i in there.frames if there.has_frame(i) or there.has_reference(i)
            or there.has_partial(i)]
    for i, expected in later_fingerprints(job.scene, made).items():
        if there.manifest.later.get(i) != expected:
            raise InputError(another(folder, "content", f" (what frame {i} was made from has "
                                     "changed)"))


def kept_references(sequence: FrameSequence, frames: Sequence[int], spp: int) -> str:
    """A sentence about references that have more samples than asked for; "" if there are none."""
    better = [found for i in frames if (found := sequence.reference_spp(i) or 0) > spp]
    if not better:
        return ""
    fewest, most = min(better), max(better)
    return (f"kept {len(better)} reference{'s' if len(better) > 1 else ''} of "
            f"{fewest if fewest == most else f'{fewest} to {most}'} spp, better than the {spp} spp "
            "asked for (--overwrite replaces them)")


def _has_reference(sequence: FrameSequence, index: int, job: RenderJob) -> bool:
    """Whether a frame has a reference as good as asked for, or better."""
    spp = job.reference_spp or 0
    try:
        return sequence.has_reference(index) and (sequence.reference_spp(index) or 0) >= spp
    except InputError:  # damaged: it is made again
        return False


def _render_reference(job: RenderJob, sequence: FrameSequence, index: int,
                      provenance: dict[str, str], report: Callable[[float], None]) -> None:
    """One reference; its progress is kept on disk every few seconds and when interrupted."""
    spp = job.reference_spp
    assert spp is not None
    known = [progress for progress in (_saved_progress(job, sequence, index),
                                       _smaller_reference(job, sequence, index)) if progress]
    progress = max(known, key=lambda progress: progress.samples,
                   default=SampleSums.start(job.height, job.width))
    saved = time.monotonic()

    def after_pass(progress: SampleSums) -> None:
        nonlocal saved
        report(progress.samples / spp)
        if time.monotonic() - saved > SECONDS_BETWEEN_SAVES:
            _save_progress(job, sequence, index, progress)
            saved = time.monotonic()

    try:
        if progress.samples < spp:
            reference = render_reference(job.renderer, index, job.seed, spp,
                                         antialias=job.antialias, progress=progress,
                                         after_pass=after_pass)
        else:  # what an interrupted run for more samples left is enough
            reference = progress.reference()
    except KeyboardInterrupt:
        if progress.passes and _is_after_a_pass(progress, _sizes(job, spp)):
            _save_progress(job, sequence, index, progress)
        raise
    sequence.write_reference(index, reference, provenance | {
        "frame": str(index), "filter": "box" if job.antialias else "centre"})
    sequence.remove_partial(index)


def _save_progress(job: RenderJob, sequence: FrameSequence, index: int,
                   progress: SampleSums) -> None:
    sequence.write_partial(index, {
        "total": progress.total, "squares": progress.squares, "passes": progress.passes,
        "samples": progress.samples, "spp": job.reference_spp or 0, "antialias": job.antialias})


def _saved_progress(job: RenderJob, sequence: FrameSequence, index: int) -> SampleSums | None:
    """Sums of an interrupted run, if this job can go on from it, or needs no more."""
    saved = sequence.read_partial(index)
    if saved is None or saved.keys() != _SAVED:
        return None
    sums = saved["total"], saved["squares"]
    counts = [saved[name] for name in ("passes", "samples", "spp", "antialias")]
    if (any(array.shape != (job.height, job.width, 3) or array.dtype != np.float64
            for array in sums) or any(n.shape != () or n.dtype.kind not in "biu" for n in counts)):
        return None
    passes, samples, spp, antialias = map(int, counts)
    progress = SampleSums(*sums, passes, samples)
    if (antialias != job.antialias or not 2 <= spp <= max(_MOST_SPP, job.reference_spp or 0)
            or not _is_after_a_pass(progress, _sizes(job, spp))):
        return None
    enough = samples >= (job.reference_spp or 0) and passes >= 2
    return progress if enough or _begins(job, _sizes(job, spp)[:passes]) else None


def _smaller_reference(job: RenderJob, sequence: FrameSequence, index: int) -> SampleSums | None:
    """What a reference of fewer samples amounts to, if its passes are the first of ours."""
    try:
        smaller = sequence.read_reference(index) if sequence.has_reference(index) else None
    except InputError:  # damaged: it is made again
        return None
    if smaller is None or smaller.spp is None or not 2 <= smaller.spp < (job.reference_spp or 0):
        return None
    passes = _sizes(job, smaller.spp)
    return SampleSums.of(smaller, len(passes)) if _begins(job, passes) else None


def _sizes(job: RenderJob, spp: int | None) -> list[int]:
    return pass_sizes(spp or 0, job.height * job.width)


def _begins(job: RenderJob, sizes: list[int]) -> bool:
    """Whether passes of these sizes are the first ones of the job's reference."""
    return _sizes(job, job.reference_spp)[:len(sizes)] == sizes


def _is_after_a_pass(progress: SampleSums, sizes: list[int]) -> bool:
    """Whether it is the state between two passes, and not one torn by an interrupt."""
    return (0 <= progress.passes <= len(sizes)
            and progress.samples == sum(sizes[:progress.passes]))
