"""Resampled direct light, and samples with blue-noise error. (Bias: see test_path.py.)"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from onespp.render.channels import FRAME, SPLIT
from onespp.render.errors import InputError
from onespp.render.mitsuba.variant import mi
from onespp.render.tracer.path import LARGEST_VISIBILITY, Radiance, _with_split
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from tests.render.tracer.test_renderer import small_scene
from tests.support.metal_under_sky import LAMP, metal_under_sky
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance


@pytest.mark.parametrize("name", ["box", "room"])
def test_unshadowed_light_has_no_noise(name):
    renderer = Renderer(catalog.load(name), 12, 16, direct="resampled")
    a, b = (renderer.frame(2, seed, SPLIT)["unshadowed"] for seed in (0, 1))
    assert a.max() > 0.1
    np.testing.assert_allclose(a, b, rtol=1e-5)


@pytest.mark.parametrize("name", ["box", pytest.param("room", marks=pytest.mark.slow)])
def test_visibility_times_unshadowed_light_has_the_mean_of_direct_light(name):
    renderer = Renderer(catalog.load(name), 32, 48, direct="resampled")
    frames = [renderer.frame(2, seed, ("direct", *SPLIT)) for seed in range(50)]
    product = [blocks(f["visibility"][..., None] * f["unshadowed"], 16).mean(-1) for f in frames]
    direct = [blocks(f["direct"], 16).mean(-1) for f in frames]
    # The colour of several lights is mixed by luminance in the product: allow 3 % beside chance.
    mean, variance = mean_and_variance(product)
    other, other_variance = mean_and_variance(direct)
    assert_same_mean(mean, variance + (0.03 * other) ** 2, other, other_variance)


@pytest.mark.parametrize(("name", "gain"), [
    ("box", 3), pytest.param("room", 4, marks=pytest.mark.slow)])
def test_resampling_lowers_the_variance_of_direct_light(name, gain):
    variance = {direct: np.var([renderer.frame(2, seed, ("direct",))["direct"]
                                for seed in range(20)], axis=0).mean()
                for direct in ("mis", "resampled")
                for renderer in [Renderer(catalog.load(name), 24, 32, direct=direct)]}
    assert variance["mis"] > gain * variance["resampled"]


@pytest.mark.parametrize("sampler", ["zsobol", "bluenoise"])
def test_blue_noise_samplers_put_the_error_at_high_frequencies(sampler):
    """Over the frames of many seeds, blocks of 4x4 pixels average to less error than with PCG."""
    def error(sampler: str, size: int) -> float:
        renderer = Renderer(small_scene(), 32, 32, sampler=sampler)
        frames = [renderer.frame(0, seed, ("color",))["color"] for seed in range(48)]
        lit = small_scene().object_names.index("floor")
        floor = blocks((renderer.frame(0, 0, ("id",))["id"] == lit)[..., None] * 1.0, size) == 1
        assert floor.sum() > 5
        return np.var([blocks(f, size) for f in frames], axis=0)[floor[..., 0]].mean()

    assert error(sampler, 1) == pytest.approx(error("pcg", 1), rel=0.1)
    assert error(sampler, 4) < 0.5 * error("pcg", 4)


def test_other_frames_and_seeds_are_scrambled_anew():
    renderer = Renderer(small_scene(), 32, 32, direct="resampled", sampler="zsobol")
    images = [renderer.frame(0, seed, ("indirect",))["indirect"] for seed in (0, 1, 2)]
    first, second = images[0] - images[2], images[1] - images[2]
    # Independent images share their common subtrahend alone: a correlation of one half.
    assert np.corrcoef(first.ravel(), second.ravel())[0, 1] == pytest.approx(0.5, abs=0.15)


def test_unknown_options_are_refused():
    for option in ("direct", "sampler"):
        with pytest.raises(InputError, match=f"--{option} 'magic'"):
            Renderer(small_scene(), 4, 4, **{option: "magic"})


def test_the_plain_estimator_has_no_split():
    with pytest.raises(InputError, match="resampled"):
        Renderer(small_scene(), 4, 4).frame(0, channels=(*FRAME, *SPLIT))


def test_visibility_is_bounded_where_unshadowed_light_underflows():
    """As on rough glass seen from inside: it was 1e18, which a half is too small for."""
    nothing = mi.Color3f(0)
    tiny = mi.Color3f(mi.Float([1e-30, 0.0, 2.0]))
    split: Any = SimpleNamespace(unshadowed=tiny)
    radiance = Radiance(nothing, nothing, nothing, nothing, mi.Float(0), mi.UInt32(0),
                        mi.UInt32(0))
    found = _with_split(radiance, mi.Color3f(3.0), split)
    assert found.visibility is not None
    np.testing.assert_allclose(found.visibility.numpy(), [LARGEST_VISIBILITY, 0, 1.5], rtol=1e-6)


@pytest.mark.parametrize("lamps", [(), (LAMP,)])
def test_a_sky_is_in_no_unshadowed_light_of_narrow_lobes(lamps, monkeypatch):
    """Whose midpoints they miss; all else of a frame is to the bit as if they did not."""
    frames = [Renderer(metal_under_sky(0.08, *lamps), 24, 32, direct="resampled") for _ in range(2)]
    channels = frames[0].channels
    told = frames[0].frame(1, 0, channels)
    monkeypatch.setattr("onespp.render.tracer.renderer.NARROW", 0.0)
    whole = frames[1].frame(1, 0, channels)
    ball = told["id"] == frames[0].scene.object_names.index("ball")
    changed = {"unshadowed", "visibility", "group", "group_sample", "unshadowed0", "unshadowed1"}
    for name in channels:
        same = told[name] == whole[name]
        assert same[~ball].all(), name
        assert name in changed or same.all(), name
    assert whole["unshadowed"][ball].max() > 5 * whole["unshadowed"][ball].mean()
    if not lamps:
        assert not told["unshadowed"][ball].any()
        assert not told["visibility"][ball].any()
        return
    of_sky = {0, 1} - {int(np.argmax([told[f"unshadowed{g}"][ball].sum() for g in (0, 1)]))}
    (sky,) = of_sky
    assert not told[f"unshadowed{sky}"][ball].any()
    assert (told["group"][ball] != sky).all()
    assert (whole["group"][ball] == sky).any()


def test_wider_lobes_keep_it():
    assert Renderer(metal_under_sky(0.25), 24, 32, direct="resampled")._narrow is None
    assert Renderer(catalog.load("room"), 12, 16, direct="resampled")._narrow is None
