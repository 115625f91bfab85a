"""The light of a block as the nearest sum of feature buffers, and its value in pixels.

Symbols: n normal, X position along the world's axes, relative to the camera, L light; for a block,
middle m and extent e of X (greatest less least), and middle of n, over the pixels that are fitted;
t = (X - m) / max(e, r), r a thousandth of the largest component of X: a wall along an axis has an
extent of rounding errors, which are no feature.

    features of a pixel   f = (n - middle,  t,  4 t^2 - 1/2)      nine, none larger than 1
    fit                   L ~ a + b f,  b least squares with sigma^2 (b . b) a pixel added

By normal equations of what is left after the means, F = mean(f f^T) - mean(f) mean(f)^T:

    (F + sigma^2 1) b = mean(f L) - mean(f) mean(L),    a = mean(L) - b mean(f)

and an L D L^T factorization, unrolled, a lane a block. That is safe in float32: every feature is
within -1 to 1 and taken from the block's middle before it is squared, so that F is right to 1e-7,
of which sigma^2 is 300 times as much. No entry of D is below sigma^2.

The constant is not a feature with a weight: a block of one light keeps it exactly. Light is summed
from the block's least on, and the fit is held between its least and greatest.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import drjit as dr

from onespp.denoise.jit.arrays import Bool, Color, Float, Vector3
from onespp.denoise.jit.masked import tabulate
from onespp.denoise.jit.structure import arrays_of

from .blocks import Blocks, Shift

FEATURES = 9
_FAR = 1e30                # extremes of no pixels
_LEAST_EXTENT = 1e-3       # r, of the largest component
_RECORD, _USED = 16, 10    # words of a pixel's record, and how many it holds
_FIT, _FIT_USED = 48, 45   # the same of a block's
_PAIRS = [(i, j) for i in range(FEATURES) for j in range(i + 1)]


class Sample(NamedTuple):
    """What is fitted: n, X and L of a pixel."""

    normal: Vector3
    position: Vector3
    light: Color


class _Frame(NamedTuple):
    """What a block's features are measured from: middle of n, m, 1 / max(e, r); least and greatest
    L."""

    normal: list[Float]
    middle: list[Float]
    scale: list[Float]
    least: list[Float]
    greatest: list[Float]


class _Fit(NamedTuple):
    """Of a block: its frame; a less the least light; b of each component of the light."""

    frame: _Frame
    intercept: list[Float]
    slopes: list[list[Float]]


def fitted_light(blocks: Blocks, shift: Shift, sample: Sample, is_fitted: Bool,
                 sigma2: Float) -> Color:
    """The fit of each pixel's block, at that pixel; without meaning where nothing is fitted.

    Args:
        is_fitted: mask of the pixels that have features. sigma2: sigma^2, above 0.
    """
    fit = _fit(blocks, shift, sample, is_fitted, sigma2)
    stencil = blocks.stencil
    words = stencil.unpack(fit, blocks.of_pixels(shift), _FIT, _FIT_USED)
    frame = _frame(words)
    features = _features(sample, frame)
    result = []
    for c in range(3):
        value = words[15 + c]
        for i, f in enumerate(features):
            value = dr.fma(words[18 + FEATURES * c + i], f, value)
        value += frame.least[c]
        result.append(dr.minimum(dr.maximum(value, frame.least[c]), frame.greatest[c]))
    return Color(*result)


def _fit(blocks: Blocks, shift: Shift, sample: Sample, is_fitted: Bool, sigma2: Float) -> Float:
    """Records of `_Fit`, one a block. Evaluates."""
    stencil = blocks.stencil
    words = [dr.select(is_fitted, stencil.Float(1), 0), *arrays_of(sample)]
    records = tabulate(stencil, words)
    extremes = blocks.reduce(records, _RECORD, _USED, shift, [_FAR] * 9 + [-_FAR] * 9,
                             _widened, _joined)
    frame = _frame_of(extremes)
    of_rows = blocks.of_rows()
    rows = _frame([dr.gather(stencil.Float, x, of_rows) for x in arrays_of(frame)])

    def visit(sums: list[Float], words: list[Float]) -> list[Float]:
        weight, pixel = words[0], _sample(words)
        features = _features(pixel, rows)
        light = [c - least for c, least in zip(pixel.light, rows.least)]
        terms = [stencil.Float(1), *features, *light, *(features[i] * features[j]
                                                        for i, j in _PAIRS),
                 *(f * c for c in light for f in features)]
        return [s + dr.select(weight > 0, t, 0) for s, t in zip(sums, terms)]

    count = 1 + FEATURES + 3 + len(_PAIRS) + 3 * FEATURES
    sums = blocks.reduce(records, _RECORD, _USED, shift, [0.0] * count, visit,
                         lambda a, b: [x + y for x, y in zip(a, b)])
    return tabulate(stencil, arrays_of(_solved(frame, sums, sigma2)), blocks.count)


def _sample(words: Sequence[Float]) -> Sample:
    """Of a pixel's record."""
    return Sample(Vector3(*words[1:4]), Vector3(*words[4:7]), Color(*words[7:10]))


