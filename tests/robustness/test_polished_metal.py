"""Polished metal under a sky is as bright as it is, whatever a sky's strata say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import onespp
from tests.support.metal_under_sky import metal_under_sky


def test_a_filtered_ball_is_as_bright_as_it_is(tmp_path: Path):
    """A mean of visibility times the light that strata tell made it a seventh too bright."""
    scene = metal_under_sky(0.08)
    sequence = onespp.render(scene, frames=4, size=(48, 64), reference_spp=256,
                             out=tmp_path / "metal")
    onespp.denoise(sequence, "onespp")
    ball = sequence.read_frame(0)["id"] == scene.object_names.index("ball")
    found, truth = (np.mean([image[ball].mean() for image in images]) for images in (
        [sequence.read_result("onespp", i) for i in range(4)],
        [sequence.read_reference(i).color for i in range(4)]))
    assert abs(found / truth - 1) < 0.03
