"""References in a folder: made, kept while they are unfinished, and grown from what is there."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent
from onespp.render.tracer.reference import (
    MOST_SAMPLES,
    PARTS,
    SampleSums,
    render_reference,
    whole_spp,
)
from onespp.render.tracer.renderer import Renderer

SECONDS_BETWEEN_SAVES = 10.0

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
             report: Progress = silent) -> None:
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
            report(done, total, what)
            if time.monotonic() - saved > SECONDS_BETWEEN_SAVES:
                self._save(index, sums)
                saved = time.monotonic()

        try:
            reference = render_reference(self.renderer, index, self.seed, spp,
                                         antialias=self.antialias, sums=sums, report=after_pass)
        except KeyboardInterrupt:
            if any(sums.samples):
                self._save(index, sums)
            raise
        self.sequence.write_reference(index, reference, {
            **self.provenance, "frame": str(index),
            "filter": "box" if self.antialias else "centre"})
        self.sequence.remove_partial(index)

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


def reference_notes(sequence: FrameSequence, frames: Sequence[int], asked: int) -> list[str]:
    """Sentences about references that are not just as asked for, by their samples or their kind."""
    notes, spp = [], whole_spp(asked)
    if spp != asked:
        notes.append(f"references have {PARTS} parts of equally many samples: {spp} spp instead of "
                     f"{asked}")
    if better := [found for i in frames if (found := sequence.reference_spp(i) or 0) > spp]:
        fewest, most = min(better), max(better)
        notes.append(f"kept {_count(len(better))} of "
                     f"{fewest if fewest == most else f'{fewest} to {most}'} spp, better than the "
                     f"{spp} spp asked for (--overwrite replaces them)")
    if old := sum(not sequence.has_parts(i) for i in frames):
        notes.append(f"kept {_count(old)} of an older version, without independent halves: scores "
                     "against them have a noise floor (--overwrite replaces them)")
    return notes


def _count(references: int) -> str:
    return f"{references} reference{'s' if references > 1 else ''}"
