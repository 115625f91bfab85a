"""Lights that speak for others: no bias, little noise, and a bounded number of strata."""

from __future__ import annotations

import drjit as dr
import numpy as np
import pytest

from onespp.render.tracer.lights import scene_lights
from onespp.render.tracer.lights.clusters import MOST_CLUSTERS, clustered
from onespp.render.tracer.lights.scene_lights import MOST_STRATA
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.description import Scene
from onespp.show.srgb import srgb_from_linear
from tests.support.statistics import assert_same_mean, blocks, mean_and_variance

from .test_candidates import BLOCK, HEIGHT, WIDTH, many

COUNT = 200


@pytest.fixture(scope="module")
def scene() -> Scene:
    return many(COUNT)


def renderer_of(scene: Scene, direct: str = "resampled") -> Renderer:
    return Renderer(scene, HEIGHT, WIDTH, direct=direct)


def test_every_light_is_in_one_cluster_and_strata_are_bounded(scene):
    lights = renderer_of(scene).lights
    assert lights is not None
    assert lights.clusters is not None
    assert MOST_CLUSTERS <= dr.width(lights.stratum) <= MOST_STRATA
    assert sum(lights.sizes) == dr.width(lights.stratum)
    count, first = lights.clusters.count.numpy(), lights.clusters.first.numpy()
    words = lights.clusters.members.numpy()
    np.testing.assert_array_equal(words[first], lights.stratum.numpy())
    emitters = words >> 8
    several = np.repeat(count > 1, count)
    whole = np.unique(emitters[several])
    assert len(whole) == several.sum()
    assert sorted({*whole, *emitters[~several]}) == list(range(COUNT))
    assert not {*whole} & {*emitters[~several]}


def test_few_lights_speak_for_themselves():
    lights = renderer_of(many(MOST_CLUSTERS)).lights
    assert lights is not None
    assert lights.clusters is None
    assert dr.width(lights.stratum) <= MOST_STRATA


def test_lights_that_differ_by_a_factor_are_one_cluster():
    rng = np.random.default_rng(1)
    kinds = np.eye(4, 30).repeat(5, 1)[:, :30] + 0.01 * rng.random((4, 30))
    rows = np.concatenate([0.5 * kinds, 3 * kinds, kinds])
    alone = np.arange(12) == 7  # of the last kind
    found = clustered(rows, alone, 5)
    assert sorted(sorted(lights) for lights, _ in found) == [
        [0, 4, 8], [1, 5, 9], [2, 6, 10], [3, 11], [7]]
    for lights, scale in found:
        np.testing.assert_allclose(scale * rows[lights[0]], rows[lights].sum(0), rtol=1e-6)


def test_lights_that_are_off_are_in_a_cluster_too():
    rows = np.zeros((6, 3))
    rows[0, 0] = rows[1, 1] = 1
    found = clustered(rows, np.zeros(6, bool), 3)
    assert sorted(e for lights, _ in found for e in lights) == list(range(6))
    assert all(np.isfinite(scale) for _, scale in found)


def test_picking_by_clusters_keeps_the_mean_of_direct_light(monkeypatch):
    """Clusters of ten lights and more, of which some are compared."""
    monkeypatch.setattr(scene_lights, "MOST_CLUSTERS", 4)
    scene, direct = many(60), {}
    for estimator, count in (("mis", 120), ("resampled", 80)):
        renderer = renderer_of(scene, estimator)
        direct[estimator] = mean_and_variance(
            [blocks(renderer.frame(0, seed, ("direct",))["direct"], BLOCK).mean(-1)
             for seed in range(count)])
    assert_same_mean(*direct["resampled"], *direct["mis"])


def test_clusters_cost_hardly_any_variance(scene, monkeypatch):
    """At most 1.3 times that of all lights, one by one, in what is seen; U is theirs to 2 %."""
    def measured() -> tuple[float, np.ndarray]:
        renderer = renderer_of(scene)
        frames = [renderer.frame(0, seed, ("direct", "unshadowed")) for seed in range(24)]
        seen = srgb_from_linear(np.stack([frame["direct"] for frame in frames]))
        return float(seen.var(0).mean()), frames[0]["unshadowed"]

    by_clusters, unshadowed = measured()
    monkeypatch.setattr(scene_lights, "MOST_CLUSTERS", COUNT)
    monkeypatch.setattr(scene_lights, "MOST_STRATA", COUNT + 64)
    one_by_one, exact = measured()
    assert by_clusters < 1.3 * one_by_one
    assert np.abs(unshadowed - exact).mean() < 0.02 * exact.mean()
