"""The suite of targets: leads over the best peer, verdicts, and pixel classes pooled over cases."""

from __future__ import annotations

import math
import shutil

import pytest
from click.testing import CliRunner

from onespp.cli.lead import lead as lead_command
from onespp.denoise.peers import oidn
from onespp.denoise.score.method_score import ClassScore
from onespp.denoise.score.scorecard import Scores
from onespp.denoise.score.sequence import score
from onespp.denoise.studies.lead import OIDN_FORMS
from onespp.denoise.studies.suite import Group, class_leads, groups, lead, markdown
from onespp.render.errors import InputError
from tests.support.report_sequence import make_report_sequence


@pytest.fixture(scope="module")
def scores(tmp_path_factory) -> Scores:
    """Scores in which the method is `fine`; `temporal-oidn` is fine too, other forms are rough."""
    made = score(make_report_sequence(tmp_path_factory.mktemp("suite") / "made"))
    fine, rough = (made.methods[name] for name in ("fine", "rough"))
    forms = dict.fromkeys(OIDN_FORMS, rough) | {"temporal-oidn": fine}
    return made.model_copy(update={"methods": {"input": rough, "onespp": fine, **forms}})


def with_class(scores: Scores, psnr: dict[str, float], pixels: float,
               size: tuple[int, int]) -> Scores:
    """Scores in which each method has this PSNR on a share of moving pixels."""
    methods = {name: m.model_copy(update={"by_cause": {"moving": ClassScore(
        pixels=pixels, mse_share=1.0, psnr_srgb=psnr.get(name, 10.0))}})
        for name, m in scores.methods.items()}
    return scores.model_copy(update={"methods": methods, "size": size})


def test_a_lead_is_over_the_peer_with_the_highest_psnr(scores):
    assert lead("made", scores, "onespp", OIDN_FORMS).peer_name == "temporal-oidn"
    over_rough = lead("made", scores, "onespp", ("oidn-high",))
    fine, rough = scores.methods["onespp"], scores.methods["oidn-high"]
    assert over_rough.ahead == pytest.approx(fine["psnr_srgb"] - rough["psnr_srgb"])
    assert over_rough.flicker == pytest.approx(fine["flicker"] / rough["flicker"])
    with pytest.raises(InputError, match="scores of made lack 'magic'"):
        lead("made", scores, "onespp", ("magic",))


def test_targets_are_held_or_missed_by_their_own_numbers(scores):
    ahead = lead("made", scores, "onespp", ("oidn-high", "temporal-oidn")).ahead
    assert ahead == 0
    cases = {"a": scores, "b": scores}
    for mean, least, flicker, verdicts in ((0.0, 0.0, 1.0, 0), (0.1, 0.0, 1.0, 1),
                                           (0.0, 0.1, 1.0, 1), (0.1, 0.1, 0.9, 3)):
        group = Group("all", ("a", "b"), plain=True, mean=mean, least=least, flicker=flicker)
        assert markdown("onespp", {group: cases}).count("missed") == verdicts
    assert "| a, plain |" in markdown("onespp", {Group("all", ("a",), plain=True): cases})


def test_classes_pool_squared_errors_by_pixels_over_cases(scores):
    """Half of 100 pixels at 20 and 40 dB, all of 300 at 30 and 26: by hand."""
    frames = len(scores.frames) - 1
    first = with_class(scores, {"onespp": 40.0, "oidn-high": 20.0}, 0.5, (10, 10))
    second = with_class(scores, {"onespp": 26.0, "oidn-high": 30.0}, 1.0, (10, 30))
    ours, other = 50 * 1e-4 + 300 * 10**-2.6, 50 * 1e-2 + 300 * 1e-3
    assert frames > 1
    ahead, best, share = class_leads([first, second], "onespp", ("oidn-high", "oidn-split"))[
        "moving"]
    assert best == "oidn-high"
    assert ahead == pytest.approx(10 * math.log10(other / ours))
    assert share == pytest.approx(350 / 400)


def test_plain_frames_are_judged_by_their_own_peers_and_no_class(scores):
    moving = with_class(scores, {}, 0.5, (10, 10))
    plain = Group("plain frames", ("made",), plain=True, least=1.0)
    assert plain.peers == ("oidn-high", "temporal-oidn")
    assert "moving" not in markdown("onespp", {plain: {"made": moving}})
    assert "moving" in markdown("onespp", {Group("kept", ("made",)): {"made": moving}})


def test_the_suite_asks_for_what_it_says():
    kept, hard = [f"generated/{i}" for i in range(12, 24)], ["hard/cut"]
    by_title = {g.title: g for g in groups(kept, hard)}
    assert by_title["kept scenes"].scenes == tuple(kept)
    assert by_title["plain frames"].scenes == ("box", "room", *kept[:6])
    assert by_title["hard scenes"].least == 0


@pytest.mark.skipif(not oidn.AVAILABLE, reason="mitsuba-oidn is not installed")
def test_one_command_renders_denoises_scores_and_goes_on_where_it_stopped(tmp_path):
    arguments = ["--suite", "--scenes", "^box$", "--out", str(tmp_path), "--size", "24x20",
                 "--frames", "0:3", "--reference-spp", "4"]
    done = CliRunner().invoke(lead_command, arguments, catch_exceptions=False)
    assert "| box |" in done.output
    assert "| box, plain |" in done.output
    assert "box: least lead" in done.output
    kept = tmp_path / "box" / "denoised" / "oidn-split" / "0001.exr"
    before = kept.stat().st_mtime_ns
    (tmp_path / "plain" / "box" / "frames" / "0001.exr").unlink()
    shutil.rmtree(tmp_path / "box" / "denoised" / "oidn-high")
    again = CliRunner().invoke(lead_command, arguments, catch_exceptions=False)
    table, same = ([line for line in result.stdout.splitlines() if line.startswith("|")]
                   for result in (done, again))
    assert same == table
    assert kept.stat().st_mtime_ns == before


@pytest.mark.parametrize(("arguments", "words"), [
    (["--suite", "data"], "takes no folders"), (["--suite", "--scenes", "("], "no regular expr"),
    (["--suite", "--scenes", "sofa"], "has 'sofa' in its name")])
def test_what_cannot_be_asked_is_refused_in_a_sentence(arguments, words):
    result = CliRunner().invoke(lead_command, arguments)
    assert isinstance(result.exception, InputError)
    assert words in str(result.exception)
