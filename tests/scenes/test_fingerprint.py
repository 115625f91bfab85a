"""Every input of a frame is in its scene's fingerprint, so that no folder mixes two scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.job import RenderJob, render_sequence
from onespp.render.mitsuba.variant import mi
from onespp.scenes.description import Camera, Mesh
from onespp.scenes.fingerprint import fingerprint
from onespp.scenes.transforms import look_at, translate
from tests.render.tracer.test_renderer import small_scene
from tests.support.furnace import CORNERS, INWARD

SIZE = 6


def with_floor(**changes):
    """The small scene with another floor."""
    return small_scene(shapes=tuple(replace(shape, **changes) if shape.name == "floor" else shape
                                    for shape in small_scene().shapes))


def textured(**texture):
    return with_floor(material={"type": "twosided", "bsdf": {
        "type": "diffuse", "reflectance": {"type": "bitmap", **texture}}})


def picture(path, value: int):
    Image.fromarray(np.full((4, 4, 3), value, np.uint8)).save(path)
    return path


def block(**changes):
    parts = {"vertices": CORNERS, "faces": INWARD, "normals": CORNERS, "uv": CORNERS[:, :2]}
    return with_floor(geometry=Mesh(**(parts | changes)))


A, B = {"type": "diffuse", "reflectance": 0.2}, {"type": "diffuse", "reflectance": 0.8}
PAIRS = {
    "motion": (with_floor(world_from_object=lambda f: translate((f, 0, 0))),
               with_floor(world_from_object=lambda f: translate((2 * f, 0, 0)))),
    "the last frame's place": (
        with_floor(world_from_object=lambda f: translate((f, 0, 0))),
        with_floor(world_from_object=lambda f: translate((f if f < 7 else 0, 0, 0)))),
    "emission": (with_floor(emission=lambda f: (f, 1.0, 1.0)),
                 with_floor(emission=lambda f: (1.0, f, 1.0))),
    "camera": (small_scene(camera=Camera(look_at((0, 2, 5), (0, 0, 0)))),
               small_scene(camera=Camera(look_at((0, 2, 4), (0, 0, 0))))),
    "field of view": (small_scene(camera=Camera(look_at((0, 2, 5), (0, 0, 0)), 40)),
                      small_scene(camera=Camera(look_at((0, 2, 5), (0, 0, 0)), 41))),
    "depth": (small_scene(), small_scene(max_depth=4)),
    "sky": (small_scene(environment=(1.0, 1.0, 1.0)), small_scene(environment=(1.0, 1.0, 1.1))),
    "sky's image": (small_scene(environment=np.ones((2, 4, 3))),
                    small_scene(environment=np.ones((2, 4, 3)) * [1, 1, 2])),
    "vertices": (block(), block(vertices=CORNERS * 1.5)),
    "faces": (block(), block(faces=INWARD[:, ::-1])),
    "normals": (block(), block(normals=-CORNERS)),
    "uv": (block(), block(uv=CORNERS[:, 1:])),
    "colours of vertices": (block(), block(attributes={"vertex_color": CORNERS})),
    "their values": (block(attributes={"vertex_color": CORNERS}),
                     block(attributes={"vertex_color": -CORNERS})),
    "their name": (block(attributes={"vertex_a": CORNERS}),
                   block(attributes={"vertex_b": CORNERS})),
    "image": (textured(bitmap=np.zeros((2, 2, 3))), textured(bitmap=np.ones((2, 2, 3)))),
    "an image of Mitsuba": tuple(textured(bitmap=mi.Bitmap(np.full((2, 2, 3), v, np.float32)))
                                 for v in (0.2, 0.3)),
    "filter": (textured(bitmap=np.zeros((2, 2, 3))),
               textured(bitmap=np.zeros((2, 2, 3)), filter_type="nearest")),
    "sides": (with_floor(material={"type": "twosided", "front": A, "back": B}),
              with_floor(material={"type": "twosided", "back": B, "front": A})),
    "name": (with_floor(), with_floor(name="ground")),
}


@pytest.mark.parametrize("what", PAIRS)
def test_whatever_decides_a_pixel_is_in_the_fingerprint(what):
    one, other = PAIRS[what]
    assert fingerprint(one) == fingerprint(one)
    assert fingerprint(one) != fingerprint(other)


def test_the_same_scene_built_again_has_the_same_fingerprint():
    for build in (small_scene, block, lambda: textured(bitmap=np.full((2, 2, 3), 0.25)),
                  lambda: textured(bitmap=mi.Bitmap(np.ones((2, 2, 3), np.float32)))):
        assert fingerprint(build()) == fingerprint(build())


def test_meshes_without_attributes_have_the_fingerprint_they_had_before_there_were_any():
    assert fingerprint(block()) == fingerprint(block(attributes={})) == "b8fab0b3dd7d65a6"


def test_attributes_have_no_order():
    a, b = ("vertex_a", CORNERS), ("vertex_b", -CORNERS)
    assert fingerprint(block(attributes=dict((a, b)))) == fingerprint(
        block(attributes=dict((b, a))))


@pytest.mark.parametrize("kind", [str, lambda path: path])
def test_files_count_by_their_contents_wherever_they_lie(tmp_path, kind):
    for make in (lambda path: textured(filename=kind(path)),
                 lambda path: small_scene(environment=kind(path))):
        path = picture(tmp_path / "a.png", 10)
        before = fingerprint(make(path))
        assert fingerprint(make(picture(tmp_path / "b.png", 10))) == before
        picture(path, 11)
        assert fingerprint(make(path)) != before
        path.unlink()
        assert fingerprint(make(path)) != before


def test_a_word_of_a_material_is_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = fingerprint(small_scene())
    (tmp_path / "diffuse").write_text("a file that has a plugin's name")
    assert fingerprint(small_scene()) == before


def test_an_edited_texture_file_is_not_mixed_with_the_old_one(tmp_path):
    path = picture(tmp_path / "a.png", 200)
    job = RenderJob(textured(filename=str(path)), [0, 1], SIZE, SIZE)
    render_sequence(job, tmp_path / "s")
    picture(path, 20)
    with pytest.raises(InputError, match=r"has changed.*--overwrite"):
        render_sequence(RenderJob(textured(filename=str(path)), [2], SIZE, SIZE), tmp_path / "s")


def rolling(stop: float, size: float = 0.4):
    """The ball rolls on after the scene's last frame, 7, until it stops."""
    return with_floor(world_from_object=lambda f: translate((size * min(f, stop), 0, 0)))


