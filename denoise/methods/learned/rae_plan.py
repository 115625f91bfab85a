"""The layers of the recurrent autoencoder, and their order.

Symbols: w_0 to w_4 = 32, 43, 57, 76, 101 features of the encoder; d_0 to d_4 = 64, 32, 43, 57, 76
of the decoder; a narrower network has a share of each, rounded up. Every convolution is 3x3.

    down{i}          features of the level above (i = 0: the input) to w_i; then 2x2 max pooling
    block{i}.input   w_i to w_i; what it gives is put beside the block's last output
    block{i}.mix     2 w_i to w_i
    block{i}.output  w_i to w_i: the block's output, which is its memory as well
    up{i}.join       twice as large by nearest neighbours, beside the skipped features, to d_i
    up{i}.out        d_i to d_i; i = 0: to the three planes of the result, without activation

Level i + 1 has 2^-(i+1) of the image's side; up{i} gives level i. What is skipped to it is the
output of block{i-1}; to up0 the input.
"""

from __future__ import annotations

from .architecture import INPUTS, OUTPUTS, Architecture, Features, Layer, Memory, Operations, share

ENCODER, DECODER = (32, 43, 57, 76, 101), (64, 32, 43, 57, 76)
LEVELS = len(ENCODER)


def layers(width: str) -> dict[str, Layer]:
    """Of a width of `WIDTHS`."""
    w, d = share(ENCODER, width), share(DECODER, width)
    found = {}
    for i in range(LEVELS):
        found[f"down{i}"] = Layer(w[i - 1] if i else INPUTS, w[i], i)
        found[f"block{i}.input"] = Layer(w[i], w[i], i + 1)
        found[f"block{i}.mix"] = Layer(2 * w[i], w[i], i + 1)
        found[f"block{i}.output"] = Layer(w[i], w[i], i + 1)
    below = w[-1]
    for i in reversed(range(LEVELS)):
        found[f"up{i}.join"] = Layer(below + (w[i - 1] if i else INPUTS), d[i], i)
        found[f"up{i}.out"] = Layer(d[i], d[i] if i else OUTPUTS, i)
        below = d[i]
    return found


def run(on: Operations, x: Features, memory: Memory) -> tuple[Features, Memory]:
    """The result, and the output of each block."""
    skipped, outputs = [x], []
    for i in range(LEVELS):
        x = on.pooled(i, on.layer(f"down{i}", x))
        x = on.layer(f"block{i}.input", x)
        before = memory[i] if memory else on.nothing(i + 1, x)
        x = on.layer(f"block{i}.output", on.layer(f"block{i}.mix", x, before))
        outputs.append(x)
        skipped.append(x)
    for i in reversed(range(LEVELS)):
        x = on.layer(f"up{i}.join", on.upsampled(i, x), skipped[i])
        x = on.layer(f"up{i}.out", x)
    return x, outputs


RAE = Architecture("rae", "the recurrent autoencoder", LEVELS, slope=0.1, last="up0.out",
                   width="quarter", layers=layers, run=run, remembers=True)
