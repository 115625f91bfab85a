"""Which planes the filtered innovation works on: the one place that knows.

A frame has some of three signals (`signals.py`), each of three planes or one. What is smoothed and
filtered lies side by side in the planes of one buffer, in the order of leaving: diffuse light goes
through all levels, visibility and glossy light (the sharp signals) through fewer, energies through
the first ones. A level works on the planes that are left, the first so many. Each of them goes by
the rule of its own `PlaneRule`, from which kernels are built.

A record of the history holds the last signal first, so that visibility can be looked up alone.
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


class NoisySignal(NamedTuple):
    """A signal and the variance of its luminance's noise."""

    signal: Signal
    variance: Float


class History(NamedTuple):
    """What a record holds: history length, frames, and the signals."""

    length: Float
    signals: list[NoisySignal]


class Smoothed(NamedTuple):
    """What is smoothed over the surface, in the order of leaving.

    Attributes:
        diffuse_spread: Q of diffuse light. diffuse: S[e] of it.
        excess: S of how much greater e^2 is in visibility's shadow history than in the other.
        visibility_spread: Q of visibility. sharp: S[e] of glossy light and of visibility.
        shadow_innovation: S[e] of visibility's shadow history. energies: W[l(e)^2] of each signal.
    """

    diffuse_spread: Float
    diffuse: Signal
    excess: Float | None
    visibility_spread: Float | None
    sharp: list[Signal]
    shadow_innovation: Float | None
    energies: list[Float]


@dataclass(frozen=True)
class PlaneRule:
    """How a plane is smoothed: through how many levels; with the squares of the weights, as the
    variance of a mean is; no farther than shadows are soft."""

    levels: int
    squared: bool = False
    within_penumbra: bool = False


@dataclass(frozen=True)
class SignalLayout:
    """Which signals there are, and how many levels each goes through.

    Attributes:
        kinds: of signals, diffuse light first and visibility last.
        has_shadow_rays: visibility has a second history, and penumbras are known.
        innovation_levels, output_levels: of diffuse light, in the smoothing of the innovation and
            in the last filter. sharp_*: those of the other signals.
    """

    kinds: tuple[SignalKind, ...]
    has_shadow_rays: bool
    innovation_levels: int
    sharp_innovation_levels: int
    output_levels: int
    sharp_output_levels: int

    def check(self, frame: Frame, now: SignalLayout) -> None:
        """InputError where a frame has other signals than the one before it."""
        if self != now:
            raise InputError(f"frame {frame.index} has other channels than the frame before it: "
                             "render the sequence anew with one set of --channels")

    def each(self, light: T, visibility: T) -> list[T]:
        """A parameter of each signal."""
        return [visibility if kind is SignalKind.VISIBILITY else light for kind in self.kinds]

    @property
    def smoothing_rules(self) -> list[PlaneRule]:
        """Of each plane of `Smoothed`, depth first."""
        rule: Any = PlaneRule  # in the place of the plane that goes by it
        diffuse, sharp = self.innovation_levels, self.sharp_innovation_levels
        visible, shadowed = SignalKind.VISIBILITY in self.kinds, self.has_shadow_rays
        glossy = Signal(*[rule(sharp)] * 3)
        visibility = rule(sharp, within_penumbra=shadowed)
        return _leaves(Smoothed(
            diffuse_spread=rule(diffuse, squared=True),
            diffuse=Signal(*[rule(diffuse)] * 3),
            excess=rule(max(CHOICE_LEVELS, sharp)) if shadowed else None,
            visibility_spread=replace(visibility, squared=True) if visible else None,
            sharp=[Signal(None, visibility, None) if kind is SignalKind.VISIBILITY else glossy
                   for kind in self.kinds[1:]],
            shadow_innovation=visibility if shadowed else None,
            energies=[rule(ENERGY_LEVELS) for _ in self.kinds]))

    def smoothing_level(self, level: int) -> list[PlaneRule]:
        """Rules of the planes that are left at a level, the first so many."""
        return [rule for rule in self.smoothing_rules if level < rule.levels]

    def output_level(self, level: int) -> list[SignalKind]:
        """The signals that are left at a level of the last filter, the first so many."""
        return list(self.kinds if level < self.sharp_output_levels else self.kinds[:1])

    def is_last_level(self, kind: SignalKind, level: int) -> bool:
        """Whether the last filter of a signal ends with a level."""
        levels = (self.output_levels if kind is SignalKind.DIFFUSE else self.sharp_output_levels)
        return level == levels - 1

    def output_planes(self, kinds: Sequence[SignalKind]) -> int:
        """Planes of noisy signals of these kinds."""
        return sum(2 if kind is SignalKind.VISIBILITY else 4 for kind in kinds)

    def noisy_signals(self, kinds: Sequence[SignalKind]) -> Callable[..., list[NoisySignal]]:
        """Function of the planes of signals of these kinds, side by side, to the signals."""
        return lambda *planes: _noisy_signals(iter(planes), kinds)

    def pack(self, history: History) -> list[Any]:
        """What a record holds, in its order (a structure)."""
        return [history.signals[-1], history.length, *history.signals[:-1]]

    def unpack(self, values: Iterable[Float]) -> History:
        """The history, of the values of a record."""
        planes = iter(values)
        (last,) = _noisy_signals(planes, self.kinds[-1:])
        length = next(planes)
        return History(length, [*_noisy_signals(planes, self.kinds[:-1]), last])

    @property
    def record_values(self) -> int:
        return 1 + self.output_planes(self.kinds)


def _leaves(structure: Any) -> list[Any]:
    """What a structure of tuples and lists holds, depth first, without what is absent."""
    if isinstance(structure, (list, tuple)):
        return [leaf for part in structure for leaf in _leaves(part)]
    return [] if structure is None else [structure]


def _noisy_signals(planes: Iterator[Float], kinds: Sequence[SignalKind]) -> list[NoisySignal]:
    signals = []
    for kind in kinds:
        if kind is SignalKind.VISIBILITY:
            signal = Signal(None, next(planes), None)
        else:
            signal = Signal(next(planes), next(planes), next(planes))
        signals.append(NoisySignal(signal, next(planes)))
    return signals
