"""A method's squared error split into bias and variance, by renders of the same frames with other
seeds.

Symbols: a_k the method's result on render k of K, b the reference, both on the display (clipped
sRGB); A the mean of the a_k; v the reference's own noise there (`metrics.reference_floor`); means
over pixels, colours and frames.

    variance = mean(sum_k (a_k - A)^2 / (K - 1))        what another seed would change
    bias^2   = mean((A - b)^2) - variance / K - v       what none would: blur, lag, colour shift
    MSE      = mean over k of mean((a_k - b)^2) = bias^2 + variance + v

With halves of the reference (`metrics/halves.py`) squares of differences from b are products of
differences from the two, in which v isn't: it is 0, and bias^2 has a standard error by the noise of
the reference (what other seeds would change is not in it).

Both are unbiased estimates, so a bias^2 near 0 may come out below it. What the display clips is
biased: the noisy input has a bias too, though its radiance has none.
"""

from __future__ import annotations

import numpy as np

from onespp.denoise.metrics.estimate import Estimate
from onespp.denoise.metrics.halves import mean_product
from onespp.denoise.metrics.image import Pair, Target, pair
from onespp.denoise.metrics.noise_floor import reference_floor
from onespp.render.errors import InputError
from onespp.render.files.manifest import first_difference
from onespp.render.files.sequence import FrameSequence

from .method_score import INPUT, ErrorSplit


def split_errors(sequences: list[FrameSequence], methods: list[str]) -> dict[str, ErrorSplit]:
    """The split for each method that all sequences have results of.

    Args:
        sequences: two or more of the same scene, frames and size with different seeds; references
            are those of the first.

    Raises:
        InputError: the sequences differ in more than the seed, or do not differ in it.
    """
    check_seeds(sequences)
    sums = {name: np.zeros(4) for name in methods}
    counts, whole = dict.fromkeys(methods, 0), True
    for i in sequences[0].frames:
        if not sequences[0].has_reference(i):
            continue
        reference = sequences[0].read_reference(i)
        target, noise = Target(reference.color, reference.parts), 0.0
        whole = whole and reference.parts is not None
        if reference.parts is None and np.isfinite(reference.variance).any():
            noise = 10 ** (-reference_floor(reference.color, reference.variance) / 10)
        for name in methods:
            images = [_read(s, name, i) for s in sequences if _has(s, name, i)]
            if len(images) == len(sequences):
                sums[name] += _split([pair(image, target) for image in images], noise)
                counts[name] += 1
    return {name: ErrorSplit(renders=len(sequences), frames=counts[name], mse=float(mse),
                             bias_squared=float(bias), variance=float(variance),
                             bias_error=float(error / counts[name]) ** 0.5 if whole else None)
            for name in methods if counts[name]
            for mse, bias, variance, error in [sums[name] / counts[name]]}


def _split(images: list[Pair], noise: float) -> np.ndarray:
    """MSE, bias^2, variance and the variance of bias^2 of one frame."""
    a = np.stack([image.srgb[0] for image in images]).astype(np.float64)
    variance, halves = a.var(axis=0, ddof=1).mean(), images[0].target.srgb_halves
    if halves is None:
        b = images[0].srgb[1].astype(np.float64)
        square = Estimate(float(np.mean((a.mean(axis=0) - b) ** 2)), 0.0)
    elif (square := mean_product(a.mean(axis=0), halves)) is None:
        raise AssertionError("an image has pixels")
    # mean over k of (a_k - b)^2, which is (A - b)^2 and the spread of the a_k around A.
    mse = square.mean + variance * (len(a) - 1) / len(a)
    return np.array([mse, square.mean - variance / len(a) - noise, variance, square.variance])


def check_seeds(sequences: list[FrameSequence]) -> None:
    """InputError as of `split_errors`: of what can be told before anything is read or scored."""
    first = sequences[0].manifest
    for other in sequences[1:]:
        changed = other.manifest.model_copy(update={"seed": first.seed})
        if key := first_difference(first, changed):
            raise InputError(f"{other.folder} has another {key} than {sequences[0].folder}: "
                             "--seeds takes renders that differ in the seed alone")
    seeds = [s.manifest.seed for s in sequences]
    if None in seeds or len(set(seeds)) < len(seeds):
        raise InputError(f"the seeds are {', '.join(map(str, seeds))}: --seeds takes renders of "
                         "different seeds (`onespp render --seed`)")


def _has(sequence: FrameSequence, method: str, i: int) -> bool:
    return sequence.has_frame(i) if method == INPUT else sequence.has_result(method, i)


def _read(sequence: FrameSequence, method: str, i: int) -> np.ndarray:
    if method == INPUT:
        return sequence.read_frame(i, ("color",))["color"]
    return sequence.read_result(method, i)
