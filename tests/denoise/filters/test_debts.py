"""No result is negative, and none gains light by it: the formula, its sums, and every method."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.catalog import build
from onespp.denoise.filters.debts import repay
from onespp.denoise.methods import base as lanes
from onespp.denoise.oracles.filtered_innovation import repaid
from onespp.render.frame import Frame
from tests.denoise.methods.test_methods import SMALL, each_method
from tests.support.frames import make_frame, noisy, with_images


def indebted(height=19, width=23, share=0.2, seed=0):
    """(image, IDs): two objects, of which a share of the components is below 0."""
    rng = np.random.default_rng(seed)
    image = rng.gamma(1, 1, (height, width, 3)).astype(np.float32)
    image[rng.random(image.shape) < share] *= -0.5
    return image, np.tile(np.arange(width) // 9 % 2 - 1, (height, 1)).astype(np.int32)


def sums(image, id_):
    return np.array([image[id_ == i].sum(0, dtype=np.float64) for i in np.unique(id_)])


@pytest.mark.parametrize("share", [0.01, 0.2, 0.6])
@pytest.mark.parametrize(("height", "width"), [(19, 23), (1, 31), (31, 1), (2, 2), (5, 90)])
def test_it_is_the_formula_in_float64(height, width, share):
    image, id_ = indebted(height, width, share, seed=height)
    expected = repaid(image.astype(np.float64), id_)
    np.testing.assert_allclose(repay(image.copy(), id_), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3])
def test_nothing_is_below_zero_and_every_object_keeps_its_sum(share):
    image, id_ = indebted(90, 120, share)
    assert (image < 0).any()
    result = repay(image.copy(), id_)
    assert result.min() == 0
    np.testing.assert_allclose(sums(result, id_), sums(image, id_), rtol=1e-5)


def test_what_is_nowhere_negative_and_what_is_far_from_it_stays_bit_by_bit():
    image, id_ = indebted(40, 60, 0)
    np.testing.assert_array_equal(repay(image.copy(), id_), image)
    image[20, 30] = -1e-3
    changed = np.argwhere((repay(image.copy(), id_) != image).any(-1))
    assert 3 <= len(changed) <= 5
    assert (np.abs(changed - [20, 30]).sum(1) <= 1).all()


def test_an_object_pays_no_debts_of_another():
    image, id_ = indebted(30, 36, 0)
    image[id_ == 0] *= -1
    expected = np.where((id_ == 0)[..., None], 0, image)
    np.testing.assert_array_equal(repay(image.copy(), id_), expected)


def test_rounding_is_cut_off_and_nobody_asked():
    image, id_ = indebted(9, 9, 0)
    image[4, 4, 1] = -1e-8 * image[4, 4].max()
    expected = np.maximum(image, 0)
    np.testing.assert_array_equal(repay(image, id_), expected)


def test_what_is_not_finite_neither_pays_nor_spreads():
    image, id_ = indebted(20, 26, 0.3)
    bad = np.zeros(image.shape, bool)
    bad[3, 4], bad[10, 11, 1], bad[15, 20] = True, True, True
    image[3, 4], image[10, 11, 1], image[15, 20] = np.nan, np.inf, -np.inf
    result = repay(image.copy(), id_)
    assert np.isfinite(result[~bad]).all()
    assert result[~bad].min() == 0
    assert np.isnan(result[3, 4]).all()
    assert result[10, 11, 1] == np.inf
    assert (result[15, 20] == 0).all()
    only, kept = (np.where(bad, 0, x) for x in (image, result))
    np.testing.assert_allclose(sums(kept, id_), sums(only, id_), rtol=1e-5)


def dimmed(count=10):
    """A wall of one albedo under checked light that falls to three tenths, under noise."""
    wall = make_frame(48, 64, wall_end=1e9)
    y, x = np.mgrid[:48, :64] // 8
    checks = np.where(((y + x) % 2)[..., None] == 1, [0.8, 0.8, 0.8], [0.03, 0.03, 0.05])
    images = {**wall.images, "albedo": np.ones((48, 64, 3), np.float32)}
    wall = Frame(0, images, wall.camera_from_world, wall.screen_from_world, wall.world_from_object)
    truth = [with_images(wall, color=checks * (1 if i < count // 2 else 0.3)) for i in range(count)]
    return [noisy(frame, i, sigma=0.7) for i, frame in enumerate(truth)], truth[-1]["color"]


def last(frames, name="onespp", **settings):
    method = build(name, settings)
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def test_where_light_falls_on_a_texture_energy_is_kept_and_the_error_is_less(monkeypatch):
    """Against the same result with its sign, and with what is negative cut off; where history is
    not cut short, so that there are debts."""
    frames, truth = dimmed()
    kept = {"light_change": "0", "visibility_change": "0"}
    result = last(frames, **kept)
    monkeypatch.setattr(lanes, "repay", lambda image, id_: image)
    signed = last(frames, **kept)
    cut = np.maximum(signed, 0)
    assert (signed < 0).mean() > 0.1
    assert result.min() == 0
    assert result.mean() == pytest.approx(signed.mean(), rel=1e-5)
    assert cut.mean() > 1.2 * signed.mean()
    errors = [np.square(image - truth).mean() for image in (result, cut)]
    assert errors[0] < 0.8 * errors[1]


def hostile(seed):
    """Frames of bursts, black regions and textures, with their light split, with albedo, or plain.

    Nothing in them is negative.
    """
    rng = np.random.default_rng(seed)
    height, width, kind = *rng.integers(1, 40, 2), ("split", "albedo", "plain")[seed % 3]
    size = height, width
    albedo = rng.choice([0, 0.001, 0.02, 0.9, 1], (10, 10, 3)).repeat(4, 0).repeat(4, 1)
    albedo = albedo[:height, :width] * rng.choice([0, 1, 1], 3)

    def light():
        bursts = np.where(rng.random((*size, 1)) < 0.03, 10 ** rng.uniform(0, 5, (*size, 1)), 1)
        there = rng.random((*size, 1)) < rng.choice([0.1, 0.5, 1])
        return 10 ** rng.uniform(-3, 1) * rng.gamma(0.3, 3, (*size, 3)) * bursts * there

    for i in range(4):
        frame = make_frame(height, width, index=i, wall_end=(1, 1e9)[seed % 2])
        emission = np.where(rng.random((*size, 1)) < 0.05, [5.0] * 3, 0)
        unshadowed, visibility = albedo * light(), 2 * rng.random(size)
        direct = unshadowed * visibility[..., None] * rng.uniform(0, 2, (*size, 3))
        indirect = albedo * light()
        images = {"color": emission + direct + indirect}
        if kind != "plain":
            images |= {"albedo": albedo, "emission": emission}
        if kind == "split":
            images |= {"direct": direct, "indirect": indirect, "unshadowed": unshadowed,
                       "visibility": visibility, "specular": indirect * rng.random((*size, 1))}
        rest = {k: v for k, v in frame.images.items() if k != "albedo"}
        yield with_images(Frame(i, rest, frame.camera_from_world, frame.screen_from_world,
                                frame.world_from_object), **images)


@each_method
@pytest.mark.parametrize("outliers", [None, 3.0])
def test_no_method_gives_negative_radiance_whatever_light_comes(name, outliers):
    for seed in range(6):
        frames = list(hostile(seed))
        assert all((image >= 0).all() for k in ("color", "direct", "indirect")
                   for image in [frame.images.get(k, frame["color"]) for frame in frames])
        method = build(name, SMALL[name], outliers)
        state = method.init(frames[0].height, frames[0].width)
        for frame in frames:
            image, state = method(frame, state)
            assert np.isfinite(image).all()
            assert image.min() >= 0, (name, seed, frame.index)
