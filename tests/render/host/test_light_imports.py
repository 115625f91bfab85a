"""What is imported loads no more than it needs: each case in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

MAPS = Path("/proc/self/maps")
LIGHT = tuple(f"onespp.{name}" for name in (
    "render", "render.files.sequence", "render.files.exr", "render.files.times",
    "render.games202.convert", "render.cli.render", "denoise", "denoise.metrics.table",
    "denoise.metrics.perceptual.flip", "denoise.metrics.flicker", "denoise.score.causes",
    "denoise.score.scorer", "denoise.score.scorecard", "denoise.score.cost",
    "denoise.score.compare", "denoise.score.sequence", "denoise.report.contact_sheets",
    "denoise.report.provenance", "denoise.report.html", "denoise.cli.denoise", "denoise.cli.score",
    "scenes", "cli"))
CODE = """
import importlib, sys
from pathlib import Path
maps = Path("/proc/self/maps")
for name in sys.argv[1:]:
    importlib.import_module(name)
    found = [m for m in ("drjit", "mitsuba") if m in sys.modules]
    found += ["LLVM"] if maps.exists() and "libLLVM" in maps.read_text() else []
    print(name, *found)
"""


def loaded(*modules: str) -> list[list[str]]:
    """Each module, and what of Dr.Jit, Mitsuba and LLVM was loaded when it had been imported."""
    done = subprocess.run([sys.executable, "-c", CODE, *modules], capture_output=True, text=True,
                          check=True)
    return [line.split() for line in done.stdout.splitlines()]


def test_what_reads_scores_and_shows_frames_loads_no_compiler():
    assert loaded(*LIGHT) == [[module] for module in LIGHT]


@pytest.mark.skipif(not MAPS.exists(), reason="what is loaded can be told on Linux alone")
def test_methods_do_load_it_and_the_test_would_see_it():
    module = "onespp.denoise.methods.atrous"
    assert loaded(module) == [[module, "drjit", "LLVM"]]


@pytest.mark.skipif(not MAPS.exists(), reason="what is loaded can be told on Linux alone")
@pytest.mark.parametrize(("first", "then"), [("onespp.render", "drjit"),
                                             ("onespp.denoise.metrics.table", "mitsuba")])
def test_the_llvm_is_ours_whatever_asks_for_it_first(first, then):
    """A plain `import drjit` finds the system's, which may be one that it would crash with."""
    code = (f"import os; os.environ.pop('DRJIT_LIBLLVM_PATH', None); import {first}; import {then};"
            "import drjit.llvm; drjit.llvm.Float([1]) + 1; "
            "from onespp.render.host.backend import find_llvm; "
            "print({line.split()[-1] for line in open('/proc/self/maps') if 'libLLVM' in line} == "
            "{os.path.realpath(find_llvm().path)})")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "True\n", done.stderr
