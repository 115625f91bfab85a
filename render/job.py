"""Renders an animation into a folder: frames, then references; goes on where it stopped."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from onespp.render.channels import TRACING, TRAINING
from onespp.render.files.behind import writing_behind
from onespp.render.files.json_file import checked
from onespp.render.files.lock import when_free, writing
from onespp.render.files.manifest import Manifest, first_difference
from onespp.render.files.sequence import FrameSequence, another
from onespp.render.host.machine import machine
from onespp.render.host.turns import turn
from onespp.render.host.versions import versions
from onespp.render.progress import Progress, silent
from onespp.render.reference_error import FEWEST_SPP
from onespp.render.references import References
from onespp.render.tracer.reference import whole_spp
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene
from onespp.scenes.fingerprint import fingerprint, later_fingerprints

from .errors import InputError
from .host import backend

_SECONDS_FOR_OTHERS = 60.0


@dataclass(frozen=True)
class RenderJob:
    """What to render.

    Attributes:
        frames: frame numbers. height, width: pixels. seed: of all random numbers.
        reference_spp: samples a pixel of the reference, None for none; rounded up to what its four
            parts can share. reference_error: instead, the error in dB to which references are to
            tell the PSNR of the sequence, see `reference_error.py`.
        antialias: the reference is box-filtered over each pixel instead of through its centre.
        channels: what each frame carries, see `render/channels.py`; None: all that says something
            about this scene. added: channels beside those. training: of those by default, only
            what methods read and does not follow from the rest.
        half: store radiance and guides in half precision.
        direct, sampler: the estimator of direct light and the random numbers of the frames, see
            `render/renderer.py`. (References always compare candidates
            and are always Sobol.)
        jitter: "halton" moves all rays of a frame by an offset of its own within the pixel, see
            `tracer/camera_rays.py`; "none" sends them through centres.
        command: the command line, for the manifest. dated: whether that says when it was made.
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
    training: bool = False
    half: bool = False
    reference_error: float | None = None
    jitter: str = "none"
    dated: bool = True

    @cached_property
    @turn()
    def renderer(self) -> Renderer:
        return Renderer(self.scene, self.height, self.width, direct=self.direct,
                        sampler=self.sampler, jitter=self.jitter)

    def with_other_noise(self, seed: int) -> RenderJob:
        """The same frames of another seed, without references, by the same renderer."""
        other = replace(self, seed=seed, reference_spp=None, reference_error=None)
        other.__dict__["renderer"] = self.renderer  # compiled already
        return other

    @property
    def fewest_spp(self) -> int | None:
        """Samples a pixel that a reference gets at least, None where there is to be none.

        Raises:
            InputError: there can be no such reference, or it is asked for in two ways.
        """
        if self.reference_error is None:
            return None if self.reference_spp is None else whole_spp(self.reference_spp)
        if self.reference_spp is not None:
            raise InputError("--reference-spp and --reference-error both say how good references "
                             "are to be: use one of them")
        if not 0 < self.reference_error < float("inf"):
            raise InputError(f"--reference-error is {self.reference_error}: use a number of dB "
                             "above 0, as 0.05")
        return FEWEST_SPP

    def channel_names(self) -> tuple[str, ...]:
        """The channels asked for, or else what the renderer has to say about the scene."""
        names = self.renderer.channels if self.channels is None else self.channels
        if self.training:
            names = [name for name in names if name in TRAINING]
        return tuple(dict.fromkeys((*names, *self.added)))

    def manifest(self) -> Manifest:
        return checked(
            Manifest, "the sequence",
            scene=self.scene.name, about=self.scene.about, fingerprint=fingerprint(self.scene),
            later=later_fingerprints(self.scene, self.frames), frames=tuple(self.frames),
            width=self.width, height=self.height, fps=self.scene.fps,
            seed=self.seed, reference_spp=self.fewest_spp, max_depth=self.scene.max_depth,
            direct=self.direct, sampler=self.sampler, jitter=self.jitter, tracing=TRACING,
            reference_filter="box" if self.antialias else "centre",
            channels=self.channel_names(), half=self.half,
            objects=self.renderer.stage.images.names(),
            moving=self.renderer.stage.images.moving(),
            device=backend.choose(), machine=machine(backend.choose()),
            versions=versions("mitsuba", "drjit", "numpy"),
            commands=(self.command,) if self.command else (),
            created=datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
            if self.dated else "")


def render_sequence(job: RenderJob, folder: Path, *, overwrite: bool = False,
                    progress: Progress = silent,
                    tell: Callable[[str], None] = lambda sentence: None,
                    part: Sequence[int] | None = None) -> FrameSequence:
    """Render what the folder does not hold yet.

    Args:
        part: which of the job's frames, None: all. The others are left to other processes, which
            may write into the folder meanwhile.
        progress: told of the frames that are done, and of the references, in fractions.
        tell: told what references of a wanted error are expected to cost, before they are rendered.

    Raises:
        InputError: the folder holds something else, or the disk refuses.
        SceneError: the scene cannot be built.
    """
    spp = job.fewest_spp
    job.scene.try_frames(job.frames)  # they may lie beyond those that the scene file was tried at
    _ = job.renderer  # a scene that can't be built replaces nothing
    manifest = job.manifest()
    if not overwrite:
        _check_later_frames(job, folder, manifest)
    with nullcontext() if part is None else _changing_manifest(folder):
        sequence = FrameSequence.create(folder, manifest, overwrite)
    frames = job.frames if part is None else part
    provenance = {"software": f"onespp {versions()['onespp']}", "scene": job.scene.name,
                  "sceneFingerprint": sequence.manifest.fingerprint, "seed": str(job.seed),
                  "maxDepth": str(job.scene.max_depth), "direct": job.direct,
                  "sampler": job.sampler}
    count = len(frames)
    what = f"render {job.scene.name} {job.width}x{job.height}"
    with writing_behind() as hand_over:
        for done, index in enumerate(frames, 1):
            if not sequence.frame_is_whole(index):
                hand_over(sequence.write_frame,  # (a name here would keep a third frame alive)
                          job.renderer.frame(index, job.seed, job.channel_names()),
                          provenance | {"frame": str(index), "spp": "1"})
            progress(done, count, what)
    if spp is not None:
        references = References(job.renderer, sequence, job.seed, job.antialias, provenance)
        what = f"reference, {spp} spp"
        if job.reference_error is not None:
            references.grow_to_error(frames, job.reference_error, progress, tell)
        else:
            for done, index in enumerate(frames):
                references.grow(index, spp, lambda some, whole, *_, done=done: progress(
                    done + some / whole, count, what))
                progress(done + 1, count, what)
        if part is None:
            sequence = sequence.with_reference_spp()
    return sequence


@contextmanager
def _changing_manifest(folder: Path) -> Iterator[None]:
    """Waits for others who write other frames into the folder."""
    with ExitStack() as held:
        when_free(lambda: held.enter_context(writing(folder, "manifest")), _SECONDS_FOR_OTHERS, 0.1)
        yield


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
