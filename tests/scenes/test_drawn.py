"""Scenes drawn for data sets: pure functions of what is asked, dealt out evenly, held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from onespp.scenes.description import SceneError
from onespp.scenes.drawn import places
from onespp.scenes.drawn.choices import LIGHTS_OF, Choices, HeldOut
from onespp.scenes.drawn.draw import Request, draw
from onespp.scenes.drawn.things import kinds_of_thing
from onespp.scenes.fingerprint import fingerprint

ASKED = Request("x", 3, 5, 6, 24, 32, Choices(things=(3, 5)))


def test_a_scene_follows_from_what_is_asked_for_and_another_attempt_is_another_scene():
    first, again, other = (draw(r) for r in (ASKED, ASKED, replace(ASKED, attempt=1)))
    assert fingerprint(first.scene) == fingerprint(again.scene) != fingerprint(other.scene)
    assert first.record == again.record
    kinds = ("family", "light", "camera")
    assert [first.record[k] for k in kinds] == [other.record[k] for k in kinds]


def test_every_family_light_and_camera_is_dealt_out_and_suits():
    drawn = [draw(replace(ASKED, number=n)).record for n in range(18)]
    assert {d["family"] for d in drawn} == set(places.PLACE_OF)
    assert {d["camera"] for d in drawn} == set(Choices().cameras)
    assert all(d["light"] in LIGHTS_OF[d["family"]] for d in drawn)
    assert {d["sky"] for d in drawn} == {"none", "even", "image"}


@pytest.mark.parametrize("family", [*LIGHTS_OF])
def test_the_camera_is_in_the_open_between_the_walls(family):
    choices = Choices(families=(family,), things=(1, 1), speed=(3, 3))
    for number in range(3):
        drawn = draw(replace(ASKED, number=number, frames=40, choices=choices))
        at = drawn.scene.camera.world_from_camera_at
        eyes = np.array([at(frame)[:3, 3] for frame in range(0, 40, 3)])
        tops = [s.world_from_object_at(0)[1, 3] for s in drawn.scene.shapes if s.name == "ceiling"]
        assert (eyes[:, 1] > 0.2).all()
        assert (eyes[:, 1] < (tops or [4.0])[0] - 0.2).all()
        assert (np.hypot(eyes[:, 0], eyes[:, 2] + 0.2) > 2.6).all()
        if family != "ground":
            assert (eyes[:, 2] < places.FRONT).all()
            assert (abs(eyes[:, 0]) < 3.3).all()


def test_each_thing_of_the_test_split_is_of_a_held_out_object_or_material():
    held = HeldOut(objects=("hoop", "pawn"), materials=("weave",))
    random = np.random.default_rng(1)
    pairs = {kinds_of_thing(random, Choices(), held, True) for _ in range(200)}
    assert all((kind in held.objects) or (material in held.materials) for kind, material in pairs)
    assert len({kind for kind, _ in pairs}) == len(Choices().objects)  # others too, of weave
    own = replace(Choices(), objects=("ball", "mesh"), meshes=("a.obj", "b.ply"))
    of_meshes = HeldOut(meshes=("b.ply",))
    assert {kinds_of_thing(random, own, of_meshes, True)[0] for _ in range(9)} == {"b.ply"}
    assert of_meshes.left(own).meshes == ("a.obj",)
    assert HeldOut(objects=("mesh",)).left(own).meshes == ()
    left = held.left(Choices())
    assert not {*left.objects} & {*held.objects}
    assert not {*left.materials} & {*held.materials}


def test_glass_is_of_closed_things_and_mirrors_are_where_lamps_are_found():
    random = np.random.default_rng(1)
    sharp = [kinds_of_thing(random, Choices(), None, True) for _ in range(300)]
    assert {kind for kind, material in sharp if material == "glass"} <= {
        "ball", "egg", "ring", "hoop", "vase"}
    assert any(material == "mirror" for _, material in sharp)
    soft = [kinds_of_thing(random, Choices(), None, False) for _ in range(300)]
    assert not {"glass", "mirror"} & {material for _, material in soft}


@pytest.mark.parametrize(("values", "words"), [
    ({"lights": ("night",), "families": ("room",)}, "none of the lights suits the family 'room'"),
    ({"things": (5, 3)}, r"things is \[5, 3\]: use two numbers"),
    ({"objects": ()}, "objects is an empty list"),
    ({"materials": ("glass", "mirror")}, "only glass and mirror"),
    ({"speed": (float("nan"), 1)}, r"speed is \[nan, 1\]")])
def test_what_cannot_be_drawn_from_is_refused_in_a_sentence(values, words):
    with pytest.raises(SceneError, match=words):
        Choices(**values)


def test_nothing_left_to_train_on_is_refused():
    with pytest.raises(SceneError, match="families is an empty list"):
        HeldOut(families=("room",)).left(Choices(families=("room",)))
