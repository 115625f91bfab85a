"""Visibility of groups of lights, each told of by the shadow rays that went to it."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import filtered_innovation as innovation_oracle
from tests.support.frames import make_frame, with_images
from tests.support.recordings import compiled

from .test_filtered_innovation import run, split

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def with_groups(frame, visible, seed):
    """The frame with a group of lights for each of `visible`, the share of it that arrives: each
    pixel's ray goes to one of them."""
    rng = np.random.default_rng(seed)
    shape, there = frame["id"].shape, frame["id"] >= 0
    parts = rng.dirichlet(np.full(len(visible) + 1, 3.0))[:, None, None, None]
    tint = rng.uniform(0.8, 1.2, (len(visible) + 1, 1, 1, 3))
    each = [frame["albedo"] * part * t * there[..., None] for part, t in zip(parts, tint)]
    chances = rng.dirichlet(np.full(len(visible), 2.0))
    group = np.where(there, rng.choice(len(visible), shape, p=chances), -1)
    chance = np.where(there, chances[group], 0)
    omega = np.where(there, rng.uniform(0.7, 1.2, shape), 0)
    y = omega * (rng.random(shape) < np.array(visible)[group])
    direct = each[-1] * rng.uniform(0, 2, (*shape, 1))
    arrived = direct @ LUMINANCE
    for g, unshadowed in enumerate(each[:-1]):
        part = np.where(group == g, y / np.maximum(chance, 1e-9), 0)[..., None] * unshadowed
        direct, arrived = direct + part, arrived + part @ LUMINANCE
    whole = np.sum(each, axis=0)
    possible = whole @ LUMINANCE
    images = {f"unshadowed{g}": u for g, u in enumerate(each[:-1])}
    return with_images(
        frame, **images, unshadowed=whole, direct=direct, group=group,
        group_sample=np.stack([y, omega, chance], -1),
        color=frame["emission"] + direct + frame["indirect"],
        visibility=np.where(possible > 0, arrived / np.where(possible > 0, possible, 1), 0))


def grouped(height, width, count=3, visible=(0.9, 0.3, 0.6), lobes=True, still=False):
    return [with_groups(frame, visible, 50 + i)
            for i, frame in enumerate(split(height, width, count, lobes, still=still))]


@pytest.mark.parametrize(("height", "width", "levels", "sharp_levels", "groups", "shadows",
                          "still"),
                         [(19, 26, 4, 2, 3, True, False), (19, 26, 4, 3, 4, False, False),
                          (7, 5, 4, 2, 2, True, False), (1, 9, 4, 2, 1, True, False),
                          (17, 27, 4, 2, 3, True, True)])
def test_it_is_the_formula_in_float64(height, width, levels, sharp_levels, groups, shadows, still):
    frames = grouped(height, width, 4, (0.9, 0.3, 0.6, 0.2)[:groups], still=still)
    method = FilteredInnovation(
        innovation_levels=levels, output_levels=3, sharp_innovation_levels=sharp_levels,
        sharp_output_levels=2, follow_shadows=shadows)
    image, _ = run(method, frames)
    expected = innovation_oracle.run(frames, method)
    # Which of two histories as good as each other is taken, and whether n is below 2, is decided by
    # a rounding at single pixels.
    assert np.isclose(image, expected, rtol=2e-3, atol=1e-4).mean() > 0.99
    np.testing.assert_allclose(image, expected, atol=2e-2)


def test_which_light_was_picked_is_no_noise():
    """One light shines on all of a wall and the other is hidden: the image is exact."""
    def lit(seed):
        rng = np.random.default_rng(seed)
        wall = make_frame(32, 32, wall_end=1e9)
        u = wall["albedo"] * rng.uniform(0.5, 1.5, (32, 32, 1))
        group = rng.integers(0, 2, (32, 32))
        sample = np.stack([group == 0, np.ones((32, 32)), np.full((32, 32), 0.5)], -1)
        direct = np.where((group == 0)[..., None], 2 * u, 0)
        return with_images(wall, unshadowed=2 * u, unshadowed0=u, unshadowed1=u, group=group,
                           group_sample=sample, direct=direct, indirect=0 * u, emission=0 * u,
                           visibility=1.0 * (group == 0), color=direct), u

    method = FilteredInnovation()
    (first, u), (second, other) = lit(1), lit(2)
    image, state = method(first, method.init(32, 32))
    np.testing.assert_allclose(image, u, rtol=1e-3, atol=1e-5)
    image, _ = method(second, state)
    np.testing.assert_allclose(image, other, rtol=1e-3, atol=1e-5)


