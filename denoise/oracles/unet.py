"""The U-Net in float64 NumPy, line by line. See denoise/methods/learned/unet_plan.py."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from .learned import beside, convolved, pooled


def unet(weights: Mapping[str, np.ndarray], inputs: Iterable[np.ndarray]) -> list[np.ndarray]:
    """(h, w, 3) compressed light of each frame, of planes (h, w, 7); sides are multiples of 16."""
    def layer(name: str, x: np.ndarray) -> np.ndarray:
        return np.maximum(convolved(weights, name, x), 0)

    def frame(planes: np.ndarray) -> np.ndarray:
        pool1 = pooled(layer("enc1", layer("enc0", planes)))
        pool2 = pooled(layer("enc2", pool1))
        pool3 = pooled(layer("enc3", pool2))
        x = layer("enc5b", layer("enc5a", pooled(layer("enc4", pool3))))
        x = layer("dec4b", layer("dec4a", beside(x, pool3)))
        x = layer("dec3b", layer("dec3a", beside(x, pool2)))
        x = layer("dec2b", layer("dec2a", beside(x, pool1)))
        x = layer("dec1b", layer("dec1a", beside(x, planes)))
        return convolved(weights, "dec0", x)

    return [frame(planes) for planes in inputs]
