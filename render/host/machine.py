"""The machine that a number was measured on, in a line."""

from __future__ import annotations

import ctypes
import os
import platform
import subprocess
import sys
from contextlib import suppress
from pathlib import Path


def machine(device: str = "llvm") -> str:
    """Processor, cores that this process may use, memory, system; the GPU where that computes.

    As 'AMD EPYC 7B13, 8 cores, 31 GiB, Linux 6.1 x86_64'. What cannot be found out is left out;
    nothing in it names the machine or its user.

    Args:
        device: 'llvm' or 'cuda', what kernels run on.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    release = ".".join(platform.release().split("-")[0].split(".")[:2])
    return ", ".join(filter(None, (
        _gpu() if device == "cuda" else "", _processor(), f"{cores} core{'s' * (cores > 1)}",
        _memory(), f"{platform.system()} {release} {platform.machine()}")))


def _processor() -> str:
    """The processor's name as its maker writes it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    if sys.platform == "darwin":
        with suppress(OSError):
            return subprocess.run(["sysctl", "-n", "machdep.cpu.brand_string"], check=False,
                                  capture_output=True, text=True).stdout.strip()
    return platform.processor()


def _memory() -> str:
    with suppress(AttributeError, OSError, ValueError):  # not on Windows
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"
    return ""


def _gpu() -> str:
    """Name of the first CUDA device, asked of the driver itself."""
    with suppress(OSError):
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
        name, device = ctypes.create_string_buffer(200), ctypes.c_int()
        if (driver.cuInit(0) == 0 and driver.cuDeviceGet(ctypes.byref(device), 0) == 0
                and driver.cuDeviceGetName(name, len(name), device) == 0):
            return name.value.decode(errors="replace")
    return ""
