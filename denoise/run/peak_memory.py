"""The most memory that a piece of work needs, as the operating system counts it."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class PeakMemory:
    """Resident memory above what it was when this was made, at its highest between the two calls.

        peak = PeakMemory()
        peak.begin(); work(); peak.end()      # as often as wanted
        peak.megabytes                        # None where the system does not tell (not Linux)

    What the process had freed and its allocator kept is given back first, so that it counts when it
    is used again (with glibc; elsewhere it is not seen).
    """

    def __init__(self) -> None:
        _give_back()
        self._before = _kilobytes("VmRSS")
        self.megabytes: float | None = None

    def begin(self) -> None:
        """Forget the highest mark so far."""
        try:
            _RESET.write_text("5")
        except OSError:
            self._before = None

    def end(self) -> None:
        """Take note of the highest mark since `begin`."""
        highest = _kilobytes("VmHWM")
        if highest is not None and self._before is not None:
            self.megabytes = max(self.megabytes or 0.0, (highest - self._before) / 1024)


def _give_back() -> None:
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if _RESET.exists() else None
    if trim is not None:
        trim(0)


def _kilobytes(name: str) -> int | None:
    try:
        found = re.search(rf"^{name}:\s*(\d+) kB", _STATUS.read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(found[1]) if found else None
