"""Files of Blender's go through the user's Blender; here a program that does what it would."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from onespp.render.gltf.blender import VARIABLE
from onespp.render.scene_of_file import scene_of_file
from onespp.scenes.description import SceneError
from tests.support.gltf_scenes import moving

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the program is a script")


@pytest.fixture
def blender(tmp_path, monkeypatch):
    """Makes a program that copies a glTF file to where Blender is told to write it."""
    def make(last: str) -> Path:
        program = tmp_path / "blender"
        program.write_text(f"#!{sys.executable}\nimport shutil, sys\na = sys.argv\n"
                           "assert a[1:3] == ['--background', '--factory-startup'], a\n"
                           "assert open(a[3]).read() == 'BLENDER', a\n"
                           "expression = a[a.index('--python-expr') + 1]\n"
                           "compile(expression, 'e', 'exec')\nassert a[-2] == '--'\n" + last)
        program.chmod(0o755)
        monkeypatch.setenv(VARIABLE, str(program))
        return program

    (tmp_path / "kitchen.blend").write_text("BLENDER")
    return make


def test_a_file_is_what_blender_exports(tmp_path, blender):
    exported = moving(tmp_path)[0]
    blender(f"shutil.copy({str(exported)!r}, a[-1])\n")
    loaded, expected = scene_of_file(tmp_path / "kitchen.blend"), scene_of_file(exported)
    assert loaded.scene.name == "kitchen"
    assert loaded.scene.object_names == expected.scene.object_names
    assert loaded.scene.moving == expected.scene.moving
    assert loaded.files == (tmp_path / "kitchen.blend",)


@pytest.mark.parametrize(("last", "words"), [
    ("print('Error: no such operator'); sys.exit(3)", r"could not export it .*Error: no such op"),
    ("pass", "could not export it to glTF .*export a .glb"),
    ("open(a[-1], 'w').write('x')", r"^scene file '.*kitchen\.blend, as Blender exports it,'")])
def test_a_blender_that_fails_is_told_in_a_sentence(tmp_path, blender, last, words):
    blender(last)
    with pytest.raises(SceneError, match=words):
        scene_of_file(tmp_path / "kitchen.blend")


def test_so_is_one_that_is_not_there(tmp_path, blender, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(SceneError, match=r"nowhere does not run .*set ONESPP_BLENDER"):
        scene_of_file(tmp_path / "kitchen.blend")
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(SceneError, match="there is no `blender` here: install it"):
        scene_of_file(tmp_path / "kitchen.blend")
    with pytest.raises(SceneError, match="there is no scene file"):
        scene_of_file(tmp_path / "cellar.blend")
