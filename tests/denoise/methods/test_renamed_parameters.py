"""Parameters that had another name: settings and files of the last version still say the same."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import pytest

from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.methods.parameters import (
    HISTORY_RENAMED,
    INNOVATION_RENAMED,
    present_parameters,
    renamed_parameters,
    with_present_names,
)
from onespp.denoise.methods.svgf import Svgf
from onespp.denoise.run.sequence import denoise_sequence
from onespp.denoise.studies.tune import Search, starting_point
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from tests.denoise.score.test_compare import comparison, scores
from tests.support.frames import make_frame


def former(method) -> dict:
    """All parameters of a method by their former names, where they have one."""
    old = {new: name for name, new in renamed_parameters(method).items()}
    return {old.get(name, name): value for name, value in parameters(method).items()}


@pytest.mark.parametrize("name", METHODS)
def test_former_names_are_of_parameters_that_exist_and_of_none_that_does(name):
    known = parameters(METHODS[name]())
    renamed = renamed_parameters(METHODS[name]())
    assert set(renamed.values()) <= set(known)
    assert not set(renamed) & set(known)
    assert len(set(renamed.values())) == len(renamed)
    assert bool(renamed) == (name in ("svgf", "asvgf", "onespp", "onespp-taa"))


def test_a_former_name_sets_the_parameter_and_is_noted():
    notes = []
    method = build("onespp", {"follow": "0.3", "smoothing": "6", "gloss": "no"}, note=notes.append)
    changed = {k: v for k, v in parameters(method).items() if v != parameters(build("onespp"))[k]}
    assert changed == {"min_gain": 0.3, "innovation_levels": 6, "gloss": False}
    assert notes == ["follow is now min_gain; the old name goes in the next version",
                     "smoothing is now innovation_levels; the old name goes in the next version"]
    with pytest.warns(FutureWarning, match="longest is now max_history_length"):
        assert build("asvgf", {"longest": "9"}).max_history_length == 9
    with pytest.raises(InputError, match="fade and fade_frames are one parameter"):
        build("onespp", {"fade": "3", "fade_frames": "4"}, note=notes.append)
    with pytest.raises(InputError, match="fade_frames is 'x': use a number"):
        build("onespp", {"fade": "x"}, note=notes.append)


@dataclass(frozen=True)
class Part:
    width: float = 1.0
    renamed: ClassVar = MappingProxyType({"sigma": "width"})


@dataclass(frozen=True)
class Whole:
    part: Part = field(default_factory=Part)
    length: int = 2
    renamed: ClassVar = MappingProxyType({"longest": "length"})


def test_parts_have_former_names_too():
    renamed = renamed_parameters(Whole())
    assert renamed == {"longest": "length", "sigma": "width"}
    assert with_present_names({"sigma": 3, "other": 4}, renamed) == {"width": 3, "other": 4}


@pytest.mark.parametrize(("name", "table"), [
    ("onespp", INNOVATION_RENAMED), ("svgf", HISTORY_RENAMED), ("asvgf", HISTORY_RENAMED)])
def test_files_of_the_last_version_are_read_by_the_names_of_this_one(name, table):
    now = parameters(build(name))
    assert set(table) <= set(former(build(name)))
    assert present_parameters(former(build(name))) == now
    assert present_parameters(now) == now


@pytest.mark.parametrize("name", ["bilateral", "atrous", "temporal", "assignment-atrous"])
def test_parameters_of_other_methods_are_left_alone(name):
    assert present_parameters(parameters(build(name))) == parameters(build(name))


def test_results_of_the_last_version_are_gone_on_with(tmp_path, monkeypatch):
    """Not removed as those of other parameters."""
    sequence = FrameSequence.create(tmp_path / "a", Manifest(
        scene="made", frames=(0, 1), width=7, height=5, objects=("wall", "board"),
        channels=("color", "normal", "depth", "id")))
    sequence.write_frame(make_frame(5, 7))
    run = denoise_sequence(sequence, Svgf(levels=1), "svgf")
    sequence.write_run("svgf", run.model_copy(
        update={"parameters": former(Svgf(levels=1))}))
    removed = []
    monkeypatch.setattr(FrameSequence, "remove_results", lambda _, name: removed.append(name))
    denoise_sequence(sequence, Svgf(levels=1), "svgf")
    assert removed == []
    assert sequence.read_run("svgf").parameters == parameters(Svgf(levels=1))
    denoise_sequence(sequence, Svgf(levels=2), "svgf")
    assert removed == ["svgf"]


def test_scores_of_two_versions_have_the_same_parameters():
    def scored(values):
        found = scores()
        found.methods["fine"].parameters.update(values)
        return found

    method = build("onespp")
    same = comparison(scored(former(method)), scored(parameters(method))).notes
    other = comparison(scored(former(method)),
                       scored(parameters(build("onespp", {"min_gain": "0.1"})))).notes
    assert not any("other parameters" in note for note in same)
    assert "fine has other parameters in B." in other


def test_a_search_of_the_last_version_is_gone_on_with(tmp_path, monkeypatch):
    file = tmp_path / "tried.json"
    file.write_text(json.dumps({json.dumps(former(Svgf()), sort_keys=True): 31.5}))
    monkeypatch.setattr("onespp.denoise.studies.tune.mean_psnr",
                        lambda *_: pytest.fail("measured twice"))
    search = Search(build("svgf"), [], file)
    assert search.value(starting_point(build("svgf"))) == 31.5


def test_the_command_says_it_in_one_line(call, tmp_path):
    sequence = FrameSequence.create(tmp_path / "a", Manifest(
        scene="made", frames=(0,), width=7, height=5, objects=("wall", "board"),
        channels=("color", "normal", "depth", "id")))
    sequence.write_frame(make_frame(5, 7))
    code, _, error = call("denoise", tmp_path / "a", "--method", "svgf", "--set", "longest=4")
    assert code == 0
    assert error.splitlines()[0] == (
        "onespp: longest is now max_history_length; the old name goes in the next version")
    assert sequence.read_run("svgf").parameters["max_history_length"] == 4
