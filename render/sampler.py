"""Random numbers for a path, decided by (seed, stream, frame, pixel, sample) and nothing else.

Any pixel of any frame can be traced alone, in any order, by any number of threads, with the same
numbers. `stream` keeps what must be independent apart: a frame and its reference never share a
sample, even at the same seed.
"""

from __future__ import annotations

import drjit as dr
import numpy as np

from .variant import mi

FRAME_STREAM, REFERENCE_STREAM = 0, 1


def keys_from_seed(seed: int, stream: int, frame: int) -> tuple[mi.UInt32, mi.UInt32]:
    """Two 32-bit keys; opaque, so that another seed or frame is no new kernel.

    Source: NumPy's `SeedSequence`, which mixes the entropy of all its words.
    """
    words = np.random.SeedSequence([seed, stream, frame]).generate_state(2)
    return dr.opaque(mi.UInt32, int(words[0])), dr.opaque(mi.UInt32, int(words[1]))


class Pcg:
    """Independent uniform numbers: a PCG32 stream for each (keys, pixel, sample).

    Source: O'Neill 2014 (PCG-XSH-RR); the stream is picked by the Tiny Encryption Algorithm
    (Zafar et al. 2010), as in Mitsuba's `independent` sampler.
    """

    DRJIT_STRUCT = {"generator": mi.PCG32}

    def __init__(self, keys: tuple[mi.UInt32, mi.UInt32] | None = None,
                 pixel: mi.UInt32 | None = None, sample: mi.UInt32 | None = None) -> None:
        if keys is None:  # Dr.Jit builds empty loop states this way
            self.generator = mi.PCG32()
            return
        a, b = mi.sample_tea_32(pixel, keys[0])
        state, sequence = mi.sample_tea_32(a ^ sample, b ^ keys[1])
        self.generator = mi.PCG32(1, mi.UInt64(state), mi.UInt64(sequence))

    def next_1d(self) -> mi.Float:
        return self.generator.next_float32()

    def next_2d(self) -> mi.Point2f:
        return mi.Point2f(self.generator.next_float32(), self.generator.next_float32())
