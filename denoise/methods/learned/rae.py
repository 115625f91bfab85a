"""The recurrent autoencoder (RAE): a network that was trained to denoise, and remembers.

Light without texture goes through five levels, each half as large, and back; on each of them a
block of three convolutions gets what it gave for the frame before. No motion is known to it: what
moves it has to find again. Its layers and their widths are in `rae_plan.py`, its input and what
becomes of its result in `method.py`.

Source: Chaitanya et al. 2017, "Interactive Reconstruction of Monte Carlo Image Sequences using a
Recurrent Denoising Autoencoder", doi:10.1145/3072959.3073601. The weights are ours: a network with
a quarter of the published features, trained by `onespp train rae` on two cores, for less than an
hour. What it scores says nothing about the paper's.

Departures:
- Light is compressed by g (`method.py`), in the input, the result and the loss. The paper has a
  loss on L^0.2, whose slope at 0 has no bound.
- Depth is a share of itself and the frame's mean; the result is held by the pixels around.
- The input is at the pixels' centres, one sample with light sampling by resampling, and so less
  noisy than the paper's.
- A block stands after the pooling of its level, and what is skipped is its output; the finest level
  has none, and the input is skipped to it. The paper's figures say as much, not its text.
"""

from __future__ import annotations

from dataclasses import dataclass

from .method import Learned


@dataclass(frozen=True)
class Rae(Learned):
    """rae-quarter (ours): a recurrent autoencoder of a quarter of the published width, at the
    beginning of its training: blotches, fringes and guessed shadows instead of noise.

    Example, with `frame` a `Frame` of 12x16 pixels:
        >>> method = Rae()
        >>> image, state = method(frame, method.init(12, 16))
        >>> image.shape, image.dtype
        ((12, 16, 3), dtype('float32'))
    """

    kind = "rae"
