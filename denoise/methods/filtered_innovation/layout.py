"""Which planes the filtered innovation works on: the one place that knows.

A frame has signals of three kinds (`signals.py`), each of three planes or one. Those of groups of
lights are the last, and *sparse*: a pixel's shadow ray went to one group at most. What is smoothed
and filtered lies side by side in the planes of one buffer, in the order of leaving: diffuse light
goes through all levels, visibility and glossy light (the sharp signals) through fewer, energies
through the first ones. A level works on the planes that are left, the first so many. Each of them
goes by the rule of its own `PlaneRule`, from which kernels are built.

A record of the history holds first the visibility that shadow rays tell of, the last signal or
those of groups, so that it can be looked up alone.
"""

# pyright: standard
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

from onespp.denoise.history.shadow_motion import CHOICE_LEVELS
from onespp.denoise.inputs.signals import Signal, SignalKind
from onespp.denoise.jit.arrays import Float
from onespp.render.errors import InputError
from onespp.render.frame import Frame

T = TypeVar("T")
ENERGY_LEVELS = 2
LUMINANCE_PLACE = 1            # among the values of a record, where there is one signal


class Pair(NamedTuple):
    """Luminance of a signal in this frame alone, and in its history."""

    current: Float
    history: Float


class NoisySignal(NamedTuple):
    """A signal and the variance of its luminance's noise; of a sparse one, N, how many samples
    its history holds, or how much it counts in the last filter; in that filter, of light with
    texture, what it was made of."""

    signal: Signal
    variance: Float
    samples: Float | None = None
    parts: Pair | None = None


class History(NamedTuple):
    """What a record holds: lengths of histories in frames, see `SignalLayout.length`, and the
    signals."""

    lengths: list[Float]
    signals: list[NoisySignal]


class Smoothed(NamedTuple):
    """What is smoothed over the surface, in the order of leaving.

    Attributes:
        diffuse_spread: Q of diffuse light. diffuse: S[e] of it.
        excess: S of how much greater e^2 is in visibility's shadow history than in the other, of
            each visibility that has one and is not sparse.
        visibility_spread: Q of each visibility. sharp: S[e] of glossy light and of visibility.
        shadow_innovation: S[e] of each of those histories. weights: S[omega] of each sparse signal.
        energies: W[l(e)^2] of each signal that is not sparse.
        misses, spatial: of light with texture, W of what reprojection may miss, and of the noise
            that a frame by itself may have, see `texture.py`.
    """

    diffuse_spread: Float
    diffuse: Signal
    excess: list[Float]
    visibility_spread: list[Float]
    sharp: list[Signal]
    shadow_innovation: list[Float]
    weights: list[Float]
    energies: list[Float]
    misses: Float | None = None
    spatial: Float | None = None

    @property
    def each(self) -> list[Signal]:
        """S[e] of each signal, in their order."""
        return [self.diffuse, *self.sharp]


@dataclass(frozen=True)
class PlaneRule:
    """How a plane is smoothed: through how many levels; with the squares of the weights, as the
    variance of a mean is; no farther than shadows of a light, by its number, are soft."""

    levels: int
    squared: bool = False
    penumbra: int | None = None


