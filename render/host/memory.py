"""How much memory there is, and whether an image fits, before the system kills the process for it.

Measured on the CPU (`box` and `room`, 64 to 1536 pixels a side): a render takes some 160 MiB and
470 to 600 bytes a pixel; denoising and scoring less. The check uses the low end, so that it only
refuses what is hopeless.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from onespp.render.errors import InputError

BASE_BYTES = 160 << 20
BYTES_PER_PIXEL = 470

_CONTAINER = ("memory.max", "memory/memory.limit_in_bytes")  # cgroups, version 2 and 1


def require_memory(height: int, width: int) -> None:
    """InputError where an image of this size cannot fit into the memory that is free."""
    free, needed = free_memory(), height * width * BYTES_PER_PIXEL
    if free is not None and needed > free:
        raise InputError(f"frames of {width}x{height} pixels take {needed / 2**20:.0f} MiB or more "
                         f"and {free / 2**20:.0f} MiB are free: use a smaller --size")


def free_memory() -> int | None:
    """Bytes that this process may still take, swap included; None where it cannot be told.

    The least of what the machine, a container and the process's own limit leave (Linux).
    """
    left = [_machine(), *map(_container, _CONTAINER), _own_limit()]
    return min((max(0, n) for n in left if n is not None), default=None)


def _machine() -> int | None:
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = dict(line.split(":", 1) for line in
                     Path("/proc/meminfo").read_text().splitlines() if ":" in line)
        return sum(int(lines[key].split()[0]) << 10 for key in ("MemAvailable", "SwapFree")
                   if key in lines)
    return None


def _container(name: str) -> int | None:
    """The limit as a whole: what is used of it counts cached files, which give way."""
    with contextlib.suppress(OSError, ValueError):  # "max" where there is no limit
        return int(Path("/sys/fs/cgroup", name).read_text())
    return None


def _own_limit() -> int | None:
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            return limit - pages * os.sysconf("SC_PAGE_SIZE")
    return None
