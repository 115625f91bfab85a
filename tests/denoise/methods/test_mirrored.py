"""A camera may mirror the picture: of mirrored frames each method makes the mirrored result."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import onespp
from onespp.denoise.catalog import METHODS, build
from onespp.render.channels import REPLAY
from onespp.render.frame import Frame
from onespp.render.tracer.renderer import Renderer

HEIGHT, WIDTH = 48, 64
# What has blocks that are moved at random, or weights that were not trained to be symmetric.
UNEVEN = ("bmfr", "rae-quarter", "unet-half")


@cache
def frames() -> tuple[Frame, ...]:
    """Of a mirror that moves, a lamp and its shadows."""
    renderer = Renderer(onespp.load("hard/moving-mirror"), HEIGHT, WIDTH, direct="resampled",
                        sampler="zsobol")
    return tuple(renderer.frame(i, 0, (*renderer.channels, *REPLAY)) for i in range(4))


def mirrored(frame: Frame) -> Frame:
    """What a camera whose x points to the left would see."""
    other_side = np.array([[-1.0, 0, 0, WIDTH], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    images = {name: np.ascontiguousarray(image[:, ::-1]) for name, image in frame.images.items()}
    return Frame(frame.index, images,
                 np.diag([-1.0, 1, 1, 1]) @ frame.camera_from_world,
                 other_side @ frame.screen_from_world, frame.world_from_object)


def denoised(name: str, sequence: tuple[Frame, ...]) -> np.ndarray:
    method = build(name)
    state = method.init(HEIGHT, WIDTH)
    for frame in sequence:
        image, state = method(frame, state)
    return np.array(image)


@pytest.mark.parametrize("name", METHODS)
def test_a_mirrored_frame_is_denoised_to_the_mirrored_image(name: str):
    straight = denoised(name, frames())
    turned = denoised(name, tuple(mirrored(frame) for frame in frames()))[:, ::-1]
    off = abs(turned - straight).mean() / abs(straight - frames()[-1]["color"]).mean()
    assert off < (0.3 if name in UNEVEN else 0.01)
