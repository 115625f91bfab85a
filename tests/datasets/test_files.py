"""Data sets of the user's own scenes and meshes: drawn from, held out, known by what is in them."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import onespp
from onespp.datasets.files import drawn_of_file, mesh_of, opened
from onespp.datasets.folder import DataSet
from onespp.datasets.plan import Plan, changed_plan, read_plan
from onespp.render.errors import InputError
from onespp.render.scene_of_file import scene_of_file
from onespp.scenes.description import Mesh, SceneError
from onespp.scenes.drawn.draw import draw, family_of
from onespp.scenes.fingerprint import fingerprint
from tests.datasets.test_making import files
from tests.support.gltf_scenes import lit, moving

LAMP = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world">
      <lookat origin="0, 1, 5" target="0, 0.5, 0" up="0, 1, 0"/></transform>
  </sensor>
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <include filename="ground.xml"/>
  <shape type="sphere"><point name="center" value="0, 1, 0"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="{light}"/></emitter></shape></scene>"""
GROUND = """<scene version="3.0.0"><shape type="rectangle"><transform name="to_world">
  <scale value="3"/><rotate x="1" angle="-90"/></transform></shape></scene>"""
WEDGE = """v 100 400 0\nv 300 400 0\nv 100 400 100\nv 100 900 0
f 1 3 4\nf 1 4 2\nf 2 4 3\nf 1 2 3\n"""
SAIL = """ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y
property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header
0 0 0\n0.03 0 0\n0 0.001 0\n3 0 1 2\n"""
MESHES = {"draw.families": ["corner"], "draw.files": [], "held_out.files": [],
          "held_out.families": [], "draw.objects": ["mesh", "ball"],
          "draw.meshes": ["wedge.obj", "sail.ply"], "held_out.meshes": ["sail.ply"],
          "draw.things": [3, 5], "draw.motions": ["still", "spin"]}
PLAN = """name = "mine"\nsequences = 4\nframes = 2\nheight = 12\nwidth = 16\nreference_spp = 4
[draw]\nfamilies = ["room", "files", "files"]\nfiles = ["models/*", "lamp.xml"]\nthings = [1, 2]
[split]\ntest = 0.25\nvalidation = 0\n[held_out]\nfamilies = ["room"]\nfiles = ["**/lit.gltf"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A plan with an XML file that includes another, and two glTF files."""
    folder = tmp_path_factory.mktemp("mine")
    (folder / "models").mkdir()
    moving(folder / "models")
    lit(folder / "models")
    (folder / "models/letter.txt").write_text("x")
    (folder / "lamp.xml").write_text(LAMP.format(light="9, 8, 7"))
    (folder / "ground.xml").write_text(GROUND)
    (folder / "wedge.obj").write_text(WEDGE)
    (folder / "sail.ply").write_text(SAIL)
    (folder / "mine.toml").write_text(PLAN)
    return folder


@pytest.fixture(scope="module")
def plan(folder) -> Plan:
    return opened(read_plan(folder / "mine.toml"))


def test_patterns_become_names_and_files_are_held_out(plan):
    assert plan.draw.files == ("models/lit.gltf", "models/moving.glb", "lamp.xml")
    found: dict[str, set[str]] = {"train": set(), "test": set()}
    for n in range(60):
        request = plan.request(n)
        family = family_of(request)
        assert (family == "room") <= (plan.split_of(n) == "test")
        found[plan.split_of(n)] |= {*request.choices.files} if family == "files" else {family}
    assert found == {"train": {"models/moving.glb", "lamp.xml"},
                     "test": {"models/lit.gltf", "room"}}


def test_a_still_camera_is_moved_and_a_moving_one_left_alone(plan):
    views, firsts = set(), set()
    for n in range(12):
        request = plan.request(n)
        if family_of(request) != "files":
            continue
        drawn = drawn_of_file(plan, request)
        record, camera = drawn.record, drawn.scene.camera
        assert record["content"] == plan.contents[record["file"]]
        if record["file"] == "models/moving.glb":
            assert record["camera"] == "its own"
            firsts.add(record["first"])
            start = scene_of_file(Path(plan.folder, record["file"])).scene
            for ours, theirs in zip(drawn.scene.shapes, start.shapes):
                assert np.array_equal(ours.world_from_object_at(1),
                                      theirs.world_from_object_at(record["first"] + 1))
        elif record["file"] == "lamp.xml":
            assert camera.moves == (record["camera"] != "still")
            a, b = (camera.world_from_camera_at(i) for i in (0, 1))
            assert np.array_equal(a, b) == (not camera.moves)
            views.add(a.tobytes())
            again = drawn_of_file(plan, request).scene
            assert fingerprint(again) == fingerprint(drawn.scene)
    assert len(views) > 2
    assert len(firsts) > 2


def test_a_data_set_of_files_is_made_and_a_changed_file_is_refused(folder, tmp_path):
    place = tmp_path / "mine"
    shutil.copytree(folder, place)
    changes = {"draw.families": ["files"], "draw.files": ["lamp.xml"], "held_out.files": []}
    data = onespp.dataset(place / "mine.toml", place / "set", sequences=1, changes=changes)
    assert data.verify() == []
    assert "files: lamp.xml 1\n" in (data.folder / "README.md").read_text()
    assert '"folder": ".."' in (data.folder / "dataset.json").read_text()
    assert DataSet.open(data.folder).plan == data.plan

    place = place.rename(tmp_path / "moved")  # together: all is as it was
    whole = files(place / "set")
    (place / "set/train/000000/sequence.json").unlink()
    onespp.dataset(place / "mine.toml", place / "set", sequences=1, changes=changes)
    assert files(place / "set") == whole

    (place / "ground.xml").write_text(GROUND.replace('"3"', '"4"'))
    with pytest.raises(InputError, match=r"^lamp\.xml, or a file that it names, has changed"):
        onespp.dataset(place / "mine.toml", place / "set", sequences=9, changes=changes)
    plan = DataSet.open(place / "set").plan
    with pytest.raises(InputError, match=r"lamp\.xml, or a file .* put it back"):
        drawn_of_file(plan, plan.request(0))


