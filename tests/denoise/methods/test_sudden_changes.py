"""After a sudden change history is no worse than none, in small renders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from onespp.denoise.inputs.light_change import LightChange
from onespp.denoise.methods.filtered_innovation import method as innovation
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.metrics.errors import psnr
from onespp.denoise.metrics.tonemap import srgb_from_linear
from onespp.denoise.studies.hard_scenes import run, run_alone
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.animation import Animation
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.materials import diffuse, metal
from onespp.scenes.transforms import look_at, rotate, scale, translate

HEIGHT, WIDTH, EVENT, SPP = 48, 72, 4, 256
_X, _BLACK = (1, 0, 0), diffuse((0.0, 0.0, 0.0))


def _lamp(name, x, emission):
    return Shape(name, Rectangle(), _BLACK,
                 translate((x, 2.8, 0.9)) @ rotate(_X, 90) @ scale((0.35, 0.35, 1)), emission)


def _scene(*shapes):
    floor = Shape("floor", Rectangle(), diffuse((0.55, 0.5, 0.45)),
                  rotate(_X, -90) @ scale((3, 3, 1)))
    wall = Shape("wall", Rectangle(), diffuse((0.6, 0.25, 0.2)),
                 translate((0, 1.5, -1.6)) @ scale((3, 1.5, 1)))
    ball = Shape("ball", Sphere(), diffuse((0.7, 0.65, 0.3)),
                 translate((-0.9, 0.45, 0.2)) @ scale(0.45))
    return Scene("small", "", (floor, wall, ball, *shapes),
                 Camera(look_at((0.4, 1.6, 4.6), (0, 0.7, 0)), fov=38), EVENT + 1, WIDTH, HEIGHT,
                 max_depth=4)


def _switched_off():
    white = (16.0, 15.0, 13.0)
    return _scene(_lamp("one", -1.0, lambda f: white if f < EVENT else (0.0, 0.0, 0.0)),
                  _lamp("other", 1.2, (5.0, 6.0, 9.0)))


def _appears():
    return _scene(_lamp("one", 0.3, (24.0, 22.0, 20.0)), Shape(
        "new", Sphere(), diffuse((0.2, 0.5, 0.3)), Animation(
            lambda f: translate((0.5 if f >= EVENT else 50, 0.5, 0.6)) @ scale(0.5))))


@pytest.mark.parametrize("make", [_switched_off, _appears])
def test_the_frame_after_a_change_is_at_most_1_db_behind_single_frames(make):
    renderer = Renderer(make(), HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    frames = [renderer.frame(i, channels=renderer.channels) for i in range(EVENT + 1)]
    truth = srgb_from_linear(renderer.sample_sum(EVENT, 1, 0, SPP) / SPP)

    def decibels(**settings):
        method: Any = FilteredInnovation(**settings)
        images = [images[-1] for images in (
            run(method, frames, method.init(HEIGHT, WIDTH)),
            run_alone(method, frames[-1:], method.init(HEIGHT, WIDTH)))]
        return [psnr(srgb_from_linear(np.maximum(image, 0)), truth) for image in images]

    with_history, alone = decibels()
    assert with_history > alone - 1
    late, _ = decibels(light_change=0, visibility_change=0)
    assert late < alone - 2


def test_glossy_light_goes_with_lamps_that_change_colour(monkeypatch):
    white, blue = (24.0, 22.0, 20.0), (5.0, 11.0, 26.0)
    metal_floor = Shape("metal", Rectangle(), metal((0.8, 0.8, 0.8), 0.1),
                        translate((0, 0.01, 0)) @ rotate(_X, -90) @ scale((3, 3, 1)))
    renderer = Renderer(_scene(metal_floor, _lamp("one", 0.3, lambda f: blue if f == EVENT
                                                  else white)),
                        HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    frames = [renderer.frame(i, channels=renderer.channels) for i in range(EVENT + 1)]
    truth = srgb_from_linear(renderer.sample_sum(EVENT, 1, 0, SPP) / SPP)
    method: Any = FilteredInnovation()

    def decibels(images):
        return psnr(srgb_from_linear(np.maximum(images[-1], 0)), truth)

    alone = decibels(run_alone(method, frames[-1:], method.init(HEIGHT, WIDTH)))
    known = decibels(run(method, frames, method.init(HEIGHT, WIDTH)))
    monkeypatch.setattr(innovation, "change_of_lights", lambda *_: LightChange())
    unknown = decibels(run(method, frames, method.init(HEIGHT, WIDTH)))
    assert known > alone + 1
    assert known > unknown + 3


def test_under_a_lamp_that_moves_history_is_no_worse_than_none(monkeypatch):
    lamp = _lamp("one", 0.0, (28.0, 26.0, 24.0))
    still = lamp.world_from_object
    moving = Shape("one", Rectangle(), _BLACK, Animation(
        lambda f: translate((-1.4 + 0.4 * f, 0, 0)) @ still), lamp.emission)
    renderer = Renderer(_scene(moving), HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    frames = [renderer.frame(i, channels=renderer.channels) for i in range(7)]
    truths = [srgb_from_linear(renderer.sample_sum(i, 1, 0, SPP) / SPP) for i in range(1, 7)]
    method: Any = FilteredInnovation()

    def mean(images):
        return np.mean([psnr(srgb_from_linear(np.maximum(image, 0)), truth)
                        for image, truth in zip(images[1:], truths, strict=True)])

    def with_history():
        return mean(run(method, frames, method.init(HEIGHT, WIDTH)))

    known, alone = with_history(), mean(run_alone(method, frames, method.init(HEIGHT, WIDTH)))
    monkeypatch.setattr(innovation, "share_of_moving_lights", lambda previous, frame: 0.0)
    unknown = with_history()
    assert known > alone - 0.1
    assert known > unknown + 0.1
