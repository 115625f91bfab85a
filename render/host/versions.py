"""Versions of the packages that decide a result."""

from __future__ import annotations

import importlib.metadata
import platform


def versions(*packages: str) -> dict[str, str]:
    """Version by name, of onespp, the given packages and Python."""
    return {name: importlib.metadata.version(name) for name in ("onespp", *packages)} | {
        "python": platform.python_version()}
