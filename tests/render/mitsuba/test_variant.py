"""A Mitsuba variant that the program, or a scene's function, sets after ours."""

from __future__ import annotations

from dataclasses import replace

import pytest

from onespp.render.channels import REPLAY
from onespp.render.errors import InputError
from onespp.render.mitsuba.scene import MitsubaScene
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.catalog import load


@pytest.fixture
def our_variant():
    """Put back whatever a test sets."""
    ours = mi.variant()
    yield
    mi.set_variant(ours)


def test_another_variant_is_refused_before_anything_is_loaded(our_variant):
    mi.set_variant("scalar_rgb")
    with pytest.raises(InputError, match=r"is scalar_rgb: leave out mitsuba\.set_variant"):
        MitsubaScene(load("box"))


def test_and_before_a_frame_is_made(our_variant):
    renderer = Renderer(load("box"), 4, 4)
    channels = (*renderer.channels, *REPLAY)
    mi.set_variant("scalar_rgb")
    with pytest.raises(InputError, match="variant is scalar_rgb"):
        renderer.frame(1, 0, channels)


def test_so_it_is_where_a_light_sets_it(our_variant):
    def lamp(frame):
        if frame == 1:
            mi.set_variant("scalar_rgb")
        return (1.0, 1.0, 1.0)

    box = load("box")
    shapes = tuple(replace(s, emission=lamp) if s.emission is not None else s for s in box.shapes)
    scene = MitsubaScene(replace(box, shapes=shapes))
    with pytest.raises(InputError, match="variant is scalar_rgb"):
        scene.set_frame(1)
