"""FLIP, the difference a viewer sees when flipping between two images, in NumPy.

LDR-FLIP takes display values; HDR-FLIP takes radiance, and is in each pixel the greatest LDR-FLIP
over a range of exposures with the ACES tone map. Both are in [0, 1], 0 for equal images, at 67
pixels per degree (a 0.7 m wide display of 3840 pixels at 0.7 m).

Symbols: YCxCz the linearised opponent space (XYZ / white, then an affine map); CSF its contrast
sensitivity, a Gaussian a channel (the sum of two for Cz); HyAB the colour distance, |dL| plus the
Euclidean length of (da, db), of L*a*b* with Hunt's adjustment; edges and points: first and second
derivatives of a Gaussian of Y.

Every filter is separable (`banded.py`), with the border's pixels repeated outside. Powers are
exp(y log x), for which NumPy has vector instructions. What belongs to the reference alone
(`FlipReference`, half of the work) is made once for all the images it judges.

The range of exposures is that of the second paper's section 4; where a reference has none (one of a
single value, or black) it is one exposure long.

Sources: Andersson et al. 2020, "FLIP: a difference evaluator for alternating images",
doi:10.1145/3406183; Andersson et al. 2021, "Visualizing errors in rendered high dynamic range
images", doi:10.2312/egs.20211015; constants as in the authors' library (flip-evaluator 1.7), with
which maps agree to 1e-3.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from onespp.denoise.metrics.luminance import luminance
from onespp.denoise.metrics.tonemap import linear_from_srgb

from .banded import Band

PIXELS_PER_DEGREE = 67.0206

_XYZ_FROM_LINEAR = np.array([
    [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
    [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
    [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382]])
_WHITE = _XYZ_FROM_LINEAR.sum(axis=1)
_WHITENED = _XYZ_FROM_LINEAR / _WHITE[:, None]          # linear -> XYZ of white (1, 1, 1)
_OPPONENT = np.array([[0.0, 116, 0], [500, -500, 0], [0, 200, -200]])  # then Y - 16
_YCC_FROM_LINEAR = _OPPONENT @ _WHITENED
_LINEAR_FROM_YCC = np.linalg.inv(_YCC_FROM_LINEAR)
_LAB = _OPPONENT                                         # of cube roots, then L - 16
_KNEE = 6 / 29

# (a, b) of a e^(-pi^2 x^2 / b), x in degrees; a channel's may be a sum of two.
_CSF = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
_CSF_RADIUS = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi ** 2)) * PIXELS_PER_DEGREE))
_FEATURE_SIGMA = 0.5 * 0.082 * PIXELS_PER_DEGREE
_FEATURE_RADIUS = int(np.ceil(3 * _FEATURE_SIGMA))

_QC, _PC, _PT = 0.7, 0.4, 0.95

_ACES = (0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14)
_BRIGHT = 0.85     # tone-mapped value that the brightest pixel and the median are brought to
_LARGEST = 65504.0  # radiance; the square of more overflows in the tone map
_MOST_STOPS = 24.0
_AT_ONCE = 1 << 14  # pixels coloured at once: what fits into a cache


class FlipReference:
    """A reference, ready to judge many images.

    Args:
        linear: (h, w, 3) radiance. `srgb` gives the same of display values.
    """

    def __init__(self, linear: np.ndarray) -> None:
        self._linear = np.asarray(linear, np.float32)

    @classmethod
    def srgb(cls, display: np.ndarray) -> FlipReference:
        return cls(linear_from_srgb(np.asarray(display, np.float32)))

    def map(self, linear: np.ndarray) -> np.ndarray:
        """(h, w) float32 LDR-FLIP of an (h, w, 3) image of radiance, clipped to [0, 1]."""
        return _difference(_seen(np.clip(linear, 0, 1)), self._display)

    def hdr_map(self, linear: np.ndarray) -> np.ndarray | None:
        """(h, w) float32 HDR-FLIP of radiance; None where nothing exceeds a display's 1."""
        if not (self._linear > 1).any():
            return None
        a, b = (np.clip(i, 0, _LARGEST).astype(np.float32) for i in (linear, self._linear))
        greatest = np.zeros(a.shape[:2], np.float32)
        for stop in self._stops:
            images = (_seen(_tone_mapped(i, 2.0 ** stop)) for i in (a, b))
            np.maximum(greatest, _difference(*images), out=greatest)
        return greatest

    @cached_property
    def _display(self) -> _Seen:
        return _seen(np.clip(self._linear, 0, 1))

    @cached_property
    def _stops(self) -> np.ndarray:
        start, stop = exposures(np.clip(self._linear, 0, _LARGEST))
        return np.linspace(start, stop, max(2, int(np.ceil(stop - start))))


