"""Is a score by halves of a small reference that against a large one?

Sequences of the same frames, seen with references of different samples: the first has the results
and the large references, which stand for the truth; of each of the others its references alone are
taken. `psnr_plain` and `psnr_srgb` of the results against each small one stand beside that against
the truth, with the standard error that the small reference says of itself and the one that the
truth has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from onespp.denoise.metrics.errors import psnr
from onespp.denoise.metrics.estimate import Estimate, Number, number
from onespp.denoise.metrics.image import Target, display_error, pair
from onespp.denoise.metrics.means import mean_decibels
from onespp.render.errors import InputError
from onespp.render.files.manifest import first_difference
from onespp.render.files.sequence import FrameSequence, Reference


@dataclass(frozen=True)
class Trust:
    """What one reference says of one method.

    Attributes:
        spp: samples a pixel of the reference, all parts together. plain: PSNR against its mean,
            mean over frames. halves: by its halves; None where it has none.
    """

    spp: int | None
    plain: float
    halves: Number | None


def compare_references(truth: FrameSequence, others: list[FrameSequence],
                       progress: Callable[[int], None] = lambda done: None
                       ) -> dict[str, list[Trust]]:
    """Method -> what each reference says of it, that of the truth first.

    Args:
        progress: called with the number of frames done.

    Raises:
        InputError: the sequences are not of the same frames, a reference is missing, or there is
            no result.
    """
    sequences = [truth, *others]
    names = truth.methods()
    if not names:
        raise InputError(f"{truth.folder} has no results: denoise it first")
    for other in others:
        key = first_difference(truth.manifest, other.manifest.model_copy(update={
            "seed": truth.manifest.seed, "reference_spp": truth.manifest.reference_spp,
            "channels": truth.manifest.channels, "tracing": truth.manifest.tracing,
            "commands": truth.manifest.commands}))
        if key:
            raise InputError(f"{other.folder} has another {key} than {truth.folder}: references "
                             "of the same frames can be compared, with other seeds and samples")
    plain: dict[tuple[str, int], list[float]] = {}
    squares: dict[tuple[str, int], list[Estimate]] = {}
    spp: list[int | None] = [None] * len(sequences)
    frames = [i for i in truth.frames if truth.has_reference(i)]
    for done, i in enumerate(frames):
        for k, sequence in enumerate(sequences):
            target, spp[k] = _target(sequence, i, spp[k])
            for name in names:
                if not truth.has_result(name, i):
                    continue
                images = pair(truth.read_result(name, i), target)
                plain.setdefault((name, k), []).append(psnr(*images.srgb))
                if (estimate := display_error(images)) is not None:
                    squares.setdefault((name, k), []).append(estimate.without_noise())
        progress(done + 1)
    if not plain:
        raise InputError(f"{truth.folder} has no frame with a reference and a result")
    return {name: [Trust(spp[k], mean_decibels(plain[name, k]),
                         number("dB", squares[name, k]) if (name, k) in squares else None)
                   for k in range(len(sequences))] for name in names if (name, 0) in plain}


def _target(sequence: FrameSequence, i: int, spp: int | None) -> tuple[Target, int | None]:
    """A frame's reference, and the fewest samples so far."""
    if not sequence.has_reference(i):
        raise InputError(f"{sequence.folder} has no reference of frame {i}: render it first")
    reference: Reference = sequence.read_reference(i)
    known = [n for n in (spp, reference.spp) if n is not None]
    return Target(reference.color, reference.parts), min(known, default=None)


def markdown(scene: str, found: dict[str, list[Trust]]) -> str:
    """The table: a row a method; of the truth its halves, where it has them."""
    first = next(iter(found.values()))
    heads = ["PSNR, dB", f"true ({first[0].spp} spp)",
             *(f"{what} {t.spp} spp" for t in first[1:] for what in ("plain", "halves"))]
    rows = [[f"{scene}, {name}", _text(trusts[0].halves, trusts[0].plain),
             *(text for t in trusts[1:]
               for text in (f"{t.plain:.2f}", "-" if t.halves is None else _text(t.halves, 0.0)))]
            for name, trusts in found.items()]
    return "\n".join("| " + " | ".join(row) + " |" for row in (heads, ["---"] * len(heads), *rows))


def off(found: dict[str, list[Trust]]) -> list[tuple[int | None, float, float, float]]:
    """For each small reference: spp, RMS of plain - true and of halves - true, and the latter in
    standard errors (about 1 where errors are what they say)."""
    rows = []
    for k in range(1, len(next(iter(found.values())))):
        plain, halves, scaled = [], [], []
        for trusts in found.values():
            true = trusts[0].halves or Number(trusts[0].plain, None)
            t = trusts[k]
            plain.append(t.plain - true.value)
            if t.halves is not None and not t.halves.bound:
                halves.append(t.halves.value - true.value)
                deviation = np.hypot(t.halves.error or 0.0, true.error or 0.0)
                scaled.append(halves[-1] / deviation if deviation else 0.0)
        rows.append((next(iter(found.values()))[k].spp, _rms(plain), _rms(halves), _rms(scaled)))
    return rows


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")


def _text(value: Number | None, plain: float) -> str:
    if value is None:
        return f"{plain:.2f}"
    if value.bound or value.error is None:
        return f"≥ {value.value:.2f}"
    return f"{value.value:.2f} ±{value.error:.2f}"
