"""The path tracer is unbiased: against closed forms, and against Mitsuba's own `path`."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from tests.support.furnace import furnace
from tests.support.path_images import path_images
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

ALBEDO, EMISSION, DEPTH = 0.6, 0.8, 5


@pytest.mark.parametrize("max_depth", [1, 2, DEPTH])
def test_furnace_has_the_radiance_of_the_closed_form(max_depth):
    renderer = Renderer(furnace(ALBEDO, EMISSION, max_depth), 16, 16)
    frames = [renderer.frame(0, seed) for seed in range(50)]
    terms = [EMISSION * ALBEDO**k for k in range(max_depth)]
    expected = {"emission": terms[0], "direct": sum(terms[1:2]), "indirect": sum(terms[2:]),
                "color": sum(terms)}
    for channel, value in expected.items():
        mean, variance = mean_and_variance([blocks(frame[channel], 2) for frame in frames])
        assert_same_mean(mean, variance, value)


def test_roulette_leaves_frames_and_references_their_mean():
    albedo, renderer = 0.9, Renderer(furnace(0.9, EMISSION, 65), 8, 8)
    for images in ([renderer.sample_sum(0, 0, k, 64) / 64 for k in range(16)],
                   [renderer.frame(0, k, ("color",))["color"] for k in range(120)]):
        mean, variance = mean_and_variance([blocks(image, 4) for image in images])
        assert variance.min() > 1e-8  # without roulette, all paths bring the same
        assert_same_mean(mean, variance, EMISSION * (1 - albedo**65) / (1 - albedo))


def test_furnace_far_from_the_origin_looks_the_same():
    near, far = (Renderer(furnace(ALBEDO, EMISSION, DEPTH, at), 8, 8).frame(0)
                 for at in ((0, 0, 0), (2.0**20, -(2.0**20), 2.0**20)))
    for name in ("color", "depth", "normal", "id"):
        np.testing.assert_allclose(far[name], near[name], rtol=1e-4, atol=1e-5, err_msg=name)


@pytest.mark.parametrize("name", ["box", "room", "furnace"])
def test_samples_have_the_mean_of_mitsubas_path(name):
    """Box-filtered, since Mitsuba jitters its camera rays."""
    scene = furnace(ALBEDO, EMISSION, DEPTH) if name == "furnace" else catalog.load(name)
    height, width, frame, spp, replicates = 32, 48, 7, 16, 16
    renderer = Renderer(scene, height, width)
    ours = [renderer.sample_sum(frame, 0, k, spp, antialias=True) / spp
            for k in range(replicates)]
    theirs = path_images(renderer, spp, replicates)
    a, b = ([blocks(image, 8) for image in images] for images in (ours, theirs))
    assert_same_mean(*mean_and_variance(a), *mean_and_variance(b))


@pytest.mark.parametrize(("name", "direct", "sampler"), [
    ("box", "mis", "pcg"), ("box", "mis", "zsobol"), ("box", "resampled", "pcg"),
    ("furnace", "resampled", "zsobol"),
    ("box", "mis", "bluenoise"),
    *(pytest.param("room", *rest, marks=pytest.mark.slow)
      for rest in (("resampled", "zsobol"), ("mis", "pcg"), ("resampled", "bluenoise")))])
def test_frames_at_one_sample_have_the_mean_of_the_reference(name, direct, sampler):
    height, width, frame = 32, 40, 3
    scene = furnace(ALBEDO, EMISSION, DEPTH) if name == "furnace" else catalog.load(name)
    renderer = Renderer(scene, height, width, direct=direct, sampler=sampler)
    ours = [renderer.frame(frame, seed, ("color",))["color"] for seed in range(40)]
    reference = [renderer.sample_sum(frame, 9, k, 16) / 16 for k in range(16)]
    a, b = ([blocks(image, 4) for image in images] for images in (ours, reference))
    assert_same_mean(*mean_and_variance(a), *mean_and_variance(b))


def test_radiance_splits_add_up_to_the_color():
    frame = Renderer(catalog.load("box"), 24, 24).frame(2)
    total = frame["emission"] + frame["direct"] + frame["indirect"]
    np.testing.assert_allclose(frame["color"], total, rtol=1e-6)
    for channel in ("emission", "direct", "indirect"):
        assert frame[channel].max() > 0, channel
