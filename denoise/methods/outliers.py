"""Outlier removal before the filter: a stage that any method can follow.

Symbols: C a signal without texture, one channel; mu, sigma its mean and standard deviation over the
pixels around that lie on the same surface (same object, near the tangent plane), itself left out;
k = outlier_width.

    C <- clamp(C, mu - k sigma, mu + k sigma)

The signals are direct and indirect light (specular light apart), where the frame has them, else its
colour without emission; visibility loses the share that direct light loses. A rare bright pixel
("firefly") is energy that belongs to its neighbours as well, so what is cut off darkens the image:
`Cleaned.energy_kept` says by how much.

Source: GAMES202 (Yan 2021), lecture 13, outlier removal: a window of 7x7 or 5x5, mu -+ k sigma.

Departures: the pixel itself does not count towards mu and sigma (in a 5x5 window it could never be
farther than 4.8 sigma from a mean that includes it), nor do other surfaces; with fewer than
`FEWEST` neighbours the pixel is left as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Generic, NamedTuple, Protocol, TypeVar

import drjit as dr
import numpy as np

from onespp.denoise.inputs.demodulation import Texture, read_texture
from onespp.denoise.inputs.repair import repair
from onespp.denoise.inputs.surface import GUIDES, TangentPlane, check_size, read_surface
from onespp.denoise.jit.arrays import Color, Float
from onespp.denoise.jit.grid import Planes, Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import evaluate
from onespp.denoise.jit.taps import Offset, Taps, window
from onespp.denoise.metrics.luminance import luminance
from onespp.render.frame import Frame
from onespp.render.host.turns import turn

from .parameters import check_positive, check_whole

FEWEST = 4
_PARTS = ("direct", "indirect", "specular")


class SurfaceTap(NamedTuple):
    """What tells whether a pixel lies on the same surface: object ID and 1/z."""

    id: Float
    inverse_depth: Float


@dataclass(frozen=True)
class RemoveOutliers:
    """Outlier removal: the stage before a method.

    Attributes:
        outlier_width: k, half width of the clamp [standard deviations, above 0].
        outlier_radius: half width of the square window [pixels, 1 to 8].
        outlier_plane: largest distance of a neighbour from the tangent plane
            [share of depth, above 0].

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> stage = RemoveOutliers(outlier_width=2.0)
        >>> cleaned, state = stage(frame, stage.init(12, 16))
        >>> bool(cleaned["color"].max() <= frame["color"].max())
        True
    """

    outlier_width: float = 3.0
    outlier_radius: int = 2
    outlier_plane: float = 0.02

    def __post_init__(self) -> None:
        check_positive(self, "outlier_width", "outlier_plane")
        check_whole(self, "outlier_radius", 8)

    def init(self, height: int, width: int) -> OutlierState:
        """State before the first frame; InputError for an empty image."""
        stencil = Stencil(height, width, self.outlier_radius)
        signal, guides = stencil.planes([0.0] * 3), stencil.planes([-2.0, 0.0])
        offsets = window(self.outlier_radius)
        return OutlierState(stencil, signal, guides, signal.taps(offsets).named(Color),
                            guides.taps(offsets).named(SurfaceTap),
                            Step(lambda *a: clamp(offsets, *a)))

    def __call__(self, frame: Frame, state: OutlierState) -> tuple[Frame, OutlierState]:
        """The frame with its colour (and parts) cleaned, and the state for the next one.

        Raises:
            InputError: a channel is missing, or the size is not the state's.
        """
        stencil = state.stencil
        check_size(frame, stencil)
        surface = read_surface(frame, stencil)
        scale = dr.select(surface.is_valid, dr.abs(surface.plane_distance)
                          * stencil.opaque(1 / self.outlier_plane), 1)
        id_ = stencil.Float(surface.id)
        plane = TangentPlane(surface.inverse_depth, *surface.slope, scale)
        evaluate(id_, plane)
        state.guides.store(SurfaceTap(id_, plane.inverse_depth))
        width = stencil.opaque(self.outlier_width)
        before = repair(np.asarray(frame["color"], np.float32), frame["id"])
        images, color = {}, before
        for name, given, texture in _lights(frame, before, stencil):
            light = texture.demodulate(Color(*stencil.load(given)))
            evaluate(light)
            state.signal.store(light)
            light = state.clamp(state.signal_taps, state.guide_taps, light, id_, plane, width)
            images[name] = stencil.image(texture.modulate(light))
            color = color + (images[name] - given)
        if "specular" in images:
            images["indirect"] = images["indirect"] + images["specular"]
        images["color"] = np.maximum(color, np.minimum(before, 0))  # a sum of rounded differences
        if "direct" in images and "visibility" in frame:  # what is cut off was never let through
            given, kept = (luminance(repair(np.asarray(image, np.float32), frame["id"]))
                           for image in (frame["direct"], images["direct"]))
            share = np.divide(kept, given, out=np.ones_like(given), where=given > 0)
            images["visibility"] = frame["visibility"] * share
        after = replace(state, before=state.before + float(before.mean(dtype=np.float64)),
                        after=state.after + float(color.mean(dtype=np.float64)))
        return replace(frame, images={**frame.images, **images}), after


@dataclass(frozen=True)
class OutlierState:
    """Planes of a signal and of the guides (ID, 1/z); mean radiance seen and let through."""

    stencil: Stencil
    signal: Planes
    guides: Planes
    signal_taps: Taps[Color]
    guide_taps: Taps[SurfaceTap]
    clamp: Step[..., Color]
    before: float = 0.0
    after: float = 0.0


def _lights(frame: Frame, color: np.ndarray,
            stencil: Stencil) -> Iterator[tuple[str, np.ndarray, Texture]]:
    """(channel, its image, its texture); `indirect` without what is specular."""
    texture = read_texture(frame, stencil, True)
    if not all(name in frame for name in _PARTS[:2]):
        yield "color", color, texture
        return
    plain = Texture(texture.albedo)
    parts = {name: repair(np.asarray(frame[name], np.float32), frame["id"])
             for name in _PARTS if name in frame}
    yield "direct", parts["direct"], plain
    if "specular" in parts:
        yield "specular", parts["specular"], Texture()
        parts["indirect"] = parts["indirect"] - parts["specular"]
    yield "indirect", parts["indirect"], plain


def clamp(offsets: list[Offset], signal: Taps[Color], guides: Taps[SurfaceTap], center: Color,
          id_: Float, plane: TangentPlane, width: Float) -> Color:
    """Each channel within mu -+ k sigma of the window's pixels on the same surface.

    Args:
        center, id_, plane: of the pixel itself. width: k.
    """
    float_t = type(plane.inverse_depth)
    count, sums, squares = float_t(0), [float_t(0)] * 3, [float_t(0)] * 3
    for i, (dy, dx) in enumerate(offsets):
        tap = guides.at(i)
        expected = dr.fma(plane.dx, float(dx), dr.fma(plane.dy, float(dy), plane.inverse_depth))
        alike = (tap.id == id_) & (dr.abs(tap.inverse_depth - expected) * plane.scale < 1)
        count += dr.select(alike, float_t(1), 0)
        for c, value in enumerate(signal.at(i)):
            value = dr.select(alike, value, 0)
            sums[c] = sums[c] + value
            squares[c] = dr.fma(value, value, squares[c])
        signal.next()
    result = []
    for value, total, square in zip(center, sums, squares, strict=True):
        mean = total / count
        variance = dr.fma(-mean, mean, square / count)
        reach = width * dr.sqrt(dr.select(variance > 0, variance, 0))
        low, high = mean - reach, mean + reach
        clamped = dr.select(value < low, low, dr.select(value > high, high, value))
        result.append(dr.select(count >= FEWEST, clamped, value))
    return Color(*result)


S = TypeVar("S")


class _Method(Protocol[S]):
    """What `methods.Method` says, with its state's type."""

    @property
    def needs(self) -> tuple[str, ...]: ...

    def init(self, height: int, width: int) -> S: ...

    def __call__(self, frame: Frame, state: S) -> tuple[np.ndarray, S]: ...


