"""Scene files and what lies beside them: neighbours, textures, and names that are taken."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from onespp.scenes.catalog import load
from onespp.scenes.description import Scene, SceneError

HEAD = """
from onespp.scenes.description import Camera, Rectangle, Scene, Shape
from onespp.scenes.materials import diffuse
from onespp.scenes.transforms import look_at
"""
FILE = HEAD + """
from parts import COLOR

def scene(environment=0.5, material=None):
    shape = Shape("x", Rectangle(), material or diffuse(COLOR))
    return Scene("mine", "one", (shape,), Camera(look_at((0, 0, 4), (0, 0, 0))), 2, 8, 6,
                 environment=environment)
"""


def write(folder: Path, **files: str) -> str:
    """Files of a folder, NAME.py with their text; the path of the scene's."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    return str(folder / "mine.py")


def color_of(scene) -> tuple:
    return scene.shapes[0].material["bsdf"]["reflectance"]


def test_a_file_imports_its_neighbours_and_leaves_nothing_behind(tmp_path):
    path, modules, here = list(sys.path), set(sys.modules), os.getcwd()
    mine = write(tmp_path, mine="import os\nos.chdir('/')\n" + FILE,
                 parts="from colours.red import RED as COLOR\n")
    write(tmp_path / "colours", red="from .dark import DARK as RED\n", dark="DARK = (.3, 0, 0)\n")
    assert color_of(load(mine)) == (0.3, 0, 0)
    assert sys.path == path
    assert not {"parts", "colours", "colours.red", "scene_file"} & (set(sys.modules) - modules)
    assert os.getcwd() == here
    assert not list(tmp_path.rglob("__pycache__"))


def test_neighbours_of_two_files_do_not_meet_and_are_read_again(tmp_path):
    first = write(tmp_path / "a", mine=FILE, parts="COLOR = (0.1, 0, 0)")
    second = write(tmp_path / "b", mine=FILE, parts="COLOR = (0.2, 0, 0)")
    assert [color_of(load(p))[0] for p in (first, second, first)] == [0.1, 0.2, 0.1]
    write(tmp_path / "a", parts="COLOR = (0.3, 0, 0)")
    assert color_of(load(first))[0] == 0.3


def test_what_is_left_when_a_file_fails_is_cleared_away_too(tmp_path):
    path = list(sys.path)
    mine = write(tmp_path, mine="import sys\nsys.path.insert(0, '/nowhere')\nimport parts\n1 / 0\n",
                 parts="")
    with pytest.raises(SceneError, match="line 4: ZeroDivisionError"):
        load(mine)
    assert sys.path == path
    assert not {"parts", "scene_file"} & set(sys.modules)


def test_a_files_own_dataclasses_and_imports_in_functions_work(tmp_path):
    mine = write(tmp_path, parts="COLOR = (0.1, 0, 0)", mine=(
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        + FILE.replace("from parts import COLOR", "").replace("    shape =", """
    from parts import COLOR
    @dataclass
    class Own:
        x: int
    shape =""")))
    assert color_of(load(mine))[0] == 0.1


TAKEN = ("render", "scenes", "denoise", "onespp", "numpy", "mitsuba", "drjit", "click", "secrets",
         "bisect", "wave", "scene_file")


