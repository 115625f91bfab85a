"""Candidates of light: unbiased where lights are many or tiny, and worth what they cost.

Each z-test fails a correct renderer once in a thousand (`ERROR_RATE`, shared out over its blocks).
"""

from __future__ import annotations

from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

from onespp.render.mitsuba.variant import mi
from onespp.render.tracer import renderer as renderer_module
from onespp.render.tracer.lights.candidates import candidates_for
from onespp.render.tracer.path import trace
from onespp.render.tracer.renderer import Renderer
from onespp.render.tracer.sampler import REFERENCE_STREAM, Sobol, keys_from_seed
from onespp.scenes import catalog
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.render.tracer.test_renderer import gray
from tests.support.path_images import path_images
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

BLACK = {"type": "diffuse", "reflectance": 0.0}
HEIGHT, WIDTH, BLOCK = 12, 16, 4


def scene_of(*lights: Shape) -> Scene:
    """A floor of rough metal and a matt ball under lights; paths of up to three segments."""
    metal = {"type": "roughconductor", "material": "Al", "alpha": 0.3}
    return Scene("lights", "for tests", (
        Shape("floor", Rectangle(), metal, rotate((1, 0, 0), -90) @ scale(4)),
        Shape("ball", Sphere(), gray(0.8), translate((0, 0.6, 0)) @ scale(0.6)), *lights),
        Camera(look_at((0, 2.2, 5), (0, 0.5, 0)), 40), 1, WIDTH, HEIGHT, 3)


def many(lamps: int = 200) -> Scene:
    """Lamps, few of which bring most of the light."""
    rng = np.random.default_rng(5)
    down = rotate((1, 0, 0), 90)
    return scene_of(*(
        Shape(f"lamp{k}", Rectangle(), BLACK,
              translate((-3.5 + 0.37 * (k % 20), 2 + rng.random(), -3 + 0.65 * (k // 20))) @ down
              @ scale(0.1), tuple(2 * rng.exponential() ** 2 * rng.random(3)))
        for k in range(lamps)))


def tiny() -> Scene:
    """Four lamps of a centimetre, three of them next to a surface."""
    return scene_of(*(Shape(f"lamp{k}", Sphere(), BLACK, translate(place) @ scale(0.01),
                            (1500.0, 1200.0, 900.0))
                      for k, place in enumerate([(1, 0.1, 1), (-1, 0.1, 1.2), (0, 0.5, 0.75),
                                                 (1.5, 2, 0.5)])))


def samples(scene: Scene, candidates: int | None, monkeypatch, replicates: int, spp: int) -> list:
    """Box-filtered, in blocks, with a fixed number of candidates or the scene's own."""
    if candidates is not None:
        monkeypatch.setattr(renderer_module, "candidates_for", lambda scene: candidates)
    renderer = Renderer(scene, HEIGHT, WIDTH)
    return [blocks(renderer.sample_sum(0, 0, k, spp, antialias=True) / spp, BLOCK)
            for k in range(replicates)]


@pytest.mark.parametrize(("make", "candidates"), [
    (many, None), (tiny, 2), (tiny, 8)], ids=["200 lights", "tiny lights", "8 candidates"])
def test_candidates_have_the_mean_of_mitsubas_path(make, candidates, monkeypatch):
    scene, replicates, spp = make(), 16, 64
    ours = samples(scene, candidates, monkeypatch, replicates, spp)
    theirs = [blocks(image, BLOCK)
              for image in path_images(Renderer(scene, HEIGHT, WIDTH), spp, replicates)]
    assert_same_mean(*mean_and_variance(ours), *mean_and_variance(theirs))


def test_samples_in_one_loop_are_the_paths_of_one_sample_each():
    """Lanes that begin their next sample where a path ends count the same paths as `trace`."""
    renderer = Renderer(catalog.load("box"), HEIGHT, WIDTH)
    whole = renderer.sample_sum(4, 0, 1, 8)
    scene = renderer.stage.mi_scene
    total = np.zeros_like(whole)
    for k in range(8):
        pixel = dr.arange(mi.UInt32, HEIGHT * WIDTH)
        ray, _ = renderer.rays().at(*renderer.centres(pixel))
        sampler = Sobol(keys_from_seed(0, REFERENCE_STREAM, 4, 1), pixel, dr.opaque(mi.UInt32, k))
        pi = scene.ray_intersect_preliminary(ray, coherent=True)
        radiance = trace(scene, ray, pi, sampler, renderer.scene.max_depth, candidates=2)
        color = radiance.emission + radiance.direct + radiance.indirect
        total += np.stack([c.numpy() for c in color], -1).reshape(whole.shape)
    # Other kernels round otherwise, and a ray that grazes an edge passes it in one of them.
    assert np.isclose(whole, total, rtol=1e-3, atol=1e-3).mean() > 0.95
    parts = renderer.sample_sum(4, 0, 1, 2) + renderer.sample_sum(4, 0, 1, 6, start=2)
    np.testing.assert_allclose(whole, parts, rtol=1e-4, atol=1e-4)


def test_frames_under_many_lights_have_the_mean_of_samples():
    renderer = Renderer(many(40), HEIGHT, WIDTH, direct="resampled")
    frames = [blocks(renderer.frame(0, seed, ("color",))["color"], BLOCK) for seed in range(24)]
    reference = [blocks(renderer.sample_sum(0, 9, k, 64) / 64, BLOCK) for k in range(8)]
    assert_same_mean(*mean_and_variance(frames), *mean_and_variance(reference))


def test_eight_candidates_of_many_lights_quarter_the_variance(monkeypatch):
    variance = {m: np.var(samples(many(40), m, monkeypatch, 10, 8), axis=0).mean() for m in (1, 8)}
    assert variance[1] > 4 * variance[8]


@pytest.mark.parametrize(("lights", "candidates"), [
    (0, 2), (1, 2), (2, 2), (4, 2), (5, 4), (8, 4), (9, 8), (14, 8), (200, 8)])
def test_the_number_of_candidates_follows_the_number_of_lights(lights, candidates):
    assert candidates_for(SimpleNamespace(emitters=lambda: [None] * lights)) == candidates
