"""The layers of a U-Net of Open Image Denoise's layout, and their order.

Symbols: e = 32 features of the encoder, at every level; d = 64 of the decoder's coarse half; a
narrower network has a share of each. Every convolution is 3x3.

    enc0, enc1        the input to e, e to e; then 2x2 max pooling
    enc2, enc3, enc4  e to e, each at half the side of the one before; then 2x2 max pooling
    enc5a, enc5b      e to e, at a sixteenth of the image's side
    dec4a, dec4b      twice as large by nearest neighbours, beside the pooled features of that size,
                      to d; d to d
    dec3a, dec3b      the same
    dec2a, dec2b      the same, to d; d to e
    dec1a, dec1b      the same, beside the input, to e; e to e
    dec0              e to the three planes of the result, without activation

Source: Open Image Denoise, `training/model.py` of its repository (class `UNet`) for the layers and
their order; its version 2 has the numbers of features above as `small`, and they are the shapes of
the weights in its library for the quality `fast`.
"""

from __future__ import annotations

from .architecture import INPUTS, OUTPUTS, Architecture, Features, Layer, Memory, Operations, share

FEATURES = (32, 64)
LEVELS = 4


def layers(width: str) -> dict[str, Layer]:
    """Of a width of `WIDTHS`."""
    e, d = share(FEATURES, width)
    return {
        "enc0": Layer(INPUTS, e, 0), "enc1": Layer(e, e, 0),
        "enc2": Layer(e, e, 1), "enc3": Layer(e, e, 2), "enc4": Layer(e, e, 3),
        "enc5a": Layer(e, e, 4), "enc5b": Layer(e, e, 4),
        "dec4a": Layer(e + e, d, 3), "dec4b": Layer(d, d, 3),
        "dec3a": Layer(d + e, d, 2), "dec3b": Layer(d, d, 2),
        "dec2a": Layer(d + e, d, 1), "dec2b": Layer(d, e, 1),
        "dec1a": Layer(e + INPUTS, e, 0), "dec1b": Layer(e, e, 0), "dec0": Layer(e, OUTPUTS, 0)}


def run(on: Operations, x: Features, memory: Memory) -> tuple[Features, Memory]:
    """The result; nothing is remembered."""
    skipped = [x]
    x = on.layer("enc0", x)
    for i in range(LEVELS):
        x = on.pooled(i, on.layer(f"enc{i + 1}", x))
        skipped.append(x)
    x = on.layer("enc5b", on.layer("enc5a", x))
    for i in reversed(range(LEVELS)):
        x = on.layer(f"dec{i + 1}a", on.upsampled(i, x), skipped[i])
        x = on.layer(f"dec{i + 1}b", x)
    return on.layer("dec0", x), memory


UNET = Architecture("unet", "a U-Net of Open Image Denoise's fast layout", LEVELS, slope=0.0,
                    last="dec0", width="half", layers=layers, run=run, remembers=False)
