"""What results are called, and that tables say what made them."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from onespp.denoise.catalog import METHODS, PEERS, build, changed, name_of
from onespp.denoise.cli.denoise import denoise_in
from onespp.denoise.methods.atrous import Atrous
from onespp.denoise.report.page_data import table_data
from onespp.denoise.report.provenance import provenance
from onespp.denoise.report.terminal import print_scores
from onespp.denoise.run.external import denoise_externally
from onespp.denoise.run.sequence import denoise_sequence
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.render.files.manifest import Run, check_result_name
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.convert import import_result
from tests.support.made_sequence import make_sequence
from tests.support.report_sequence import make_report_sequence


def table(sequence: FrameSequence) -> str:
    text = io.StringIO()
    print_scores(score(sequence), Console(width=200, file=text))
    return text.getvalue()


@pytest.fixture
def sequence(tmp_path):
    return make_report_sequence(tmp_path / "made", frames=2)


@pytest.mark.parametrize("name", ["input", "Input", "INPUT", "reference", "all", "oidn", "",
                                  "../up", "a/b", "a\\b", ".hidden", "..", "~", " ", "FINE"])
def test_a_name_that_tables_or_file_systems_confuse_is_refused(sequence, name):
    before = sorted(sequence.folder.rglob("*"))
    for act in (lambda: denoise_in(sequence.folder, ("atrous",), name=name),
                lambda: denoise_sequence(sequence, Atrous(), name),
                lambda: denoise_externally(sequence, "true {input} {output}", name),
                lambda: import_result(sequence, sequence.folder, name)):
        with pytest.raises(InputError) as error:
            act()
        assert "\n" not in str(error.value)
        assert "name" in str(error.value)
    assert [p for p in sorted(sequence.folder.rglob("*")) if p not in before] == []


def test_results_that_an_older_version_called_input_are_not_averaged_with_the_input(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    (sequence.folder / "denoised/fine").rename(sequence.folder / "denoised/input")
    with pytest.raises(InputError, match="tables call the noisy frames so"):
        score(sequence)


@pytest.mark.parametrize("name", ["onespp", "OneSPP", "svgf", "oidn-high", "onespp+outliers"])
def test_a_method_does_not_get_the_name_of_another(sequence, name):
    with pytest.raises(InputError, match="is the name of a method"):
        denoise_in(sequence.folder, ("atrous",), name=name)
    with pytest.raises(InputError, match="is the name of a method"):
        denoise_externally(sequence, "true {input} {output}", name)
    assert sequence.methods() == ["fine", "rough"]


def test_a_run_says_what_ran_and_the_table_too(sequence):
    denoise_in(sequence.folder, ("atrous",), ("levels=2",), "mine")
    denoise_in(sequence.folder, ("atrous",))
    denoise_in(sequence.folder, ("atrous",), outliers=2.0)
    run = sequence.read_run("mine")
    assert run.method == "atrous"
    assert run.parameters["levels"] == 2
    assert run.changed == {"levels": 2}
    assert sequence.read_run("atrous").changed == {}
    assert sequence.read_run("atrous+outliers").method == "atrous+outliers"
    assert sequence.read_run("atrous+outliers").changed == {"outlier_width": 2.0}
    text = table(sequence)
    assert "mine (atrous)" in text
    assert "mine ran with levels=2 instead of the default." in text
    assert "atrous (" not in text.replace("mine (atrous)", "")
    scores = score(sequence)
    assert scores.methods["mine"].method == "atrous"
    made = {m["name"]: dict(m["parameters"]) for m in provenance(sequence, scores)["methods"]}
    assert made["mine"]["method"] == "atrous"
    assert "method" not in table_data(scores)[0][0][0]


def test_a_default_method_with_other_parameters_is_told_from_the_default(sequence):
    denoise_in(sequence.folder, ("atrous",), ("levels=2",))
    assert "atrous ran with levels=2 instead of the default." in table(sequence)


def test_results_under_a_foreign_name_on_disk_are_shown_as_what_they_are(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    (sequence.folder / "denoised/fine").rename(sequence.folder / "denoised/onespp")
    sequence.write_run("onespp", Run(method="external", parameters={"external": "cat"}))
    assert "onespp (external)" in table(sequence)


@pytest.mark.parametrize("name", [*METHODS, *PEERS])
def test_every_method_knows_its_name_and_that_nothing_was_changed(name):
    assert name_of(build(name)) == name
    assert changed(build(name)) == {}
    assert name_of(build(name, outliers=3.0)) == f"{name}+outliers"


def test_a_good_name_is_returned():
    assert check_result_name("mine-2.1+x", ["Other", "mine-2.1+x"]) == "mine-2.1+x"
