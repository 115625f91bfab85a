"""The house's rules: which folder may import which, what is heavy and where it may be used.

A room is a folder, or a file beside folders. `ROOMS` lists them from the roof to the ground: an
import may only point down this list, or to another file of its own room, in no circle. Imports
inside functions and under TYPE_CHECKING count as well.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = (
    "onespp.__main__", "onespp.cli", "onespp.templates", "onespp.denoise.cli", "onespp.render.cli",
    "onespp", "onespp.api", "onespp.training",
    "onespp.datasets.pool", "onespp.datasets.slurm", "onespp.datasets.preview",
    "onespp.datasets.making",
    "onespp.datasets.look", "onespp.datasets.files", "onespp.clips", "onespp.datasets.processes",
    "onespp.datasets",
    "onespp.denoise.report", "onespp.denoise.bench", "onespp.denoise.studies",
    "onespp.denoise.run", "onespp.denoise.score",
    "onespp.denoise.catalog", "onespp.denoise.peers",
    "onespp.denoise.methods.antialiasing", "onespp.denoise.methods.filtered_innovation",
    "onespp.denoise.methods.learned", "onespp.denoise.methods.regression",
    "onespp.denoise.methods.reliable_motion",
    "onespp.denoise.methods.unguided",
    "onespp.denoise.methods",
    "onespp.denoise.filters", "onespp.denoise.history", "onespp.denoise.inputs",
    "onespp.denoise.oracles", "onespp.denoise.jit", "onespp.denoise.metrics",
    "onespp.denoise.geometry", "onespp.denoise",
    "onespp.render.doctor", "onespp.render.trials", "onespp.render.job",
    "onespp.render.references", "onespp.render.study", "onespp.render.tracer",
    "onespp.render.scene_of_file", "onespp.render.gltf", "onespp.render.scene_files",
    "onespp.render.mitsuba", "onespp.render.foreign", "onespp.render.games202",
    "onespp.render", "onespp.render.files", "onespp.render.host",
    "onespp.render.derived", "onespp.render.frame", "onespp.render.guides_camera",
    "onespp.render.channels",
    "onespp.render.progress",
    "onespp.render.errors",
    "onespp.scenes.catalog", "onespp.scenes.drawn", "onespp.scenes.generated",
    "onespp.scenes.hard", "onespp.scenes.room",
    "onespp.scenes",
    "onespp.show",
    "onespp.entry_points", "onespp.user_code",
)
MOST_FILES = 12
ONLY_IN = {  # package -> rooms that may import it
    "click": r"\.cli(\.|$)",
    # trials: what `doctor` tries
    **dict.fromkeys(("matplotlib", "PIL", "jinja2", "av"),
                    r"\.denoise\.report(\.|$)|\.render\.trials$|\.training\.curve$"),
    "mitsuba": r"\.render\.(study|tracer|gltf|scene_files|mitsuba|cli|doctor|trials)(\.|$)|"
               r"\.denoise\.peers\.optix$",
}
NEVER = {  # module -> what it never imports
    r"^onespp\.denoise\.(metrics|score|geometry|oracles)(\.|$)": r"^drjit",
    r"^onespp\.render\.(files|frame|channels|errors)(\.|$)": r"^(drjit|mitsuba)",
    r"^onespp\.denoise(\.|$)": r"^onespp\.(scenes|render\.(tracer|gltf|scene_files|mitsuba))(\.|$)",
    r"^onespp\.render(\.|$)": r"^onespp\.denoise(\.|$)",
    # a command parses, calls and prints: images and kernels are below it
    r"^onespp\.(\w+\.)?cli(\.|$)": r"^(numpy|drjit|mitsuba|"
                                     r"onespp\.render\.(tracer|gltf|scene_files|mitsuba))(\.|$)",
    # data loaders' workers
    r"^onespp\.(clips|datasets\.(folder|plan|card))(\.|$)":
        r"^(drjit|mitsuba|onespp\.render\.(tracer|gltf|scene_files|mitsuba|job))(\.|$)",
    r"^onespp\.scenes(\.|$)": r"^(onespp\.(render|denoise)|drjit|mitsuba)(\.|$)",
}


@cache
def sources() -> dict[str, str]:
    """Module -> its source, for all of the installed package. (Not to be changed.)"""
    found = {}
    for top in ("onespp", "scenes", "render", "denoise"):
        for path in sorted((ROOT / top).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            if top == "onespp" and len(parts) > 2 and (ROOT / "onespp" / parts[1]).is_symlink():
                continue
            parts = parts if top == "onespp" else ("onespp", *parts)
            package = parts[-1] == "__init__"
            found[".".join(parts[:-1] if package else parts)] = path.read_text()
    return found


@cache
def import_nodes(source: str) -> list[ast.Import | ast.ImportFrom]:
    """All import statements of a source."""
    return [n for n in ast.walk(ast.parse(source)) if isinstance(n, (ast.Import, ast.ImportFrom))]


def imports(module: str, source: str, modules: Mapping[str, str]) -> Iterator[str]:
    """Full names of the modules that a module imports."""
    packages = {name.rpartition(".")[0] for name in modules}
    here = module if module in packages else module.rpartition(".")[0]
    for node in import_nodes(source):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            base = node.module or ""
            if node.level:
                above = here.split(".")[:len(here.split(".")) - node.level + 1]
                base = ".".join([*above, *([base] if base else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield inner if inner in modules else base


def room_of(module: str) -> str:
    """The room that a module stands in: the longest name in `ROOMS` that begins its own."""
    return max((r for r in ROOMS if f"{module}.".startswith(f"{r}.")), key=len, default=module)


def violations(modules: Mapping[str, str]) -> list[str]:
    """One sentence for each rule that is broken."""
    graph = {m: set(imports(m, text, modules)) for m, text in modules.items()}
    found = []
    for module, targets in graph.items():
        for target in sorted(targets):
            for package, where in ONLY_IN.items():
                if target.split(".")[0] == package and not re.search(where, module):
                    found.append(f"{module} imports {package}")
            for who, what in NEVER.items():
                if re.search(who, module) and re.search(what, target):
                    found.append(f"{module} imports {target}")
            if target in modules:
                a, b = room_of(module), room_of(target)
                if a not in ROOMS:
                    found.append(f"{module} stands in no room")
                elif a != b and ROOMS.index(a) > ROOMS.index(b):
                    found.append(f"{module} imports {target}: up from {a} to {b}")
    try:
        inner = {m: {t for t in targets if t in modules and t != m} for m, targets in graph.items()}
        TopologicalSorter(inner).prepare()
    except CycleError as error:
        found.append("circle: " + " <- ".join(error.args[1]))
    return found


def test_the_rules_hold():
    assert violations(sources()) == []


@pytest.mark.parametrize(("module", "line", "complaint"), [
    ("onespp.denoise.jit.fastmath", "import onespp.denoise.methods.svgf", "up from"),
    ("onespp.denoise.history.records", "from onespp.denoise.methods import svgf", "up from"),
    ("onespp.render.files.exr", "from . import sequence", "circle"),
    ("onespp.denoise.metrics.table", "import drjit as dr", "imports drjit"),
    ("onespp.denoise.score.scorecard", "def f():\n    import drjit.llvm", "imports drjit"),
    ("onespp.render.files.manifest", "import mitsuba", "imports mitsuba"),
    ("onespp.denoise.studies.lead", "import click", "imports click"),
    ("onespp.denoise.score.compare", "import matplotlib.pyplot", "imports matplotlib"),
    ("onespp.denoise.run.sequence", "from PIL import Image", "imports PIL"),
    ("onespp.denoise.score.sequence", "import jinja2", "imports jinja2"),
    ("onespp.denoise.metrics.perceptual.flip", "import av", "imports av"),
    ("onespp.denoise.studies.hard_scenes", "from onespp.scenes.hard import HARD", "imports"),
    ("onespp.denoise.run.sequence", "from onespp.render.tracer import path", "imports"),
    ("onespp.denoise.methods.svgf", "import mitsuba as mi", "imports mitsuba"),
    ("onespp.scenes.box", "import onespp.render.frame", "imports onespp.render"),
    ("onespp.cli.hard", "import numpy as np", "imports numpy"),
    ("onespp.show.png", "from onespp.render import channels", "up from"),
    ("onespp.api.caller", "import onespp.cli", "up from"),
])
def test_a_broken_rule_is_noticed(module: str, line: str, complaint: str):
    modules = sources()
    assert any(complaint in text for text in violations(
        {**modules, module: f"{modules[module]}\n\n{line}\n"}))


def test_a_folder_holds_3_to_12_files():
    folders = {path.parent for top in ("scenes", "render", "denoise", "onespp/api", "onespp/show",
                                             "onespp/datasets", "onespp/clips", "onespp/training")
               for path in (ROOT / top).rglob("*.py")}
    sizes = {str(folder.relative_to(ROOT)): len([
        p for p in folder.iterdir() if p.suffix == ".py" and p.stem != "__init__"])
        for folder in folders}
    # A folder of folders may hold fewer files of its own.
    assert {name: size for name, size in sizes.items() if size > MOST_FILES
            or (size < 3 and not any(p.is_dir() and (p / "__init__.py").exists()
                                     for p in (ROOT / name).iterdir()))} == {}


def test_every_folder_is_a_package_that_is_installed():
    text = (ROOT / "pyproject.toml").read_text()
    listed = set(re.findall(r'"(onespp[a-z0-9_.]*)"', text.split("packages = [")[1].split("]")[0]))
    folders = {path.parent for top in ("scenes", "render", "denoise", "onespp")
               for path in (ROOT / top).rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert listed == {n if n.split(".")[0] == "onespp" else f"onespp.{n}" for n in names}


@pytest.mark.parametrize("module", [
    "onespp", "onespp.render", "onespp.render.files", "onespp.denoise", "onespp.denoise.metrics",
    "onespp.denoise.score", "onespp.scenes", "onespp.clips.clips"])
def test_what_is_light_loads_no_kernels(module: str):
    code = (f"import sys, pkgutil, importlib; m = importlib.import_module('{module}')\n"
            "heavy = {'drjit', 'mitsuba', 'click', 'matplotlib', 'PIL'} & set(sys.modules)\n"
            "maps = open('/proc/self/maps').read() if sys.platform == 'linux' else ''\n"
            "sys.exit(f'{heavy} {\"libLLVM\" in maps}' if heavy or 'libLLVM' in maps else 0)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
