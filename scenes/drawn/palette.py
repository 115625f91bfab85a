"""Colours that go together: a ground, a wall, and five for things."""

from __future__ import annotations

import colorsys

import numpy as np

from onespp.scenes.description import Color
from onespp.scenes.materials import rgb

_STEPS = ((0.0, 0.04, 0.5, 0.54, 0.46), (0.0, 0.33, 0.66, 0.05, 0.38),
          (0.0, 0.08, 0.16, 0.58, 0.92), (0.0, 0.25, 0.5, 0.75, 0.04))
"""Hues about a wheel: two that face each other, three, neighbours with one against, four."""


def palette(random: np.random.Generator) -> tuple[Color, ...]:
    """Seven albedos, linear: calm ones for ground and wall, and five of the same wheel."""
    first, steps = random.random(), _STEPS[random.integers(len(_STEPS))]
    ground = _color(first + random.uniform(0.4, 0.6), random.uniform(0.03, 0.35),
                    random.uniform(0.45, 0.8))
    wall = _color(first + random.uniform(-0.1, 0.1), random.uniform(0.03, 0.22),
                  random.uniform(0.72, 0.92))
    things = [_color(first + step, random.uniform(0.35, 0.85), random.uniform(0.5, 0.95))
              for step in steps]
    pale = int(random.integers(len(things)))  # an accent among strong colours
    things[pale] = _color(first + steps[pale], random.uniform(0.04, 0.15), 0.93)
    return ground, wall, *things


def _color(hue: float, saturation: float, value: float) -> Color:
    parts = colorsys.hsv_to_rgb(hue % 1, saturation, value)
    return rgb("#" + "".join(f"{round(255 * part):02x}" for part in parts))
