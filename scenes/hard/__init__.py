"""Small scenes that each isolate one thing that denoisers and renderers get wrong.

All are 96x64 and ten frames long; where something happens at once, it happens at frame `EVENT`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from onespp.scenes.description import Scene

from .camera import backwards, cut, grazing
from .extent import far, huge, sky, tiny
from .light import (
    color,
    colored_sky,
    emitters,
    fireflies,
    glossy_color,
    moving_light,
    one_of_two,
    switched_off,
    switched_on,
)
from .motion import appears, behind, enters, leaves, mirrored, shrinks, uncovers, vanishes
from .parts import EVENT
from .reflection import glossy_floor, mirror, moving_mirror
from .see_through import foliage, glass_ball, thin_glass, window
from .surface import dark, textured, thin


@dataclass(frozen=True)
class Hard:
    """A hard scene.

    Attributes:
        make: the scene. event: the frame at which everything changes at once, None: none does.
        diffuse: whether all of it is diffuse and no light is too small to be found: a method
            that loses or makes energy there has no excuse.
    """

    make: Callable[[], Scene]
    event: int | None = None
    diffuse: bool = True


HARD: Mapping[str, Hard] = MappingProxyType({
    "cut": Hard(cut, EVENT),
    "switched-on": Hard(switched_on, EVENT),
    "switched-off": Hard(switched_off, EVENT),
    "color": Hard(color, EVENT),
    "glossy-color": Hard(glossy_color, EVENT, diffuse=False),
    "one-of-two": Hard(one_of_two, EVENT, diffuse=False),
    "colored-sky": Hard(colored_sky, diffuse=False),
    "moving-light": Hard(moving_light),
    "emitters": Hard(emitters),
    "fireflies": Hard(fireflies, diffuse=False),
    "mirror": Hard(mirror, diffuse=False),
    "moving-mirror": Hard(moving_mirror, diffuse=False),
    "glossy-floor": Hard(glossy_floor, diffuse=False),
    "glass-ball": Hard(glass_ball, diffuse=False),
    "window": Hard(window, diffuse=False),
    "thin-glass": Hard(thin_glass, diffuse=False),
    "foliage": Hard(foliage, diffuse=False),
    "backwards": Hard(backwards),
    "grazing": Hard(grazing),
    "uncovers": Hard(uncovers),
    "enters": Hard(enters),
    "leaves": Hard(leaves),
    "appears": Hard(appears, EVENT),
    "vanishes": Hard(vanishes, EVENT),
    "shrinks": Hard(shrinks),
    "mirrored": Hard(mirrored, EVENT),
    "behind": Hard(behind),
    "thin": Hard(thin),
    "textured": Hard(textured),
    "dark": Hard(dark),
    "sky": Hard(sky),
    "far": Hard(far),
    "tiny": Hard(tiny),
    "huge": Hard(huge),
})
