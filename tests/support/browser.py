"""A browser for what we write in HTML: the Chromium that the machine has."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


@contextmanager
def chromium() -> Iterator[Any]:
    """A running browser; skips the test where there is none."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install -e '.[dev]'")
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
                None)
    if path is None:
        pytest.skip("there is no Chromium on this machine to open pages in")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=(
            ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []))
        yield browser
        browser.close()
