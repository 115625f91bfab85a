"""Random numbers for paths, decided by (seed, stream, frame, pixel, sample) and nothing else.

Any pixel of any frame can be traced alone, in any order, by any number of threads, with the same
numbers. `stream` keeps what must be independent apart: a frame and its reference never share a
sample, even at the same seed.

A sampler hands out dimensions in order with `next_1d` and `next_2d`. It is a Dr.Jit structure, so
that it can live in a loop.
"""

from __future__ import annotations

from typing import ClassVar, Protocol

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.variant import mi

from . import bluenoise

FRAME_STREAM, REFERENCE_STREAM, GRADIENT_STREAM = 0, 1, 2

Keys = tuple[mi.UInt32, mi.UInt32]


def keys_from_seed(*words: int) -> Keys:
    """Two 32-bit keys; opaque, so that another seed or frame is no new kernel.

    Source: NumPy's `SeedSequence`, which mixes the entropy of all its words.
    """
    a, b = np.random.SeedSequence(words).generate_state(2)
    return dr.opaque(mi.UInt32, int(a)), dr.opaque(mi.UInt32, int(b))


class Sampler(Protocol):
    """The next numbers in [0, 1) of each lane."""

    def next_1d(self) -> mi.Float: ...

    def next_2d(self) -> mi.Point2f: ...


class Pcg:
    """Independent uniform numbers: a PCG32 stream for each (keys, pixel).

    Source: O'Neill 2014 (PCG-XSH-RR); the stream is picked by the Tiny Encryption Algorithm
    (Zafar et al. 2010), as in Mitsuba's `independent` sampler.
    """

    DRJIT_STRUCT: ClassVar[dict] = {"generator": mi.PCG32}

    def __init__(self, keys: Keys | None = None, pixel: mi.UInt32 | None = None) -> None:
        if keys is None:  # Dr.Jit builds empty loop states this way
            self.generator = mi.PCG32()
            return
        a, b = mi.sample_tea_32(pixel, keys[0])
        state, sequence = mi.sample_tea_32(a, b ^ keys[1])
        self.generator = mi.PCG32(1, mi.UInt64(state), mi.UInt64(sequence))

    def next_1d(self) -> mi.Float:
        return self.generator.next_float32()

    def next_2d(self) -> mi.Point2f:
        return mi.Point2f(self.generator.next_float32(), self.generator.next_float32())


class _Fixed:
    """What of a `Sobol` is the same all along a path. No Dr.Jit structure, so that it is no state
    of loops: what does not change there has the loop recorded a second time."""

    def __init__(self, index: mi.UInt32, seed: mi.UInt32) -> None:
        self.index, self.seed = index, seed


class Sobol:
    """Numbers that stratify the samples of one pixel: padded 2D Sobol points, Owen-scrambled.

    Each pair of dimensions is the (0, 2)-sequence in an order and a scrambling of its own.

    Source: Burley 2020, "Practical Hash-based Owen Scrambling"; the hash is Vegdahl's improvement
    of Laine and Karras; the second Sobol dimension by Ahmed 2024's bit-parallel product.
    """

    DRJIT_STRUCT: ClassVar[dict] = {"fixed": object, "dimension": mi.UInt32}

    def __init__(self, keys: Keys | None = None, pixel: mi.UInt32 | None = None,
                 index: mi.UInt32 | None = None) -> None:
        """`index` is the sample's number, from 0; `keys` and `pixel` pick the scrambling."""
        self.fixed, self.dimension = _Fixed(mi.UInt32(0), mi.UInt32(0)), mi.UInt32(0)
        if keys is not None:
            a, b = mi.sample_tea_32(pixel, keys[0])
            self.fixed = _Fixed(mi.UInt32(index), a ^ b ^ keys[1])

    def at(self, index: mi.UInt32, dimension: mi.UInt32) -> Sobol:
        """The same scrambling, at a dimension of sample `index`."""
        other = Sobol()
        other.fixed = _Fixed(mi.UInt32(index), self.fixed.seed)
        other.dimension = mi.UInt32(dimension)
        return other

    def next_1d(self) -> mi.Float:
        order, scramble, _ = self._next_seeds()
        return _unit(_owen(dr.brev(_shuffle(self.fixed.index, order)), scramble))

    def next_2d(self) -> mi.Point2f:
        order, scramble_x, scramble_y = self._next_seeds()
        x = dr.brev(_shuffle(self.fixed.index, order))
        y = mi.UInt32(x)
        y ^= y << 16
        y ^= (y & 0x00FF00FF) << 8
        y ^= (y & 0x0F0F0F0F) << 4
        y ^= (y & 0x33333333) << 2
        y ^= (y & 0x55555555) << 1
        return mi.Point2f(_unit(_owen(x, scramble_x)), _unit(_owen(y, scramble_y)))

    def _next_seeds(self) -> tuple[mi.UInt32, mi.UInt32, mi.UInt32]:
        a, b = mi.sample_tea_32(self.fixed.seed, self.dimension)
        self.dimension += 1
        return a, b, a ^ dr.brev(b)


