"""Plans of data sets: the ready ones, changes to them, splits, and what is refused."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path

import pytest

from onespp.datasets.plan import PRESETS, changed_plan, read_plan, value_of
from onespp.render.errors import InputError
from onespp.scenes.drawn.choices import Choices
from onespp.scenes.drawn.draw import draw
from onespp.scenes.fingerprint import fingerprint


@pytest.mark.parametrize("name", PRESETS)
def test_the_ready_plans_draw_scenes_and_hold_out_what_they_say(name):
    plan = read_plan(name, {"frames": 3})
    assert plan.name == name
    test = next(n for n in range(40) if plan.split_of(n) == "test")
    held = plan.held_out
    for number in (0, test):
        record = draw(plan.request(number)).record
        out = [t["object"] in held.objects or t["material"] in held.materials
               for t in record["things"]]
        assert out
        assert all(out) if number == test else not any(out)
        if held.families:
            assert (record["family"] in held.families) == (number == test)


def test_splits_are_spread_evenly_and_begin_with_what_is_to_train_on():
    plan = read_plan("rooms", {"split.test": 0.2, "split.validation": 0.1})
    assert plan.split_of(0) == "train"
    for n in (20, 100, 1000):
        counts = Counter(map(plan.split_of, range(n)))
        assert abs(counts["test"] - 0.2 * n) <= 2
        assert abs(counts["validation"] - 0.1 * n) <= 2


def test_a_sequence_does_not_depend_on_how_many_there_are():
    few, many = (read_plan("rooms", {"sequences": n, "frames": 2}) for n in (1, 900))
    assert few.key == many.key
    assert fingerprint(draw(few.request(0)).scene) == fingerprint(draw(many.request(0)).scene)
    assert changed_plan(few, {"frames": 3}).key != few.key
    assert len({few.noise_seed(n, k) for n in range(9) for k in range(5)}) == 45


def test_a_file_is_read_and_changed(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\nsequences = 2\nframes = 3\nheight = 8\nwidth = 9\n'
                    'reference_spp = 16\n[draw]\nthings = [2, 3]\n')
    plan = read_plan(path, {"reference_error": 0.1, "draw.speed": [1, 1], "height": 12})
    assert (plan.reference_spp, plan.reference_error) == (None, 0.1)
    assert (plan.height, plan.draw.things, plan.draw.speed) == (12, (2, 3), (1, 1))
    assert value_of("draw.lights=['sun']") == ("draw.lights", ["sun"])


def test_the_plan_of_the_documentation_can_be_used(tmp_path):
    page = (Path(__file__).parents[2] / "docs/datasets.md").read_text("utf-8")
    text = page.split("```toml\n")[1].split("```")[0]
    (tmp_path / "mine.toml").write_text(text)
    plan = read_plan(tmp_path / "mine.toml")
    assert plan.held_out.families == ("columns",)
    shown = dataclasses.asdict(plan.draw) | {"things": None, "speed": None, "exposure": None}
    assert shown == dataclasses.asdict(Choices()) | {"things": None, "speed": None,
                                                     "exposure": None}


@pytest.mark.parametrize(("text", "words"), [
    ('name = "a"', "lacks the key 'sequences': correct it"),
    ("name = ", "is not a TOML file"),
    ("[draw]\nthing = [1, 2]", "unknown key 'draw.thing'"),
    ("colour = 1", "unknown key 'colour'"),
    ("draw = 3", "invalid 'draw'"),
    ("[draw]\nobjects = ['teapot']", "invalid 'draw.objects"),
    ("[draw]\nlights = ['night']", "none of the lights suits"),
    ("[split]\ntest = 0.6\nvalidation = 0.6", "are more than 1"),
    ("frames = 0", "invalid 'frames'"),
    ("channels = 'colour'", "--channels names colour"),
    ("reference_spp = 16\nreference_error = 0.1", "both say"),
    ("[held_out]\nmaterials = ['glass']", "only glass")])
def test_what_cannot_be_used_is_refused_in_a_sentence(tmp_path, text, words):
    path = tmp_path / "mine.toml"
    whole = "name = 'a'\nsequences = 1\nframes = 1\nheight = 8\nwidth = 8\n"
    keys = [line.split(" =")[0] for line in text.splitlines()]
    path.write_text(text if words.startswith(("lacks", "is not")) else "".join(
        line + "\n" for line in whole.splitlines() if line.split(" =")[0] not in keys) + text)
    with pytest.raises(InputError, match=words):
        read_plan(path)


@pytest.mark.parametrize(("plan", "words"), [
    ("room", "did you mean 'rooms'"), ("no.toml", "does not exist"), ("x/y", "unknown plan")])
def test_a_plan_that_is_not_there_is_told(plan, words):
    with pytest.raises(InputError, match=words):
        read_plan(plan)
    with pytest.raises(InputError, match="use KEY=VALUE"):
        value_of("sequences")
