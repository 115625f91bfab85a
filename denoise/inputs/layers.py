"""The surface that glossy light comes from, where that is another layer's.

Where glass or a mask shows two layers, the pixel's surface is that of the stronger, and the light
of the other counts as glossy (`render/tracer/replacement.py`). It is the light of a surface as any
other, but of another one: its history is where that surface was, its texture is that one's albedo,
and its neighbours are those that lie on it. So where the pixel's own surface has no glossy lobe,
the guides of glossy light are those of the layer, and it is divided by

    a = max(layer_albedo / layer_share, LEAST_ALBEDO),

which leaves how much the glass reflects in it: that is smooth, and small. (Divided by all of
`layer_albedo`, what comes from still other layers would count many times; -1.1 dB.) The last filter
compares it as narrowly as what mirrors show: of lamps in weaker layers lone pixels are bright.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from onespp.render.channels import LAYER
from onespp.render.frame import Frame

LEAST_ALBEDO = 0.25  # light of other layers is in it, which this makes at most so much brighter


def surface_of_gloss(frame: Frame) -> Frame | None:
    """The frame with the guides of what its glossy light comes from, as diffuse as layers are.

    Its albedo is a where that is a layer, which is where roughness was 0 and is 1. None where the
    frame lacks the channels.
    """
    if any(name not in frame for name in ("specular", "roughness", "albedo", *LAYER)):
        return None
    share, roughness = frame["layer_share"], frame["roughness"]
    is_layer = (share > 0) & (roughness == 0)
    guides = {name: np.where(is_layer[..., None] if frame[name].ndim == 3 else is_layer,
                             frame[f"layer_{name}"], frame[name])
              for name in ("normal", "depth", "id")}
    albedo = frame["layer_albedo"] / np.maximum(share, 1e-6)[..., None]
    is_known = np.isfinite(albedo) & (frame["layer_id"][..., None] >= 0)
    albedo = np.where(is_known, np.clip(albedo, LEAST_ALBEDO, 1), 1)
    return replace(frame, images={
        **frame.images, **guides, "roughness": np.where(is_layer, 1, roughness).astype(np.float32),
        "albedo": np.where(is_layer[..., None], albedo, frame["albedo"]).astype(np.float32)})