class BlueNoise:
    """Numbers that differ most between neighbouring pixels: a shifted mask, a dimension each.

    A dimension reads the mask from an offset of its own and adds, modulo 1, a number of its own,
    both new in every frame; so each number alone is uniform, and a frame's error is blue noise.

    Source: Georgiev and Fajardo 2016, "Blue-noise dithered sampling". Differs: the offsets are
    new in each frame instead of the same numbers moving on by R2 steps.
    """

    DRJIT_STRUCT: ClassVar[dict] = {"mask": mi.UInt32, "x": mi.UInt32, "y": mi.UInt32,
                                    "key": mi.UInt32, "fine": mi.UInt32, "dimension": mi.UInt32}

    def __init__(self, keys: Keys | None = None, x: mi.UInt32 | None = None,
                 y: mi.UInt32 | None = None, mask: mi.UInt32 | None = None) -> None:
        """mask: `mask_table`."""
        self.mask, self.x, self.y = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
        self.key, self.fine, self.dimension = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
        if keys is not None:
            self.mask = mi.UInt32(mask)
            self.x, self.y = mi.UInt32(x), mi.UInt32(y)
            a, b = mi.sample_tea_32(keys[0], keys[1])
            self.key = mi.UInt32(a ^ b)
            self.fine, _ = mi.sample_tea_32(self.x | (self.y << 16), self.key)

    def next_1d(self) -> mi.Float:
        side = bluenoise.SIDE
        place, offset = mi.sample_tea_32(self.key, self.dimension)
        jitter, _ = mi.sample_tea_32(self.fine, self.dimension)
        at = ((self.y + (place >> 16)) % side) * side + (self.x + place) % side
        rank = dr.gather(mi.UInt32, self.mask, at)
        self.dimension += 1
        # 32-bit fractions: they wrap around by themselves.
        cell = (1 << 32) // (side * side)
        return _unit(rank * cell + jitter // (side * side) + offset)

    def next_2d(self) -> mi.Point2f:
        x = self.next_1d()
        return mi.Point2f(x, self.next_1d())


def mask_table() -> mi.UInt32:
    """The mask of `bluenoise.py`, row by row."""
    return owned(mi.UInt32, bluenoise.mask().astype(np.uint32))


def z_order(x: mi.UInt32, y: mi.UInt32) -> mi.UInt32:
    """Position of a pixel on the Z-order curve (Morton code): the bits of x and y interleaved.

    With this as its index and one seed for all pixels, `Sobol` gives the pixels of every aligned
    power-of-two block of the curve one well-stratified set, so that the error of an image moves
    to high frequencies, which filters remove.

    Source: Ahmed and Wonka 2020, "Screen-space blue-noise diffusion of Monte Carlo sampling error
    via hierarchical ordering of pixels". Differs: the order inside a block is scrambled bit by bit
    (Owen's in base 2) instead of by permutations of quadrants.
    """
    return _spread(x) | (_spread(y) << 1)


def _spread(bits: mi.UInt32) -> mi.UInt32:
    """The lower 16 bits, a zero before each."""
    bits = bits & 0xFFFF
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


def _owen(bits: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """Owen scrambling of a fraction: each bit is flipped by a hash of those above it."""
    return dr.brev(_hash_upward(dr.brev(bits), seed))


def _shuffle(index: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """A permutation that keeps every aligned power-of-two block of indices together."""
    return _owen(index, seed)


def _hash_upward(x: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """A permutation in which a bit is changed by lower bits only."""
    x ^= x * 0x3D20ADEA
    x += seed
    x *= (seed >> 16) | 1
    x ^= x * 0x05526C56
    x ^= x * 0x53A22864
    return x


def _unit(bits: mi.UInt32) -> mi.Float:
    """[0, 1) from the highest 24 bits."""
    return mi.Float(bits >> 8) * 2.0**-24