@pytest.mark.parametrize(("changes", "words"), [
    ({"draw.files": ["no/*.glb"]}, r"draw\.files, names 'no/\*\.glb', and there is no such file"),
    ({"held_out.files": ["gone.xml"]}, r"held_out\.files, names 'gone\.xml'"),
    ({"draw.files": ["mine.toml"]}, r"names 'mine\.toml', which is none of the files that"),
    ({"draw.files": []}, "families has 'files', and there are none"),
    ({"draw.families": ["room", "hall"]}, "there are files, and families has no 'files'"),
    ({"held_out.files": ["**/*.glb", "**/*.gltf", "*.xml"]}, "there are none"),
    ({"draw.files": [3]}, r"invalid 'draw\.files"),
    ({"draw.objects": ["mesh"], "draw.meshes": ["*.glb"]},
     r"draw\.meshes, names '\*\.glb', and there is no such file"),
    ({"draw.objects": ["mesh"], "draw.meshes": ["lamp.xml"]},
     r"names 'lamp\.xml', which is none .*: use \.obj, \.ply"),
    ({"draw.meshes": ["*.obj"]}, "there are meshes, and objects has no 'mesh'"),
    ({"draw.objects": ["mesh"]}, "objects has 'mesh', and there are none"),
    ({"draw.objects": ["mesh", "ball"], "draw.meshes": ["*.obj"], "held_out.meshes": ["*.obj"]},
     "objects has 'mesh', and there are none")])
def test_names_that_cannot_be_used_are_told(folder, changes, words):
    with pytest.raises(InputError, match=words):
        read_plan(folder / "mine.toml", changes)


def test_broken_files_are_told_before_anything_is_made(folder, tmp_path):
    plan = read_plan(folder / "mine.toml")
    (tmp_path / "broken.glb").write_bytes(b"glTF\2\0\0\0")
    broken = changed_plan(plan, {"draw.files": [f"{tmp_path}/broken.glb"]})
    with pytest.raises(SceneError, match="it is cut off or damaged"):
        onespp.dataset(broken, tmp_path / "set")
    assert not (tmp_path / "set").exists()
    shutil.copy(folder / "models/lit.gltf", tmp_path / "copy.gltf")
    with pytest.raises(InputError, match=r"the same file as models/lit\.gltf, which is held out"):
        opened(changed_plan(plan, {"draw.files": [f"{tmp_path}/copy.gltf"]}))


def test_meshes_stand_among_the_things_as_large_as_they_and_are_held_out(folder):
    plan = opened(read_plan(folder / "mine.toml", MESHES))
    found: dict[str, set[str]] = {"train": set(), "test": set()}
    for n in range(12):
        drawn = draw(plan.request(n), partial(mesh_of, plan))
        shapes = {shape.name: shape for shape in drawn.scene.shapes}
        for thing in drawn.record["things"]:
            found[plan.split_of(n)].add(thing["object"])
            if thing["object"] == "ball":
                continue
            shape = shapes[thing["name"]]
            assert isinstance(shape.geometry, Mesh)
            assert shape.geometry.uv is not None
            matrix = shape.world_from_object_at(1)
            points = shape.geometry.vertices @ matrix[:3, :3].T + matrix[:3, 3]
            assert points[:, 1].min() == pytest.approx(0.001)
            width, height = np.ptp(points[:, [0, 2]], axis=0).max(), np.ptp(points[:, 1])
            assert 0.2 < max(width, height) < 2.1
            assert thing["material"] != "glass"  # it may be open
    assert found == {"train": {"wedge.obj", "ball"}, "test": {"sail.ply"}}


def test_a_data_set_with_a_mesh_is_made_and_a_changed_mesh_is_refused(folder, tmp_path):
    place = tmp_path / "mine"
    shutil.copytree(folder, place)
    data = onespp.dataset(place / "mine.toml", place / "set", sequences=1, changes=MESHES)
    assert data.verify() == []
    assert "wedge.obj" in (data.folder / "README.md").read_text()
    (place / "wedge.obj").write_text(WEDGE.replace("900", "800"))
    with pytest.raises(InputError, match=r"^wedge\.obj, or a file that it names, has changed"):
        onespp.dataset(place / "mine.toml", place / "set", sequences=2, changes=MESHES)
    with pytest.raises(InputError, match="put it back"):
        mesh_of(DataSet.open(place / "set").plan, "wedge.obj")


@pytest.mark.parametrize(("text", "words"), [
    ("v 0 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3\n", r"broken\.obj cannot stand .* it has no width"),
    ("v 0 0 0\n", r"broken\.obj cannot be used as a mesh: "),
    ("v 0 0 x\nf 1 1 1\n", r"broken\.obj cannot be used as a mesh: ")])
def test_meshes_that_cannot_be_used_are_told(folder, tmp_path, text, words):
    (tmp_path / "broken.obj").write_text(text)
    plan = changed_plan(read_plan(folder / "mine.toml", MESHES),
                        {"draw.meshes": [f"{tmp_path}/broken.obj"], "held_out.meshes": []})
    with pytest.raises((InputError, SceneError), match=words):
        opened(plan)
    assert not (tmp_path / "set").exists()