@dataclass(frozen=True)
class WithoutOutliers(Generic[S]):
    """A method that gets frames whose outliers were removed.

    Attributes:
        method: any method.
        outliers: the stage before it, a `RemoveOutliers`.
    """

    method: _Method[S]
    outliers: RemoveOutliers = field(default_factory=RemoveOutliers)

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(("color", *GUIDES, *self.method.needs)))

    @property
    def uses(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*_PARTS, *getattr(self.method, "uses", ()))))

    def init(self, height: int, width: int) -> Cleaned[S]:
        return Cleaned(self.outliers.init(height, width), self.method.init(height, width))

    @turn()
    def __call__(self, frame: Frame, state: Cleaned[S] | None) -> tuple[np.ndarray, Cleaned[S]]:
        state = state or self.init(frame.height, frame.width)
        frame, outliers = self.outliers(frame, state.outliers)
        image, inner = self.method(frame, state.inner)
        return image, Cleaned(outliers, inner)


@dataclass(frozen=True)
class Cleaned(Generic[S]):
    """State of the stage and of the method after it."""

    outliers: OutlierState
    inner: S

    @property
    def energy_kept(self) -> float:
        """Mean radiance after the stage over that before, of all frames so far."""
        return self.outliers.after / self.outliers.before if self.outliers.before else 1.0


def energy_kept(state: object) -> float | None:
    """`Cleaned.energy_kept`; None for a method without the stage."""
    return state.energy_kept if isinstance(state, Cleaned) else None