def test_frames_after_the_last_are_not_mixed_with_those_of_another_motion(tmp_path):
    def render(scene, *frames):
        render_sequence(RenderJob(scene, frames, SIZE, SIZE), tmp_path / "s")

    render(rolling(20), 0, 8, 9)
    render(rolling(20), 1, 12)
    assert FrameSequence.open(tmp_path / "s").frames == [0, 1, 8, 9, 12]
    render(rolling(12), 2, 10)  # as far as the folder's frames go, the same
    before = (tmp_path / "s/manifest.json").read_bytes()
    for frames in ([8], [13], [3]):
        with pytest.raises(InputError, match=r"what frame 10 was made from has changed"):
            render(rolling(9), *frames)
    assert (tmp_path / "s/manifest.json").read_bytes() == before
    render_sequence(RenderJob(rolling(9), [8], SIZE, SIZE), tmp_path / "s", overwrite=True)
    assert FrameSequence.open(tmp_path / "s").frames == [8]


def test_frames_after_the_last_that_were_asked_for_but_not_made_bind_nobody(tmp_path):
    job = RenderJob(rolling(20), (0, 9), SIZE, SIZE)
    FrameSequence.create(tmp_path / "s", job.manifest())
    render_sequence(RenderJob(rolling(8), (0, 9), SIZE, SIZE), tmp_path / "s")
    with pytest.raises(InputError, match="frame 9"):
        render_sequence(job, tmp_path / "s")
