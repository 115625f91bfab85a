"""Whether there is a CUDA device, asked of the driver alone."""

from __future__ import annotations

import ctypes
import ctypes.util
import sys


def has_cuda() -> bool:
    """Whether there is a CUDA driver with a device.

    Asks the driver itself: Dr.Jit would load LLVM first, and complain about a wrong one.
    """
    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    count = ctypes.c_int()
    return (driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0
            and count.value > 0)
