"""Sphinx: MyST pages in the furo theme, with tables and drawings made from the code."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from from_code import filled

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
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sourcelink = False


def setup(app) -> None:
    app.connect("source-read", _fill)


def _fill(app, name: str, source: list[str]) -> None:
    source[0] = filled(source[0])