def test_neighbours_with_names_of_the_library_take_nothing_from_it(tmp_path):
    """A whole render, in a process of its own, whose first imports come after the scene's."""
    mine = write(tmp_path, mine="import secrets, wave\n" + FILE, parts="COLOR = (0.1, 0, 0)",
                 **dict.fromkeys(TAKEN, "raise RuntimeError('the wrong one')"))
    program = ("import sys; sys.path[:] = [p for p in sys.path if p]; import onespp.cli; "
               f"sys.argv = ['onespp', 'render', {mine!r}, '--out', {str(tmp_path / 'out')!r}]; "
               "onespp.cli.main()")
    done = subprocess.run([sys.executable, "-c", program], text=True, capture_output=True,
                          timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/frames/0001.exr").is_file()


def test_a_file_that_replaces_the_search_path_leaves_the_librarys(tmp_path):
    path, entries = sys.path, list(sys.path)
    load(write(tmp_path, parts="COLOR = (0, 0, 0)",
               mine=FILE + f"import sys\nsys.path = [{str(tmp_path)!r}]\n"))
    assert sys.path is path
    assert sys.path == entries


@pytest.mark.parametrize(("text", "words"), [
    ("class E(Exception):\n    def __str__(self): return 1 / 0\nraise E()", "line 3: E"),
    ("class E(BaseException): pass\nraise E('x')", "line 2: E: x"),
    ("def scene(): return scene()", "RecursionError"),
    ("(" * 1000, "SyntaxError"),
])
def test_what_a_file_raises_is_one_sentence(tmp_path, text, words):
    with pytest.raises(SceneError, match=words) as caught:
        load(write(tmp_path, mine=text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a\nb.py", "x" * 300 + ".py", "a\0.py", "\udcff.py"])
def test_a_path_that_no_file_can_have_is_one_sentence(name):
    with pytest.raises(SceneError, match="no scene file") as caught:
        load(name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("options", "words"), [
    (["--frames", ""], "'' are not frames"), (["--size", ""], "'' is not understood"),
    (["--reference-spp", 10**30], "use at most"), (["--threads", 100000], "--threads is 100000"),
    (["--frames", "4:7"], "in frame 5 raises ZeroDivisionError")])
def test_options_that_cannot_be_are_one_sentence(tmp_path, call, options, words):
    mine = write(tmp_path, parts="COLOR = (0, 0, 0)", mine=FILE.replace(
        "diffuse(COLOR))", "diffuse(COLOR), lambda frame: look_at((1 / (frame - 5), 0, 0), "
        "(0, 0, -9)))"))
    code, _, error = call("render", mine, "--out", tmp_path / "out", *options)
    assert code == 2
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out/manifest.json").exists()


def test_overwriting_by_a_scene_that_cannot_be_built_loses_nothing(tmp_path, call):
    mine = write(tmp_path, parts="COLOR = (0.5, 0, 0)", mine=FILE)
    options = ("render", mine, "--out", tmp_path / "out", "--channels", "color", "--overwrite")
    assert call(*options)[0] == 0
    write(tmp_path, mine=FILE.replace("material or", '{"type": "difuse"} or'))
    assert call(*options)[0] == 2
    assert (tmp_path / "out/frames/0001.exr").is_file()


@pytest.mark.parametrize("line", ["from render import FLOOR", "import render; render.FLOOR"])
def test_a_neighbour_whose_name_is_taken_is_said_to_be(tmp_path, line):
    mine = write(tmp_path, mine=HEAD + line, render="FLOOR = 1")
    with pytest.raises(SceneError, match=r"line 5: .*'render' is an installed package.*another na"):
        load(mine)


def test_an_import_that_comes_too_late_is_one_sentence(tmp_path):
    """Neighbours can be imported while the file runs, and while its frames are tried out."""
    mine = write(tmp_path, mine=FILE.replace("(0, 0, 4), (0, 0, 0))", "(0, 0, 4), (0, 0, 0))"),
                 parts="COLOR = (0.1, 0, 0)")
    text = Path(mine).read_text().replace(
        'diffuse(COLOR))', 'diffuse(COLOR), world_from_object=moved)').replace(
        "def scene", "def moved(frame):\n    if frame > 1:\n        import late\n"
        "    return look_at((0, 0, 0), (0, 0, -1), (0, -1, 0))\n\ndef scene")
    write(tmp_path, mine=text, late="")
    scene = load(mine)
    with pytest.raises(SceneError, match="place of 'x' in frame 2 raises ModuleNotFoundError"):
        scene.try_frames([2])


# Files that a scene names


def pictures(folder: Path) -> None:
    from onespp.render.mitsuba.variant import mi

    mi.Bitmap(np.full((2, 4, 3), 0.25, np.float32)).write(str(folder / "tex.exr"))
    mi.Bitmap(np.full((2, 4, 3), 3, np.float32)).write(str(folder / "sky.exr"))


@pytest.mark.parametrize("named", ["relative", "from elsewhere"])
def test_files_are_found_from_the_scenes_folder(tmp_path, monkeypatch, named):
    from onespp.render.tracer.renderer import Renderer

    texture = '{"type": "diffuse", "reflectance": {"type": "bitmap", "filename": "tex.exr"}}'
    path = write(tmp_path / "s", parts="COLOR = (0, 0, 0)", mine=FILE.replace(
        "environment=0.5, material=None", f'environment="sky.exr", material={texture}'))
    pictures(tmp_path / "s")
    monkeypatch.chdir(tmp_path if named == "relative" else "/")
    scene = load("s/mine.py" if named == "relative" else path)
    monkeypatch.chdir(Path(__file__).parent)
    frame = Renderer(scene, 6, 8).frame(0, 0, ("albedo", "emission"))
    np.testing.assert_allclose(frame["albedo"][3, 4], 0.25)
    np.testing.assert_allclose(frame["emission"][0, 0], 3)


def test_a_file_that_is_missing_is_named_with_where_it_was_looked_for(tmp_path, call):
    path = write(tmp_path / "s", parts="COLOR = (0, 0, 0)", mine=FILE.replace(
        "environment=0.5", 'environment="sky.exr"'))
    code, _, error = call("render", path, "--out", tmp_path / "out")
    assert code == 2
    assert str(tmp_path / "s/sky.exr") in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["..", ".", "a/b", " ", "a" * 101])
def test_a_scenes_name_that_is_no_file_name_is_refused(tmp_path, name):
    path = write(tmp_path, parts="COLOR = (0, 0, 0)", mine=FILE.replace('"mine"', repr(name)))
    with pytest.raises(SceneError, match="name"):
        load(path)


@pytest.mark.parametrize(("place", "emission", "what"), [
    ("lambda frame: translate(random(3))", "1", "the place of 'ball'"),
    ("eye(4)", "lambda frame: random()", "the emission of 'ball'")])
def test_what_differs_when_asked_twice_is_refused(tmp_path, place, emission, what):
    """Images and matrices of one frame would not be of one place, and nothing could be resumed."""
    path = tmp_path / "mine.py"
    path.write_text("from numpy import eye\nfrom numpy.random import random\n"
                    "from onespp.scenes.description import *\n"
                    "from onespp.scenes.materials import diffuse\n"
                    "from onespp.scenes.transforms import look_at, translate\n"
                    f"BALL = Shape('ball', Sphere(), diffuse((1, 1, 1)), {place}, {emission})\n"
                    "SCENE = Scene('mine', '', (BALL,), Camera(look_at((0, 0, 4), (0, 0, 0))), "
                    "2, 8, 6)\n")
    with pytest.raises(SceneError, match=f"{what} is not the same when frame 0 is asked for"):
        load(str(path))


def test_files_that_say_scenes_still_work_with_a_note(tmp_path):
    """The package was called `scenes` before it was `onespp.scenes`; the classes are the same."""
    path = write(tmp_path, mine=FILE.replace("onespp.scenes", "scenes"),
                 parts="from scenes.transforms import translate\nCOLOR = (0.1, 0, 0)\n")
    assert "from scenes." in Path(path).read_text()
    before = {name for name in sys.modules if name.split(".")[0] == "scenes"}
    with pytest.warns(FutureWarning, match=r"mine.py imports `scenes`: write `onespp.scenes`"):
        assert isinstance(load(path), Scene)
    assert {name for name in sys.modules if name.split(".")[0] == "scenes"} == before