def _widened(extremes: list[Float], words: list[Float]) -> list[Float]:
    """Extremes with those of another pixel, if it is fitted."""
    weight, values = words[0], words[1:]
    return [*(dr.select(weight > 0, dr.minimum(e, v), e) for e, v in zip(extremes[:9], values)),
            *(dr.select(weight > 0, dr.maximum(e, v), e) for e, v in zip(extremes[9:], values))]


def _joined(a: list[Float], b: list[Float]) -> list[Float]:
    return [*map(dr.minimum, a[:9], b[:9]), *map(dr.maximum, a[9:], b[9:])]


def _frame_of(extremes: list[Float]) -> _Frame:
    """Of the extremes of n, X and L. All zeros where no pixel is fitted, but for the light."""
    least, greatest = extremes[:9], extremes[9:]
    middle = [0.5 * (a + b) for a, b in zip(least, greatest)]
    near, far = least[3:6], greatest[3:6]
    largest = reduce(dr.maximum, map(dr.abs, [*near, *far]))
    extent = [dr.maximum(b - a, _LEAST_EXTENT * largest) for a, b in zip(near, far)]
    scale = [dr.select(e > 0, 1 / dr.select(e > 0, e, 1), 0) for e in extent]
    return _Frame(middle[:3], middle[3:6], scale, least[6:], greatest[6:])


def _frame(words: Sequence[Float]) -> _Frame:
    """The arrays of a `_Frame`, depth first, as one."""
    return _Frame(*[list(words[i:i + 3]) for i in range(0, 15, 3)])


def _features(sample: Sample, frame: _Frame) -> list[Float]:
    normal = [n - m for n, m in zip(sample.normal, frame.normal)]
    t = [(x - m) * e for x, m, e in zip(sample.position, frame.middle, frame.scale)]
    return [*normal, *t, *(dr.fma(4 * x, x, -0.5) for x in t)]


def _solved(frame: _Frame, sums: list[Float], sigma2: Float) -> _Fit:
    """Of the sums of a block: number of pixels, f, L, pairs of f, f L by component of L."""
    share = 1 / dr.maximum(sums[0], 1)
    means = [s * share for s in sums[1:]]
    f, means = means[:FEATURES], means[FEATURES:]
    light, means = means[:3], means[3:]
    matrix = {(i, j): dr.fma(-f[i], f[j], m) + (sigma2 if i == j else 0)
              for (i, j), m in zip(_PAIRS, means)}
    means = means[len(_PAIRS):]
    sides = [[dr.fma(-x, light[c], m) for x, m in zip(f, means[FEATURES * c:FEATURES * (c + 1)])]
             for c in range(3)]
    slopes = _solve(matrix, sides, sigma2)
    intercept = []
    for c in range(3):
        a = light[c]
        for b, x in zip(slopes[c], f):
            a = dr.fma(-b, x, a)
        intercept.append(a)
    return _Fit(frame, intercept, slopes)


def _solve(matrix: dict[tuple[int, int], Float], sides: list[list[Float]],
           least_pivot: Float) -> list[list[Float]]:
    """x of matrix x = side, for each side.

    Args:
        matrix: the lower half of a symmetric one; its eigenvalues are `least_pivot` at least.
    """
    size = len(sides[0])
    low: dict[tuple[int, int], Float] = {}   # L, below its diagonal of ones
    scaled: dict[tuple[int, int], Float] = {}  # L D
    inverse: list[Float] = []                # D^-1
    for i in range(size):
        pivot = matrix[i, i]
        for j in range(i):
            value = matrix[i, j]
            for k in range(j):
                value = dr.fma(-scaled[i, k], low[j, k], value)
            scaled[i, j], low[i, j] = value, value * inverse[j]
            pivot = dr.fma(-value, low[i, j], pivot)
        inverse.append(1 / dr.maximum(pivot, least_pivot))
    solutions = []
    for side in sides:
        x = list(side)
        for i in range(size):
            for j in range(i):
                x[i] = dr.fma(-low[i, j], x[j], x[i])
        x = [v * d for v, d in zip(x, inverse)]
        for i in reversed(range(size)):
            for j in range(i + 1, size):
                x[i] = dr.fma(-low[j, i], x[j], x[i])
        solutions.append(x)
    return solutions
