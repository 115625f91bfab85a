"""References in a folder: made, kept while they are unfinished, and grown from what is there.

Growing until the error is as asked for decides by what is on the disk alone: interrupted and gone
on with, it takes the same steps to the same bytes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent
from onespp.render.reference_error import (
    FEWEST_SPP,
    MOST_SPP,
    FrameNoise,
    expected_error,
    expected_spp,
    frame_noise,
    next_to_grow,
)
from onespp.render.tracer.reference import (
    MOST_SAMPLES,
    PARTS,
    SampleSums,
    render_reference,
    whole_spp,
)
from onespp.render.tracer.renderer import Renderer

SECONDS_BETWEEN_SAVES = 10.0

_OF_OLD = 64  # samples: an older version's reference is kept from here on, and else made anew
_TIMED_PATHS = 1 << 20  # or 64 samples

_TOTALS = tuple(f"total{part}" for part in range(PARTS))
_SAVED = {*_TOTALS, "samples", "antialias"}


@dataclass(frozen=True)
class References:
    """The references of a sequence, with what it takes to render them.

    Attributes:
        renderer, seed, antialias: as in `tracer/reference.py`.
        provenance: for the header of their files.
    """

    renderer: Renderer
    sequence: FrameSequence
    seed: int
    antialias: bool
    provenance: Mapping[str, str]

    def grow(self, index: int, spp: int,
             progress: Progress = silent) -> None:
        """Render a frame's reference, if there is none of so many samples (a multiple of 4).

        It goes on from one of fewer samples, and from what an interrupt left; its own progress is
        on the disk every few seconds, and when interrupted. One of an older version, without
        parts, is kept if it is good enough, and else made anew.
        """
        if self._samples(index) >= spp:
            return
        sums = max((sums for sums in (self._smaller(index), self._saved(index)) if sums),
                   key=lambda sums: sum(sums.samples),
                   default=SampleSums.start(*self.sequence.size))
        saved = time.monotonic()

        def after_pass(done: float, total: float, what: str, note: str = "", /) -> None:
            nonlocal saved
            progress(done, total, what)
            if time.monotonic() - saved > SECONDS_BETWEEN_SAVES:
                self._save(index, sums)
                saved = time.monotonic()

        try:
            reference = render_reference(self.renderer, index, self.seed, spp,
                                         antialias=self.antialias, sums=sums, progress=after_pass)
        except KeyboardInterrupt:
            if any(sums.samples):
                self._save(index, sums)
            raise
        self.sequence.write_reference(index, reference, {
            **self.provenance, "frame": str(index),
            "filter": "box" if self.antialias else "centre"})
        self.sequence.remove_partial(index)

    def grow_to_error(self, frames: Sequence[int], decibels: float,
                      progress: Progress = silent,
                      tell: Callable[[str], None] = lambda sentence: None) -> None:
        """Render and double references until the headline is known to `decibels`.

        The headline is the mean over frames of the PSNR of a method of 40 dB, and its error that
        of `reference_error.py`. References of an older version have no halves that could tell;
        those of 64 samples or more are kept and left out.

        Args:
            progress: told of the frames that are done, as far as can be foreseen.
            tell: told what it is expected to cost, and that not more can be had.
        """
        what, count = f"reference, to {decibels:g} dB", len(frames)
        growing = [i for i in frames
                   if self._samples(i) < _OF_OLD or self.sequence.has_parts(i)]
        noises: dict[int, FrameNoise] = {}
        there = [i for i in growing if self._samples(i)] or growing[:1]
        for index in there:
            self.grow(index, self._fewest(index), lambda done, total, *_: progress(0, count, what))
            self._measure(index, noises)
        self._tell_cost(growing, noises, decibels, tell)

        def grow(index: int, spp: int, target: int) -> None:
            others = sum(noise.spp for i, noise in noises.items() if i != index)
            self.grow(index, spp, lambda done, total, *_: progress(
                count * min((others + done) / target, 0.99), count, what))  # 1 is for the end
            self._measure(index, noises)

        target = _total(growing, noises, decibels)
        for index in growing:
            if index not in noises:
                grow(index, FEWEST_SPP, target)
        target = _total(growing, noises, decibels)
        while (step := next_to_grow(noises, decibels)) is not None:
            grow(*step, target)
        if (reached := expected_error(noises.values())) > decibels:
            tell(f"references end at {MOST_SPP} samples a pixel: the PSNR of a method of 40 dB is "
                 f"known to {reached:.2g} dB, not {decibels:g}")
        progress(count, count, what)

    def _fewest(self, index: int) -> int:
        """Samples a pixel that tell how many it takes."""
        old = self._samples(index) and not self.sequence.has_parts(index)
        return _OF_OLD if old else FEWEST_SPP

    def _measure(self, index: int, noises: dict[int, FrameNoise]) -> None:
        reference = self.sequence.read_reference(index)
        if reference.parts is not None and reference.spp is not None:
            noises[index] = frame_noise(reference.parts, reference.spp)

    def _tell_cost(self, frames: Sequence[int], noises: Mapping[int, FrameNoise], decibels: float,
                   tell: Callable[[str], None]) -> None:
        """What there is to do, and how long it is likely to take; nothing where nothing is."""
        spp = expected_spp(_foreseen(frames, noises), decibels)
        left = sum(max(0, n - self._samples(i)) for i, n in spp.items())
        if left == 0:
            return
        height, width = self.sequence.size
        timed = min(64, -(-_TIMED_PATHS // (height * width)))
        self.renderer.sample_sum(frames[0], self.seed, 0, 1, self.antialias)  # compiles
        start = time.perf_counter()
        self.renderer.sample_sum(frames[0], self.seed, 0, timed, self.antialias)
        seconds = (time.perf_counter() - start) / timed
        fewest, most = min(spp.values()), max(spp.values())
        tell(f"references to {decibels:g} dB are likely to take "
             f"{fewest if fewest == most else f'{fewest} to {most}'} samples a pixel, so "
             f"{_duration(left * seconds)} at {width * height / seconds / 1e6:.2g} million paths a "
             "second")

    def _samples(self, index: int) -> int:
        """Samples a pixel of a frame's reference; 0 where there is none, or a damaged one."""
        try:
            return (self.sequence.reference_spp(index) or 0
                    if self.sequence.has_reference(index) else 0)
        except InputError:
            return 0

    def _save(self, index: int, sums: SampleSums) -> None:
        self.sequence.write_partial(index, {
            **dict(zip(_TOTALS, (total for total, _ in sums.parts))),
            "samples": np.array(sums.samples), "antialias": self.antialias})

    def _saved(self, index: int) -> SampleSums | None:
        """What an interrupted run left of a frame's reference, if this one can go on from it."""
        saved = self.sequence.read_partial(index)
        if saved is None or saved.keys() != _SAVED:
            return None
        totals = [saved[name] for name in _TOTALS]
        samples, filtered = saved["samples"], saved["antialias"]
        if (any(total.shape != (*self.sequence.size, 3) or total.dtype != np.float64
                for total in totals) or samples.shape != (PARTS,) or samples.dtype.kind not in "iu"
                or filtered.shape != () or filtered.dtype.kind != "b"):
            return None
        counts = [int(n) for n in samples]
        if bool(filtered) != self.antialias or not 0 <= min(counts) <= max(
                counts) <= MOST_SAMPLES // PARTS:
            return None
        return SampleSums(tuple(zip(totals, counts)))

    def _smaller(self, index: int) -> SampleSums | None:
        """What a reference of fewer samples amounts to."""
        try:
            if not (self._samples(index) and self.sequence.has_parts(index)):
                return None
            return SampleSums.of(self.sequence.read_reference(index))
        except InputError:  # damaged: it is made again
            return None


