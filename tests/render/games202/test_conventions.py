"""Frames of other conventions are told from ours, and ours are never refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.frame import Frame
from onespp.render.games202.conventions import check_frame, check_motion
from onespp.render.games202.convert import export_games202, import_games202
from onespp.render.job import RenderJob, render_sequence
from onespp.scenes import catalog
from onespp.scenes.hard import HARD
from tests.support.frames import make_frame, translation, turn

CAMERA = translation(0.5, 0.3, -1) @ turn(0.3)


def made(**changes) -> Frame:
    return make_frame(48, 64, **{"camera": CAMERA, **changes})


@pytest.fixture(scope="module")
def real(games202, tmp_path_factory) -> FrameSequence:
    return import_games202(games202, tmp_path_factory.mktemp("real") / "s")


def images(frame: Frame, **changed: np.ndarray) -> Frame:
    return replace(frame, images={**frame.images, **{
        name: np.asarray(image, np.float32) for name, image in changed.items()}})


def seen(frame: Frame) -> np.ndarray:
    return frame["id"] >= 0


def transposed(frame: Frame) -> Frame:
    return replace(frame, **{name: np.swapaxes(getattr(frame, name), -1, -2) for name in (
        "camera_from_world", "screen_from_world", "world_from_object")})


def along_the_ray(frame: Frame) -> Frame:
    origin = np.linalg.inv(frame.camera_from_world)[:3, 3]
    distance = np.linalg.norm(frame["position"] - origin, axis=-1)
    return images(frame, depth=np.where(seen(frame), distance, 0))


def of_a_depth_buffer(frame: Frame) -> Frame:
    z = np.where(seen(frame), frame["depth"], 1).astype(np.float64)
    return images(frame, depth=np.where(seen(frame), 1 - 0.1 / z, 0))


def turned_normals(frame: Frame) -> Frame:
    return images(frame, normal=frame["normal"] @ frame.camera_from_world[:3, :3].T)


def turned_positions(frame: Frame) -> Frame:
    c = frame.camera_from_world
    return images(frame, position=frame["position"] @ c[:3, :3].T + c[:3, 3])


def upside_down(frame: Frame) -> Frame:
    return replace(frame, images={name: image[::-1] for name, image in frame.images.items()})


def mirrored(frame: Frame) -> Frame:
    return replace(frame, images={name: image[:, ::-1] for name, image in frame.images.items()})


def to_one(frame: Frame) -> Frame:
    s = frame.screen_from_world.copy()
    s[0] = 2 / frame.width * s[0] - s[3]
    s[1] = s[3] - 2 / frame.height * s[1]
    return replace(frame, screen_from_world=s)


def projection_alone(frame: Frame) -> Frame:
    return replace(frame, screen_from_world=frame.screen_from_world
                   @ np.linalg.inv(frame.camera_from_world))


def looking_back(frame: Frame) -> Frame:
    return replace(frame, camera_from_world=np.diag([1, 1, -1, 1]) @ frame.camera_from_world)


def shuffled(frame: Frame) -> Frame:
    rows = np.random.default_rng(1).permutation(frame.height)
    return images(frame, position=frame["position"][rows])


OTHERS = [
    (transposed, "transposed matrices"),
    (along_the_ray, "the distance along the ray"),
    (lambda f: images(f, depth=-f["depth"]), "a depth below 0"),
    (lambda f: images(f, depth=f["depth"] / 100), "0.01 times the depth that positions have"),
    (of_a_depth_buffer, "what a depth buffer holds"),
    (turned_normals, "normals in camera space"),
    (lambda f: images(turned_normals(f), normal=turned_normals(f)["normal"] * [1, -1, -1]),
     "normals in camera space"),
    (lambda f: images(f, normal=0.5 * f["normal"] + 0.5), "packed to [0, 1]"),
    (lambda f: images(f, normal=np.where(seen(f)[..., None], 0.5 * f["normal"] + 0.5, 0)),
     "packed to [0, 1]"),
    (lambda f: images(f, normal=3 * f["normal"]), "normals of length 3.00"),
    (lambda f: images(f, normal=f["normal"][..., [0, 2, 1]]), "degrees"),
    (upside_down, "rows that run upwards"),
    (mirrored, "columns that run leftwards"),
    (turned_positions, "positions in camera space"),
    (to_one, "a screen of -1 to 1"),
    (projection_alone, "a screen matrix that starts from camera space"),
    (looking_back, "looks along -z"),
    (lambda f: replace(f, screen_from_world=2 * f.screen_from_world), "fourth row"),
    (shuffled, "do not project to their pixels"),
    *((lambda f, name=name, value=value: images(f, **{name: np.full_like(f[name], value)}),
       f"has a {name} in 0 of these alone")
      for name, value in (("position", np.nan), ("depth", np.inf), ("depth", 0.0),
                          ("normal", np.nan), ("normal", 0.0))),
]


def refusal(frame: Frame) -> str:
    with pytest.raises(InputError) as error:
        check_frame(frame)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(("other", "words"), OTHERS)
def test_another_convention_is_named(other, words):
    check_frame(made())
    assert words in refusal(other(made()))


@pytest.mark.parametrize(("other", "words"), OTHERS)
def test_another_convention_is_named_on_real_frames(real, other, words):
    for i in real.frames[::2]:
        assert words in refusal(other(real.read_frame(i)))


def test_inverted_object_matrices_are_named(real):
    frames = [real.read_frame(i) for i in real.frames]
    for before, now in pairwise(frames):
        check_motion(before, now)
        with pytest.raises(InputError, match="object 6 where the inverse"):
            check_motion(*(replace(f, world_from_object=np.linalg.inv(f.world_from_object))
                           for f in (before, now)))


@pytest.mark.parametrize("frame", [
    made(), made(camera=np.eye(4)), made(camera=turn(1e-3)),
    made(camera=translation(1, 0, 0) @ turn(0.7)), made(origin=(1e6, 0, -1e6)),
    made(origin=(1e7, 1e7, 1e7)), make_frame(5, 4), make_frame(1, 1),
], ids=range(8))
@pytest.mark.parametrize("store", ["float64", "float32", "half", "jitter", "outward", "holes"])
def test_our_convention_passes_however_it_is_stored(frame, store):
    if store in ("float32", "half"):
        frame = replace(frame, **{n: getattr(frame, n).astype(np.float32) for n in (
            "camera_from_world", "screen_from_world", "world_from_object")})
    if store == "half" and np.abs(frame["position"]).max() < 6e4:
        frame = images(frame, **{n: frame[n].astype(np.float16) for n in ("position", "normal")})
    if store == "jitter":  # each sample somewhere in its pixel
        shift = np.array([[0.45], [-0.45], [0], [0]])
        frame = replace(frame, screen_from_world=frame.screen_from_world
                        + shift * frame.screen_from_world[3])
    if store == "outward":
        frame = images(frame, normal=-frame["normal"])
    if store == "holes":
        position = frame["position"].copy()
        position[::3] = np.nan
        frame = images(frame, position=position)
    check_frame(frame)


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.slow] if k % 4 else [])
    for k, name in enumerate([*catalog.SCENES, *(f"hard/{n}" for n in HARD)])])
def test_every_scene_of_ours_passes_exported_and_imported(tmp_path, name):
    scene = catalog.load(name)
    job = RenderJob(scene, (4, 5, 6), 64, 96, direct="mis", sampler="pcg",
                    channels=("color", "normal", "position", "depth", "id"))
    export_games202(render_sequence(job, tmp_path / "s"), tmp_path / "x")
    notes = []
    assert import_games202(tmp_path / "x", tmp_path / "i", tell=notes.append).frames == [0, 1, 2]
    assert notes == []
