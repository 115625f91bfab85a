"""Squared errors without the reference's noise: products of two independent halves.

Symbols: x an image's value and t the truth's; f the curve to the display; P_0 .. P_3 the parts of a
reference, means of independent samples; A = (P_0 + P_1) / 2 and B = (P_2 + P_3) / 2 its halves;
e_A, e_B their errors. x depends on neither half, so

    E[(x - A) (x - B)] = (x - t)^2,

where the square against the mean of the halves has their variance on top. A single product may be
negative; means over pixels and frames are taken before a logarithm or a root (`estimate.py`).

The curve bends: E f(A) isn't f(t) but f(t) + f''(t) v / 2 + ... The jackknife

    f_A = 2 f(A) - (f(P_0) + f(P_1)) / 2

depends on A's samples alone, and is free of that term, for a part has twice the variance of a half.
(So is f(A) - f''(A) v_A / 2 with v_A from the two parts; but it knows nothing of the clip at 1,
where its bias is up to twice the jackknife's: docs/metrics.md compares them.)

How uncertain is a sum of products over a block of pixels, images and truth being what they are?
n_A = (f(P_0) - f(P_1)) / 2 has mean 0 and the covariance of e_A, and is independent of B; likewise
n_B. With L_1 = sum (x - f_A) n_B, L_2 = sum (x - f_B) n_A and Q = sum n_A n_B over the block,

    E[L_1^2 + L_2^2 - Q^2] = Var[sum (x - f_A) (x - f_B)]

whatever the correlation of the pixels in it; blocks are independent of each other. Two methods'
products have the covariance E[L_1 L_1' + L_2 L_2' - Q Q'].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .estimate import Estimate
from .tonemap import srgb_from_linear

_STRIP = 32  # rows
BLOCK = 8
"""Side of a block in pixels: a sampler may make neighbours depend on each other."""


@dataclass(frozen=True)
class Halves:
    """Two independent measurements of the same, without bias, and replicas of their noise.

    Attributes:
        a, b: (h, w, 3) values. noise_a, noise_b: (h, w, 3), mean 0, with the noise's covariance.
    """

    a: np.ndarray
    b: np.ndarray
    noise_a: np.ndarray
    noise_b: np.ndarray

    def apply(self, change: Callable[[np.ndarray], np.ndarray]) -> Halves:
        """A linear change of all."""
        return Halves(*(change(i) for i in (self.a, self.b, self.noise_a, self.noise_b)))

    def minus(self, other: Halves) -> Halves:
        """The difference from an independent one."""
        return Halves(self.a - other.a, self.b - other.b, self.noise_a - other.noise_a,
                      self.noise_b - other.noise_b)


def linear_halves(parts: np.ndarray) -> Halves:
    """Of (4, h, w, 3) radiance."""
    p0, p1, p2, p3 = parts
    return Halves((p0 + p1) / 2, (p2 + p3) / 2, (p0 - p1) / 2, (p2 - p3) / 2)


def display_halves(parts: np.ndarray) -> Halves:
    """Display values, without the bias of second order, of (4, h, w, 3) radiance."""
    f = srgb_from_linear(parts)
    a, b = (2 * srgb_from_linear((parts[i] + parts[i + 1]) / 2) - (f[i] + f[i + 1]) / 2
            for i in (0, 2))
    return Halves(a, b, (f[0] - f[1]) / 2, (f[2] - f[3]) / 2)


def products(image: np.ndarray, halves: Halves) -> list[np.ndarray]:
    """(x - A) (x - B), and what L_1, L_2 and Q are sums of: four (h, w, 3) images."""
    left, right = image - halves.a, image - halves.b
    return [left * right, left * halves.noise_b, right * halves.noise_a,
            halves.noise_a * halves.noise_b]


def mean_product(image: np.ndarray, halves: Halves,
                 where: np.ndarray | None = None) -> Estimate | None:
    """The mean of (x - t)^2 over pixels and colours; None over no pixels.

    Args:
        where: (h, w) mask of pixels; default all.
    """
    count = image.size if where is None else image.shape[2] * int(where.sum())
    if not count:
        return None
    def planes(rows: slice) -> list[np.ndarray]:
        found = products(image[rows], halves.apply(lambda part: part[rows]))
        return found if where is None else [plane * where[rows, :, None] for plane in found]

    return _estimate(planes, image.shape[0], count)


def _estimate(planes: Callable[[slice], Sequence[np.ndarray]], height: int,
              count: int) -> Estimate:
    """Of the value, L_1, L_2 and Q of the pixels of some rows; by strips that fit into a cache."""
    sums = [[block_sums(plane) for plane in planes(slice(top, top + _STRIP))]
            for top in range(0, height, _STRIP)]
    value, *noise = (np.concatenate(part) / count for part in zip(*sums))
    return Estimate.of_blocks(float(value.sum()), np.stack(noise))


class RelativeError:
    """relMSE by halves: the mean of (x - t)^2 / (t^2 + floor).

    With w the weight 1 / (m^2 + floor) of the mean m, w (x - A) (x - B) is biased: w is not that
    of t, and m and A rise together. The same of parts, G_ij = w_ij (x - P_i) (x - P_j) with i in 0,
    1, j in 2, 3 and w_ij of (P_i + P_j) / 2, has twice the bias to second order, so that

        2 w (x - A) (x - B) - mean of G_ij

    has none. It is a polynomial in y = x - m, whose coefficients all images have in common.

    Args:
        parts: (4, h, w, 3) radiance.
    """

    def __init__(self, parts: np.ndarray, floor: float) -> None:
        self._mean = parts.mean(axis=0)
        self._halves = linear_halves(parts)
        self._weight = whole = 1 / (self._mean ** 2 + floor)
        off = parts - self._mean
        left, right = (off[0] + off[1]) / 2, (off[2] + off[3]) / 2
        self._powers = [2 * whole * left * right, 0 * self._mean, 2 * whole]
        for i, j in ((0, 2), (0, 3), (1, 2), (1, 3)):
            weight = 1 / (((parts[i] + parts[j]) / 2) ** 2 + floor) / 4
            self._powers[0] -= weight * off[i] * off[j]
            self._powers[1] += weight * (off[i] + off[j])
            self._powers[2] -= weight

    def of(self, image: np.ndarray) -> Estimate:
        """The estimate for an image of radiance."""
        def planes(rows: slice) -> Sequence[np.ndarray]:
            x, mean, weight = image[rows], self._mean[rows], self._weight[rows]
            constant, slope, curve = (power[rows] for power in self._powers)
            h = self._halves.apply(lambda part: part[rows])
            y = x - mean
            factor = weight * (1 + mean * weight * y)  # and what the weight's own noise adds
            return ((curve * y + slope) * y + constant, (x - h.a) * h.noise_b * factor,
                    (x - h.b) * h.noise_a * factor, h.noise_a * h.noise_b * weight)

        return _estimate(planes, image.shape[0], image.size)


def mean_difference(image: np.ndarray, halves: Halves) -> Estimate | None:
    """The square of mean(x) / mean(t) - 1; None for a black reference."""
    scale = float(np.mean(halves.a, dtype=np.float64) + np.mean(halves.b, dtype=np.float64)) / 2
    if not scale > 0:
        return None
    count = scale * image.size
    left, right = (float(np.sum(image, dtype=np.float64) - np.sum(half, dtype=np.float64)) / count
                   for half in (halves.a, halves.b))
    first, second = (float(np.sum((block_sums(noise) / count) ** 2))
                     for noise in (halves.noise_b, halves.noise_a))
    ratio = 1 + (left + right) / 2  # mean(t), in the denominator, is as uncertain
    return Estimate(left * right, max(0.0, ratio**2 * (left**2 * first + right**2 * second)
                                      - first * second))


def block_sums(plane: np.ndarray) -> np.ndarray:
    """(n,) float64 sums of an (h, w, c) image over blocks of `BLOCK` x `BLOCK` pixels."""
    h, w, c = plane.shape
    if h % BLOCK == w % BLOCK == 0:  # the same, faster
        rows = plane.reshape(h // BLOCK, BLOCK, w * c).sum(axis=1)
        return rows.reshape(-1, BLOCK * c).sum(axis=1, dtype=np.float64)
    rows = np.add.reduceat(plane.reshape(h, w * c), np.arange(0, h, BLOCK), axis=0)
    return np.add.reduceat(rows, np.arange(0, w * c, BLOCK * c), axis=1, dtype=np.float64).ravel()


def block_of(h: int, w: int) -> np.ndarray:
    """(h, w) number of each pixel's block, as `block_sums` has them."""
    across = -(-w // BLOCK)
    return (np.arange(h) // BLOCK)[:, None] * across + np.arange(w) // BLOCK