def reference_notes(sequence: FrameSequence, frames: Sequence[int],
                    asked: int | None) -> list[str]:
    """Sentences about references that are not just as asked for, by their samples or their kind.

    Args:
        asked: samples a pixel, None where an error was asked for.
    """
    notes = []
    spp = None if asked is None else whole_spp(asked)
    if spp != asked:
        notes.append(f"references have {PARTS} parts of equally many samples: {spp} spp instead of "
                     f"{asked}")
    found = [sequence.reference_spp(i) or 0 for i in frames]
    if spp is not None and (better := [n for n in found if n > spp]):
        fewest, most = min(better), max(better)
        notes.append(f"kept {_count(len(better))} of "
                     f"{fewest if fewest == most else f'{fewest} to {most}'} spp, better than the "
                     f"{spp} spp asked for (--overwrite replaces them)")
    if old := sum(not sequence.has_parts(i) for i in frames):
        notes.append(f"kept {_count(old)} of an older version, without independent halves: scores "
                     "against them have a noise floor (--overwrite replaces them)")
    return notes


def _foreseen(frames: Sequence[int], noises: Mapping[int, FrameNoise]) -> dict[int, FrameNoise]:
    """Noise of all frames with the fewest samples or more; those not rendered are as the others."""
    known = list(noises.values())
    if not known:
        return {}
    like = [noise.at(FEWEST_SPP) for noise in known]
    usual = FrameNoise(FEWEST_SPP, *(float(np.mean([getattr(noise, part) for noise in like]))
                                     for part in ("crossed", "squared", "bent")))
    return {i: max(noises[i], noises[i].at(FEWEST_SPP), key=lambda noise: noise.spp)
            if i in noises else usual for i in frames}


def _total(frames: Sequence[int], noises: Mapping[int, FrameNoise], decibels: float) -> int:
    """Samples a pixel of all frames' references together, in the end; at least 1."""
    return max(1, sum(expected_spp(_foreseen(frames, noises), decibels).values()))


def _duration(seconds: float) -> str:
    for unit, size in (("hours", 3600), ("minutes", 60)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} seconds"


def _count(references: int) -> str:
    return f"{references} reference{'s' if references > 1 else ''}"
