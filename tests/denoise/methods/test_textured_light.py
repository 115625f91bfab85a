"""`onespp` on frames without albedo, against float64, and what it keeps of a texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import textured_light as oracle
from tests.support.frames import make_frame, noisy, translation, turn, with_images
from tests.support.recordings import compiled

from .test_filtered_innovation import run, with_neighbour


def plain(frame, **more):
    """Colour, guides and matrices alone."""
    kept = ("color", "normal", "position", "depth", "id")
    return with_images(replace(frame, images={k: frame[k] for k in kept}), **more)


def checkered(height, width, count=4):
    """Plain frames of a moving camera, of a wall with squares of about a pixel and a half and
    little noise, and of a noisy board that moves and turns."""
    frames = []
    for i in range(count):
        frame = make_frame(height, width, index=i,
                           board=translation(0.3 * i, 0.1 * i, 0) @ turn(0.1 * i),
                           camera=translation(0.05 * i, 0, 0.1 * i) @ turn(0.01 * i))
        rng = np.random.default_rng(i)
        squares = np.floor(frame["position"] * 8).sum(-1).astype(int) % 2
        dark = np.where((frame["id"] == 0) & (squares == 0), 0.4, 1.0)[..., None]
        light = rng.gamma(2, 0.5, (height, width, 3))
        light = np.where((frame["id"] == 0)[..., None], 1 + 0.1 * light, light)
        frames.append(with_neighbour(plain(frame, color=dark * light)))
    return frames


@pytest.mark.parametrize(("height", "width", "levels"), [(19, 26, 5), (7, 5, 3), (1, 9, 4)])
def test_it_is_the_formula_in_float64(height, width, levels):
    frames = checkered(height, width)
    method = FilteredInnovation(innovation_levels=levels, output_levels=3, min_gain=0.3)
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, oracle.run(frames, method), rtol=1e-3, atol=5e-5)


def test_what_this_frame_and_its_history_have_in_common_is_kept():
    """A wall that stands still, of a texture that history's noise is as strong as."""
    wall = plain(make_frame(32, 48, wall_end=1e9))
    texture = 0.2 * np.random.default_rng(99).choice([-1.0, 1.0], (32, 48, 1))
    truth = 1 + texture * [1, 1, 1]
    frames = [noisy(with_images(wall, color=truth), seed=i, sigma=0.5) for i in range(6)]
    image, _ = run(FilteredInnovation(), frames)
    there = wall["id"] == 0
    lost = np.square(image - truth)[there].mean() / np.square(truth - 1)[there].mean()
    assert lost < 0.58  # 0.63 by the last filter alone


def test_a_texture_that_history_misses_is_taken_from_the_frame():
    """Squares of two pixels and a half that pass by half a pixel a frame, with little noise."""
    pixel = 10 / (1.2 * 48)  # of the wall, on the screen
    frames = []
    for i in range(6):
        frame = plain(make_frame(32, 48, index=i, wall_end=1e9,
                                 camera=translation(0.5 * pixel * i, 0, 0)))
        squares = np.floor(frame["position"][..., :2] / (2.5 * pixel)).sum(-1) % 2
        truth = (0.7 + 0.3 * squares)[..., None] * [1, 1, 1]
        frames.append(noisy(with_images(frame, color=truth), seed=i, sigma=0.03))
    image, _ = run(FilteredInnovation(), frames)
    there = frames[-1]["id"] == 0
    assert np.square(image - truth)[there].mean() < 0.1 * truth[there].var()  # 0.36 as noise


def spun(angle):
    """Rotation about z, radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def test_light_is_of_the_place_where_a_surface_turns_under_it():
    """A plain board spins below stripes of light that stand still."""
    frames = []
    for i in range(8):
        frame = plain(make_frame(40, 40, index=i, board=spun(0.3 * i), wall_end=1e9))
        stripes = 0.7 + 0.3 * (-1.0) ** (np.arange(40) // 3)
        truth = stripes[:, None] * np.ones((40, 40, 3))
        frames.append(noisy(with_images(frame, color=truth), seed=i, sigma=0.3))
    image, _ = run(FilteredInnovation(), frames)
    board = frames[-1]["id"] == 1
    assert np.square(image - truth)[board].mean() < 0.3 * truth[board].var()  # or 0.9


def test_it_is_one_recording_and_its_sigma_compiles_nothing():
    frames = checkered(16, 20)
    _, state = run(FilteredInnovation(), frames)
    other = FilteredInnovation(texture_sigma=2.0, min_gain=0.8)
    assert compiled(lambda: run(other, frames)) == 0
    passes = state.passes
    steps = [passes.find_innovations, passes.merge, passes.residual, passes.restore, passes.pack,
             *(level.step for level in (*passes.smoothing, *passes.output,
                                        *passes.residual_smoothing))]
    assert [step.recordings for step in steps] == [1] * len(steps)
