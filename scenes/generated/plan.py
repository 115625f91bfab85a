"""What kind of scene a number stands for, and the random numbers that it is drawn with.

Kinds are dealt out, not drawn: of each twelve numbers four are indoors, four in the open and four
in between; each of these four has another kind of light and another camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from onespp.scenes.description import Color
from onespp.scenes.materials import rgb

KEPT_FROM = 12
SEED = 1559
PLACES = ("indoors", "open ground", "half open")
CAMERAS = ("still", "orbit", "dolly", "handheld")
LIGHTS = {
    "indoors": ("panels", "unequal", "close", "changing"),
    "open ground": ("sun", "overcast", "night", "changing"),
    "half open": ("sun", "unequal", "close", "changing"),
}
# Ground, wall, and five for things.
_PALETTES = tuple(tuple(rgb(f"#{code}") for code in row.split()) for row in (
    "b9a88f d9cdb8 c8553d 2f5d8a e9c46a 3f7d78 efe6d4",
    "8d99a6 c9d3da e07a5f 3d405b 81b29a f2cc8f f4f1de",
    "a98467 dde5b6 6a994e bc4749 f2e8cf 386641 a7c957",
    "9a8c98 e0d3d8 22577a 38a3a5 f4a261 c1666b f2e9e4",
    "a3a59e cfd8d7 d62828 f77f00 fcbf49 2f4a6d eae2b7",
    "857e7b d7ccc8 6d597a b56576 e56b6f eaac8b 4f8a8b",
))


@dataclass(frozen=True)
class Plan:
    """place, light, camera: of `PLACES`, `LIGHTS` and `CAMERAS`; ground, wall, colors: albedos.

    key: what random numbers are drawn by, default the seed of these scenes and the number.
    frames: within which lights are switched.
    """

    number: int
    place: str
    light: str
    camera: str
    ground: Color
    wall: Color
    colors: tuple[Color, ...]
    key: tuple[int, ...] = ()
    frames: int = 20

    def random(self, what: str) -> np.random.Generator:
        """Random numbers for one part of the scene: a change of one part leaves the others."""
        return np.random.default_rng((*(self.key or (SEED, self.number)), *what.encode()))

    @property
    def lamps_are_found(self) -> bool:
        """Whether a mirror or glass finds the lights often enough for a reference to settle."""
        return self.light in ("panels", "overcast")


def plan(number: int) -> Plan:
    """The kinds of scene `number`."""
    twelve, place_in_twelve = divmod(number, KEPT_FROM)
    k, which = divmod(place_in_twelve, len(PLACES))
    place = PLACES[which]
    deal = np.random.default_rng((SEED, twelve, which))
    light = LIGHTS[place][deal.permutation(4)[k]]
    camera = CAMERAS[deal.permutation(4)[k]]
    ground, wall, *colors = _PALETTES[np.random.default_rng((SEED, twelve)).permutation(
        2 * len(_PALETTES))[place_in_twelve] % len(_PALETTES)]
    return Plan(number, place, light, camera, ground, wall, tuple(colors))
