"""NumPy values on the device start at a cache line, wherever NumPy put them, or are copies."""

import drjit.llvm as llvm
import numpy as np
import pytest

from onespp.render.host.aligned import aligned, owned


@pytest.mark.parametrize("size", [1, 5, 16, 17, 1000])
def test_an_array_starts_at_a_cache_line_and_holds_the_values(size):
    kept = [np.empty(n, np.float32) for n in range(1, 40)]  # so that addresses differ
    for skip in range(len(kept) % 16):
        values = np.arange(skip + size, dtype=np.float32)[skip:]
        array = aligned(llvm.Float, values)
        assert array.numpy().ctypes.data % 64 == 0  # a view of its memory
        np.testing.assert_array_equal(array.numpy(), values)


@pytest.mark.parametrize("kind", [llvm.Float, llvm.UInt32])
@pytest.mark.parametrize("size", [1, 5, 16, 17, 1000])
def test_an_owned_array_holds_the_values_in_memory_of_dr_jit(kind, size, monkeypatch):
    mapped = []

    def kept(kind, values):
        mapped.append(aligned(kind, values))
        return mapped[-1]

    monkeypatch.setattr("onespp.render.host.aligned.aligned", kept)
    values = np.arange(size, dtype=np.uint32 if kind is llvm.UInt32 else np.float32)
    array = owned(kind, values)
    np.testing.assert_array_equal(array.numpy(), values)
    assert all(array.index != other.index for other in mapped)
