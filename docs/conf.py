"""Sphinx: MyST pages in the furo theme, with tables and drawings made from the code."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from from_code import filled  # noqa: E402 - found by the line above

project = "onespp"
version = release = version_of("onespp")
copyright = "the onespp authors, BSD-3-Clause"

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 3
myst_enable_extensions = ["html_image"]
highlight_language = "none"       # formulas and outputs are no Python
smartquotes = False
nitpicky = True

html_theme = "furo"
html_title = "onespp"
html_static_path: list[str] = []
html_css_files: list[str] = []
html_copy_source = False
html_show_sourcelink = False


def setup(app) -> None:
    app.connect("source-read", _fill)


def _fill(app, name: str, source: list[str]) -> None:
    source[0] = filled(source[0])
