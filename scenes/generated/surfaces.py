"""What things are made of."""

from __future__ import annotations

import numpy as np

from onespp.scenes.description import Color, Material
from onespp.scenes.materials import (
    checks,
    diffuse,
    glass,
    image,
    metal,
    mirror,
    mix,
    noise,
    planks,
    plaster,
    varnish,
    weave,
    wood,
)

KINDS = ("plain", "checks", "varnish", "wood", "metal", "weave", "plain", "grain", "varnish",
         "polished", "checks", "varnished wood", "plain", "mirror", "glass")
_METALS: tuple[Color, ...] = ((0.95, 0.93, 0.88), (0.95, 0.64, 0.54), (1.0, 0.78, 0.34),
                              (0.56, 0.57, 0.58))
_SIZE = 128


def kinds(random: np.random.Generator, count: int, sharp: bool) -> list[str]:
    """`count` of `KINDS`, as different as can be; sharp: with a mirror and glass among them."""
    offered = [kind for kind in KINDS if kind not in ("mirror", "glass")]
    chosen = [offered[i] for i in random.permutation(len(offered))]
    if sharp:
        chosen[:0] = ["mirror", "glass"]
    chosen = [chosen[i % len(chosen)] for i in range(count)]
    return [chosen[i] for i in random.permutation(count)]


def surface(random: np.random.Generator, kind: str, color: Color, sharp: bool) -> Material:
    """A material of a kind; sharp: whether reflections may be (see `Plan.lamps_are_found`)."""
    dark = tuple(0.35 * np.asarray(color))
    match kind:
        case "checks":
            repeat = float(random.integers(2, 7))
            return diffuse(checks(color, dark, (repeat, repeat)))
        case "varnish":
            return varnish(color, random.uniform(0.08 if sharp else 0.2, 0.4))
        case "wood":
            return diffuse(image(wood(color, dark, int(random.integers(1000)), _SIZE, 2 * _SIZE)))
        case "varnished wood":
            boards = wood(color, dark, int(random.integers(1000)), _SIZE, 2 * _SIZE)
            return varnish(image(boards), random.uniform(0.2, 0.35))
        case "weave":
            return diffuse(image(weave(color, dark, 16), (3, 3)))
        case "grain":
            grain = noise(_SIZE, _SIZE, (8, 8), int(random.integers(1000)))
            return diffuse(image(mix(dark, color, 2 * grain - 0.5), (2, 2)))
        case "metal":
            return metal(_METALS[random.integers(len(_METALS))], random.uniform(0.2, 0.45))
        case "polished":
            return metal(_METALS[random.integers(len(_METALS))], 0.08 if sharp else 0.2)
        case "mirror":
            return mirror()
        case "glass":
            return glass()
    return diffuse(color)


def ground(random: np.random.Generator, color: Color, half: float, sharp: bool) -> Material:
    """A floor of half size `half`."""
    dark, seed = tuple(0.55 * np.asarray(color)), int(random.integers(1000))
    repeat = (half / 2, half / 2)
    match random.integers(6):
        case 0:
            return diffuse(checks(color, dark, (half, half)))
        case 1:
            boards = image(planks(color, dark, seed, size=512), repeat)
            return varnish(boards, 0.15 if sharp else 0.3)
        case 2:
            return diffuse(image(planks(color, dark, seed, size=512), repeat))
        case 3:
            return diffuse(image(weave(color, dark, 16), (2 * half, 2 * half)))
        case 4:
            return varnish(color, 0.25)
    return diffuse(image(plaster(color, seed, 0.3), repeat))


def wall(random: np.random.Generator, color: Color) -> Material:
    """A wall, even or not."""
    if random.random() < 0.4:
        return diffuse(color)
    return diffuse(image(plaster(color, int(random.integers(1000)), 0.15), (2, 1)))