@dataclass(frozen=True)
class SignalLayout:
    """Which signals there are, and how many levels each goes through.

    Attributes:
        kinds: of signals, diffuse light first and visibility last; or glossy light alone.
        groups: of lights, whose sparse signals are the last; 0: all lights are one.
        has_shadow_rays: visibility has a second history, and penumbras are known.
        innovation_levels, output_levels: of diffuse light, in the smoothing of the innovation and
            in the last filter. sharp_*: those of the other signals; the last filter of sparse ones
            has one level less (measured: no worse, and quicker).
        has_texture: the one signal is light whose texture is not known, see `texture.py`.
        has_peaks: rare bright pixels of light are kept from spreading (`filters/peaks.py`).
        has_layers: glossy light is of other layers, and filtered apart.
    """

    kinds: tuple[SignalKind, ...]
    groups: int
    has_shadow_rays: bool
    innovation_levels: int
    sharp_innovation_levels: int
    output_levels: int
    sharp_output_levels: int
    has_texture: bool = False
    has_peaks: bool = False
    has_layers: bool = False

    def check(self, frame: Frame, now: SignalLayout) -> None:
        """InputError where a frame has other signals than the one before it."""
        if self != now:
            raise InputError(f"frame {frame.index} has other channels than the frame before it: "
                             "render the sequence anew with one set of --channels")

    def without_gloss(self) -> tuple[SignalLayout, SignalLayout]:
        """Of the other signals, and of glossy light alone."""
        rest = tuple(kind for kind in self.kinds if kind is not SignalKind.GLOSSY)
        return replace(self, kinds=rest, has_layers=True), replace(
            self, kinds=(SignalKind.GLOSSY,), groups=0, has_shadow_rays=False,
            innovation_levels=self.sharp_innovation_levels, output_levels=self.sharp_output_levels)

    def each(self, light: T, visibility: T) -> list[T]:
        """A parameter of each signal."""
        return [visibility if kind is SignalKind.VISIBILITY else light for kind in self.kinds]

    @property
    def with_peaks(self) -> list[int]:
        """Signals whose rare bright pixels are kept from spreading."""
        return [s for s, kind in enumerate(self.kinds)
                if self.has_peaks and kind is not SignalKind.VISIBILITY]

    @property
    def with_peaks_of_frame(self) -> list[int]:
        """Those whose peaks are told before history: light that the surface's own lobes reflect."""
        own = self.has_peaks and SignalKind.DIFFUSE in self.kinds
        return [s for s, kind in enumerate(self.kinds) if own and kind is SignalKind.GLOSSY]

    @property
    def visibilities(self) -> list[int]:
        """Which signals are visibility."""
        return [s for s, kind in enumerate(self.kinds) if kind is SignalKind.VISIBILITY]

    @property
    def followed(self) -> int:
        """How many signals of visibility, the last so many, shadow rays tell of."""
        return (self.groups or 1) if self.has_shadow_rays else 0

    def follower(self, s: int) -> int | None:
        """Which of the visibilities that shadow rays tell of a signal is."""
        f = s - len(self.kinds) + self.followed
        return f if f >= 0 else None

    def group(self, s: int) -> int | None:
        """Which group's visibility a signal is, if it is sparse."""
        g = s - len(self.kinds) + self.groups
        return g if g >= 0 else None

    @property
    def smoothing_rules(self) -> list[PlaneRule]:
        """Of each plane of `Smoothed`, depth first."""
        rule: Any = PlaneRule  # in the place of the plane that goes by it
        diffuse, sharp = self.innovation_levels, self.sharp_innovation_levels
        light = Signal(*[rule(sharp)] * 3)
        visible = [rule(sharp, penumbra=self.follower(s)) for s in self.visibilities]
        chosen = visible if self.has_shadow_rays and not self.groups else []
        glossy = [light] * self.kinds[1:].count(SignalKind.GLOSSY)
        return _leaves(Smoothed(
            diffuse_spread=rule(diffuse, squared=True),
            diffuse=Signal(*[rule(diffuse)] * 3),
            excess=[rule(max(CHOICE_LEVELS, sharp)) for _ in chosen],
            visibility_spread=[replace(one, squared=True) for one in visible],
            sharp=[*glossy, *(Signal(None, one, None) for one in visible)],
            shadow_innovation=chosen,
            weights=visible[len(visible) - self.groups:],
            energies=[rule(ENERGY_LEVELS)] * (len(self.kinds) - self.groups),
            misses=rule(ENERGY_LEVELS) if self.has_texture else None,
            spatial=rule(ENERGY_LEVELS) if self.has_texture else None))

    def smoothing_level(self, level: int) -> list[PlaneRule]:
        """Rules of the planes that are left at a level, the first so many."""
        return [rule for rule in self.smoothing_rules if level < rule.levels]

    def output_level(self, level: int) -> list[int]:
        """The signals that are left at a level of the last filter, the first so many."""
        return [s for s in range(len(self.kinds))
                if level < self._output_levels(s) + self._noisy_levels(s)]

    @property
    def deepest_output(self) -> int:
        """How many levels the last filter has."""
        return max(self._output_levels(s) + self._noisy_levels(s) for s in range(len(self.kinds)))

    def is_last_level(self, s: int, level: int) -> bool:
        """Whether the last filter of a signal ends with a level where it is not noisy."""
        return level == self._output_levels(s) - 1

    def is_noisy_level(self, s: int, level: int) -> bool:
        """Whether a level is there for what is noisy still."""
        return level >= self._output_levels(s)

    def _noisy_levels(self, s: int) -> int:
        """How many levels more there are for what is noisy still, see `output.noise_left`: one for
        diffuse light with rare bright pixels, if the innovation is smoothed as far."""
        return int(self.kinds[s] is SignalKind.DIFFUSE and self.has_peaks
                   and self.output_levels < self.innovation_levels)

    def _output_levels(self, s: int) -> int:
        if s == 0:
            return self.output_levels
        return max(self.sharp_output_levels - (self.group(s) is not None), 1)

    def output_planes(self, signals: Sequence[int]) -> int:
        """Planes of these signals in the last filter."""
        return self._planes(signals) + 2 * self.has_texture

    def noisy_signals(self, signals: Sequence[int]) -> Callable[..., list[NoisySignal]]:
        """Function of the planes of these signals, side by side, to the signals."""
        return lambda *planes: [self._with_parts(self._noisy_signal(s, iterator), iterator)
                                for iterator in [iter(planes)] for s in signals]

    def pack(self, history: History) -> list[Any]:
        """What a record holds, in its order (a structure)."""
        rest = len(self.kinds) - self._looked_up
        return [history.signals[rest:], *history.lengths, *history.signals[:rest]]

    def unpack(self, values: Iterable[Float]) -> History:
        """The history, of the values of a record."""
        planes, rest = iter(values), len(self.kinds) - self._looked_up
        first = [self._noisy_signal(s, planes) for s in range(rest, len(self.kinds))]
        lengths = [next(planes) for _ in range(self._lengths)]
        return History(lengths, [*(self._noisy_signal(s, planes) for s in range(rest)), *first])

    @property
    def record_values(self) -> int:
        return self._lengths + self._planes(range(len(self.kinds)))

    def record_place(self, s: int) -> int:
        """Where a visibility that shadow rays tell of is among the values of a record."""
        return 3 * (self.group(s) or 0)

    def length(self, s: int) -> int:
        """Which of the lengths is that of a signal's history, if it is not sparse: diffuse light
        has its own, the sharp signals share one where records would not fit a cache line else."""
        return s if self.groups else min(s, 1)

    @property
    def _lengths(self) -> int:
        return self.length(len(self.kinds) - self.groups - 1) + 1

    @property
    def _looked_up(self) -> int:
        """How many signals are the first in a record."""
        return self.groups or 1

    def _planes(self, signals: Sequence[int]) -> int:
        """Planes of these noisy signals."""
        return sum((2 if self.kinds[s] is SignalKind.VISIBILITY else 4)
                   + (self.group(s) is not None) for s in signals)

    def _with_parts(self, noisy: NoisySignal, planes: Iterator[Float]) -> NoisySignal:
        """With the parts that follow it, of light with texture."""
        if not self.has_texture:
            return noisy
        return noisy._replace(parts=Pair(next(planes), next(planes)))

    def _noisy_signal(self, s: int, planes: Iterator[Float]) -> NoisySignal:
        if self.kinds[s] is SignalKind.VISIBILITY:
            signal = Signal(None, next(planes), None)
        else:
            signal = Signal(next(planes), next(planes), next(planes))
        return NoisySignal(signal, next(planes),
                           next(planes) if self.group(s) is not None else None)


def _leaves(structure: Any) -> list[Any]:
    """What a structure of tuples and lists holds, depth first, without what is absent."""
    if isinstance(structure, (list, tuple)):
        return [leaf for part in structure for leaf in _leaves(part)]
    return [] if structure is None else [structure]
