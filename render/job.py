"""Renders an animation into a folder: frames, then references; goes on where it stopped."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.description import Scene
from scenes.fingerprint import fingerprint

from . import backend
from .channels import FRAME
from .json_file import checked
from .manifest import Manifest
from .reference import Progress, pass_sizes, render_reference
from .renderer import Renderer
from .sequence import Sequence as FrameSequence
from .versions import versions

SECONDS_BETWEEN_SAVES = 10.0

_SAVED = {"total", "squares", "passes", "samples", "spp", "antialias"}

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class RenderJob:
    """What to render.

    Attributes:
        frames: frame numbers. height, width: pixels. seed: of all random numbers.
        reference_spp: samples a pixel of the reference, None for none.
        antialias: the reference is box-filtered over each pixel instead of through its centre.
        channels: what each frame carries, see `render/channels.py`.
        direct, sampler: the estimator of direct light and the random numbers of the frames, see
            `render/renderer.py`. (References are always MIS and Sobol.)
    """

    scene: Scene
    frames: Sequence[int]
    height: int
    width: int
    seed: int = 0
    reference_spp: int | None = None
    antialias: bool = False
    channels: Sequence[str] = FRAME
    direct: str = "mis"
    sampler: str = "pcg"

    def manifest(self) -> Manifest:
        return checked(
            Manifest, "the sequence",
            scene=self.scene.name, about=self.scene.about, fingerprint=fingerprint(self.scene),
            frames=tuple(self.frames), width=self.width, height=self.height, fps=self.scene.fps,
            seed=self.seed, reference_spp=self.reference_spp, max_depth=self.scene.max_depth,
            direct=self.direct, sampler=self.sampler,
            reference_filter="box" if self.antialias else "centre",
            channels=tuple(self.channels), objects=self.scene.object_names,
            device=backend.choose(), versions=versions("mitsuba", "drjit", "numpy"),
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
    sequence = FrameSequence.create(folder, job.manifest(), overwrite)
    renderer: Renderer | None = None

    def ready() -> Renderer:  # a complete folder needs no scene
        nonlocal renderer
        renderer = renderer or Renderer(job.scene, job.height, job.width, direct=job.direct,
                                        sampler=job.sampler)
        return renderer

    provenance = {"software": f"onespp {versions()['onespp']}", "scene": job.scene.name,
                  "sceneFingerprint": sequence.manifest.fingerprint, "seed": str(job.seed),
                  "maxDepth": str(job.scene.max_depth), "direct": job.direct,
                  "sampler": job.sampler}
    for done, index in enumerate(job.frames, 1):
        if not sequence.has_frame(index):
            frame = ready().frame(index, job.seed, tuple(job.channels))
            sequence.write_frame(frame, provenance | {"frame": str(index), "spp": "1"})
        on_frames(done, "")
    if job.reference_spp is not None:
        for done, index in enumerate(job.frames):
            if not _has_reference(sequence, index, job):
                _render_reference(job, sequence, ready(), index, provenance,
                                  lambda part, done=done: on_references(done + part, ""))
            on_references(done + 1, "")
    return sequence


def _has_reference(sequence: FrameSequence, index: int, job: RenderJob) -> bool:
    return sequence.has_reference(index) and sequence.reference_spp(index) == job.reference_spp


def _render_reference(job: RenderJob, sequence: FrameSequence, renderer: Renderer, index: int,
                      provenance: dict[str, str], report: Callable[[float], None]) -> None:
    """One reference; its progress is kept on disk every few seconds and when interrupted."""
    spp = job.reference_spp
    assert spp is not None
    progress = _saved_progress(job, sequence, index) or Progress.start(job.height, job.width)
    saved = time.monotonic()

    def after_pass(progress: Progress) -> None:
        nonlocal saved
        report(progress.samples / spp)
        if time.monotonic() - saved > SECONDS_BETWEEN_SAVES:
            _save_progress(job, sequence, index, progress)
            saved = time.monotonic()

    try:
        reference = render_reference(renderer, index, job.seed, spp,
                                     antialias=job.antialias, progress=progress,
                                     after_pass=after_pass)
    except KeyboardInterrupt:
        if progress.passes:
            _save_progress(job, sequence, index, progress)
        raise
    sequence.write_reference(index, reference, provenance | {
        "frame": str(index), "filter": "box" if job.antialias else "centre"})
    sequence.remove_partial(index)


def _save_progress(job: RenderJob, sequence: FrameSequence, index: int, progress: Progress) -> None:
    sequence.write_partial(index, {
        "total": progress.total, "squares": progress.squares, "passes": progress.passes,
        "samples": progress.samples, "spp": job.reference_spp or 0, "antialias": job.antialias})


def _saved_progress(job: RenderJob, sequence: FrameSequence, index: int) -> Progress | None:
    """Progress of an interrupted run of the same job, if there is any that fits."""
    saved = sequence.read_partial(index)
    if saved is None or saved.keys() != _SAVED:
        return None
    size = (job.height, job.width, 3)
    if (saved["total"].shape != size or saved["squares"].shape != size
            or int(saved["spp"]) != job.reference_spp or bool(saved["antialias"]) != job.antialias):
        return None
    return Progress(saved["total"].astype(np.float64), saved["squares"].astype(np.float64),
                    int(saved["passes"]), int(saved["samples"]))
