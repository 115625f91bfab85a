"""A U-Net of Open Image Denoise's fast layout, trained here: the control of what is learned.

It sees a frame alone, by sixteen convolutions over five levels, and remembers nothing. Beside
`rae-quarter`, which has as many weights and was trained by the same steps on the same clips, it
tells what the architecture is worth; beside `oidn-fast`, which has the same layout with twice the
features, what Intel's training is. Its layers are in `unet_plan.py`, its input and what becomes of
its result in `method.py`.

Sources: Ronneberger, Fischer and Brox 2015, "U-Net: Convolutional Networks for Biomedical Image
Segmentation", doi:10.1007/978-3-319-24574-4_28; the layers of Open Image Denoise (see
`unet_plan.py`). Code and weights are ours: half of its features, trained by `onespp train unet`.

Departures:
- The input is that of `rae-quarter`: light over albedo, compressed by g, two components of the
  normal, depth and roughness. Open Image Denoise has colour, compressed by another curve, albedo
  and the normal.
- Steps, loss and rate are those of `rae-quarter`, with a temporal term and frame weights.
- The result is held by the pixels around.
"""

from __future__ import annotations

from dataclasses import dataclass

from .method import Learned


@dataclass(frozen=True)
class Unet(Learned):
    """unet-half (ours): a U-Net of the layout of Open Image Denoise's fast quality with half of its
    features, trained on what `rae-quarter` was trained on: a control, frame by frame.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Unet()
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    kind = "unet"
