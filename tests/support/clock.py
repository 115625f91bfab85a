"""A clock that a test turns by hand, in place of `time.perf_counter`."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any


class Clock(threading.local):
    """Seconds, of each thread its own: work beside other work does not count in its time."""

    def __init__(self) -> None:
        self.now = 0.0

    def pass_(self, seconds: float) -> None:
        self.now += seconds

    def put_into(self, monkeypatch: Any, *modules: str) -> None:
        """Let modules that `import time` read this clock."""
        for module in modules:
            monkeypatch.setattr(f"{module}.time", SimpleNamespace(perf_counter=lambda: self.now))