def test_a_light_that_hardly_a_ray_asked_for_keeps_its_history():
    """All of a wall is in the shadow of light 1, as frame 0 tells; in frame 1 no ray goes to it."""
    def lit(group):
        wall = make_frame(24, 24, wall_end=1e9)
        u = wall["albedo"]
        sample = np.stack([group == 0, np.ones((24, 24)), np.full((24, 24), 0.5)], -1)
        direct = np.where((group == 0)[..., None], 2 * u, 0)
        return with_images(wall, unshadowed=2 * u, unshadowed0=u, unshadowed1=u, group=group,
                           group_sample=sample, direct=direct, indirect=0 * u, emission=0 * u,
                           visibility=1.0 * (group == 0), color=direct)

    picks = np.random.default_rng(3).integers(0, 2, (24, 24))
    image, _ = run(FilteredInnovation(), [lit(picks), lit(0 * picks)])
    np.testing.assert_allclose(image, lit(picks)["unshadowed0"], rtol=1e-3, atol=1e-4)


def test_a_ray_that_was_hardly_to_be_expected_says_no_more_than_others():
    """Lone rays to light 1 arrive where their stratum's midpoint gives nothing: omega is tiny."""
    def lit(seed):
        rng = np.random.default_rng(seed)
        wall = make_frame(32, 32, wall_end=1e9)
        u = wall["albedo"]
        group = 1 * (rng.random((32, 32)) < 0.01)
        omega = np.where(group == 1, 1e-3, 1.0)
        sample = np.stack([np.ones((32, 32)), omega, np.where(group == 1, 0.05, 0.95)], -1)
        direct = np.where((group == 1)[..., None], 20 * u, u / 0.95)
        return with_images(wall, unshadowed=2 * u, unshadowed0=u, unshadowed1=u, group=group,
                           group_sample=sample, direct=direct, indirect=0 * u, emission=0 * u,
                           visibility=np.ones((32, 32)), color=direct)

    frames = [lit(seed) for seed in range(8)]
    method = FilteredInnovation()
    state = method.init(32, 32)
    for frame in frames:
        image, state = method(frame, state)
        assert image.min() >= 0
        assert (image < 4.5 * frame["albedo"]).all()  # V is 2 at most, before this frame


def test_energy_is_kept():
    """The mean is that of what arrives on average, not of what was picked."""
    visible = (0.9, 0.3, 0.6)
    frames = grouped(33, 41, 6, visible, lobes=False)
    image, _ = run(FilteredInnovation(), frames)
    last = frames[-1]
    y, _, chance = np.moveaxis(last["group_sample"], -1, 0)
    expected = last["color"].astype(float)
    for g, share in enumerate(visible):
        told = np.where(last["group"] == g, y / np.maximum(chance, 1e-9), 0)
        expected += (share - told)[..., None] * last[f"unshadowed{g}"]
    assert image.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_frames_are_one_recording():
    frames = grouped(16, 20, 5)
    _, state = run(FilteredInnovation(), frames)
    passes = state.passes
    assert passes is not None
    assert passes.choice
    steps = [passes.look_around, passes.find_innovations, passes.choose, passes.merge,
             passes.pack,
             *(level.step for level in (passes.spread, *passes.choice, *passes.smoothing,
                                     *passes.output))]
    assert [step.recordings for step in steps] == [1] * len(steps)
    assert compiled(lambda: run(FilteredInnovation(light_alpha=0.1), frames)) == 0