def flip_map(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(h, w) float32 LDR-FLIP of two (h, w, 3) images of display values in [0, 1]."""
    return FlipReference.srgb(reference).map(linear_from_srgb(np.asarray(image, np.float32)))


def flip(image: np.ndarray, reference: np.ndarray | FlipReference) -> float:
    """Mean LDR-FLIP of two (h, w, 3) images of display values in [0, 1]; 0 for equal images.

    A `FlipReference` takes an image of radiance instead.

    Example:
        >>> flip(np.zeros((8, 8, 3), np.float32), np.zeros((8, 8, 3), np.float32))
        0.0
    """
    if isinstance(reference, FlipReference):
        return float(reference.map(image).mean(dtype=np.float64))
    return float(flip_map(image, reference).mean(dtype=np.float64))


def hdr_flip(image: np.ndarray, reference: np.ndarray | FlipReference) -> float | None:
    """Mean HDR-FLIP of linear radiance; None where nothing is brighter than a display's 1."""
    if not isinstance(reference, FlipReference):
        reference = FlipReference(reference)
    found = reference.hdr_map(image)
    return None if found is None else float(found.mean(dtype=np.float64))


def exposures(reference: np.ndarray) -> tuple[float, float]:
    """First and last exposure of HDR-FLIP, in stops, from the reference's luminance.

    They bring its maximum and its median to 0.85. A median of 0 is replaced by that of the pixels
    that are not black; the range ends after 24 stops.
    """
    k0, k1, k2, k3, k4, k5 = _ACES
    a, b, c = (k0 - _BRIGHT * k3, k1 - _BRIGHT * k4, k2 - _BRIGHT * k5)
    bright = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    light = luminance(np.asarray(reference, np.float64))
    median = _median(light) or _median(light[light > 0])
    start, stop = np.log2(bright / light.max()), np.log2(bright / median)
    return float(start), float(np.clip(stop, start, start + _MOST_STOPS))


def _median(values: np.ndarray) -> float:
    """The upper one of two, as in the library."""
    middle = values.size // 2
    return float(np.partition(values.ravel(), middle)[middle])


def _tone_mapped(image: np.ndarray, scale: float) -> np.ndarray:
    """ACES, clipped to [0, 1], of the image at an exposure."""
    k0, k1, _, k3, k4, k5 = map(np.float32, _ACES)
    x = image * np.float32(scale)
    return np.clip(x * (k0 * x + k1) / (x * (k3 * x + k4) + k5), 0, 1)


@dataclass(frozen=True)
class _Seen:
    """What the eye makes of an image: L, a, b, each (h, w), and its edges and points."""

    lab: np.ndarray
    edges: np.ndarray
    points: np.ndarray


def _seen(linear: np.ndarray) -> _Seen:
    """Of (h, w, 3) linear values in [0, 1]."""
    h, w = linear.shape[:2]
    pixels = linear.astype(np.float32, copy=False).reshape(-1, 3)
    ycc, matrix = np.empty((3, h * w), np.float32), _YCC_FROM_LINEAR.astype(np.float32)
    for at in _parts(h * w):
        np.matmul(matrix, pixels[at].T, out=ycc[:, at])
    ycc = ycc.reshape(3, h, w)
    # The filters' weights sum to 1, so that the -16 of Y may be left out on both ways.
    filtered = np.stack([sum(_filter(plane, wide, high) for wide, high in _csf(channel, h, w))
                         for channel, plane in enumerate(ycc)])
    return _Seen(_hunt_lab(filtered), *_features(ycc[0] / np.float32(116)))


def _hunt_lab(ycc: np.ndarray) -> np.ndarray:
    """(3, h, w): L*a*b* with Hunt's adjustment of filtered YCxCz without its -16."""
    to_linear = _LINEAR_FROM_YCC.astype(np.float32)
    to_xyz, to_lab = _WHITENED.astype(np.float32), _LAB.astype(np.float32)
    flat = ycc.reshape(3, -1)
    lab = np.empty_like(flat)
    for at in _parts(flat.shape[1]):
        xyz = to_xyz @ np.clip(to_linear @ flat[:, at], 0, 1)
        light, a, b = to_lab @ np.where(
            xyz > _KNEE ** 3, _power(xyz, 1 / 3), xyz * np.float32(1 / (3 * _KNEE ** 2))
            + np.float32(4 / 29))
        light -= 16
        lab[:, at] = light, 0.01 * light * a, 0.01 * light * b
    return lab.reshape(ycc.shape)


def _parts(n: int) -> Iterator[slice]:
    return (slice(start, min(start + _AT_ONCE, n)) for start in range(0, n, _AT_ONCE))


def _features(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strength of edges and of points of (h, w) Y in [0, 1]."""
    h, w = y.shape
    level_x, edge_x, point_x = (band.along_rows(y) for band in _feature_bands(w))
    level_y, edge_y, point_y = _feature_bands(h)
    return (_length(level_y.along_columns(edge_x), edge_y.along_columns(level_x)),
            _length(level_y.along_columns(point_x), point_y.along_columns(level_x)))


def _length(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """sqrt(x^2 + y^2), in x's memory (four times as fast as hypot, and nothing overflows)."""
    x *= x
    y *= y
    x += y
    return np.sqrt(x, out=x)


def _difference(image: _Seen, reference: _Seen) -> np.ndarray:
    """(h, w) FLIP: difference of colour, raised by that of features."""
    most = _largest_distance()
    knee = np.float32(_PC * most)
    height, width = image.edges.shape
    found = np.empty(height * width, np.float32)
    lab, other = image.lab.reshape(3, -1), reference.lab.reshape(3, -1)
    features = [(np.ravel(i), np.ravel(r)) for i, r in (
        (image.edges, reference.edges), (image.points, reference.points))]
    for at in _parts(found.size):
        light, a, b = lab[:, at] - other[:, at]
        distance = _power(np.abs(light) + np.sqrt(a * a + b * b), _QC)
        colour = np.where(distance < knee, distance * np.float32(_PT / knee),
                          np.float32(_PT) + (distance - knee) * np.float32(
                              (1 - _PT) / (most - _PC * most)))
        edge, point = (np.abs(i[at] - r[at]) for i, r in features)
        feature = np.sqrt(np.maximum(edge, point) * np.float32(0.5 ** 0.5))
        found[at] = _power(colour, 1 - feature)
    return np.clip(found, 0, 1).reshape(height, width)


@lru_cache(maxsize=1)
def _largest_distance() -> float:
    """HyAB between green and blue, to the power 0.7: the largest of all."""
    primaries = np.array([[0.0, 1, 0], [0, 0, 1]]).T
    green, blue = _hunt_lab((_YCC_FROM_LINEAR @ primaries)[:, None].astype(np.float32))[:, 0].T
    light, a, b = green - blue
    return float((abs(light) + np.hypot(a, b)) ** _QC)


def _power(x: np.ndarray, y: float | np.ndarray) -> np.ndarray:
    """x^y for x >= 0, 0 for 0 (y > 0), to 1e-6 of it."""
    with np.errstate(divide="ignore"):
        return np.exp(np.log(x) * np.asarray(y, np.float32))


def _filter(plane: np.ndarray, wide: Band, high: Band) -> np.ndarray:
    return high.along_columns(wide.along_rows(plane))


@lru_cache(maxsize=32)
def _csf(channel: int, h: int, w: int) -> list[tuple[Band, Band]]:
    """(along rows, along columns) of each Gaussian of a channel's CSF; they sum to 1 together."""
    x = np.arange(-_CSF_RADIUS, _CSF_RADIUS + 1) / PIXELS_PER_DEGREE
    rows = [(a * np.sqrt(np.pi / b), np.exp(-np.pi ** 2 * x ** 2 / b)) for a, b in _CSF[channel]]
    total = sum(scale * row.sum() ** 2 for scale, row in rows)
    return [(Band(row * (scale / total), w), Band(row, h)) for scale, row in rows]


@lru_cache(maxsize=16)
def _feature_bands(n: int) -> tuple[Band, Band, Band]:
    """Gaussian, its first and second derivative; those: what is positive, and negative, sums to 1.
    """
    x = np.arange(-_FEATURE_RADIUS, _FEATURE_RADIUS + 1)
    gaussian = np.exp(-x ** 2 / (2 * _FEATURE_SIGMA ** 2))

    def balanced(row: np.ndarray) -> np.ndarray:
        return np.where(row > 0, row / row[row > 0].sum(), row / -row[row < 0].sum())

    rows = (gaussian / gaussian.sum(), balanced(-x * gaussian),
            balanced((x ** 2 / _FEATURE_SIGMA ** 2 - 1) * gaussian))
    return tuple(Band(row, n) for row in rows)  # pyright: ignore[reportReturnType]
