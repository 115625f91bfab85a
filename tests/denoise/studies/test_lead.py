"""The table of how far a method is ahead of a peer."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from onespp.cli.lead import lead
from onespp.denoise.score.sequence import score
from onespp.denoise.studies.lead import BEST, CAUSES, markdown, peer_in
from onespp.render.errors import InputError
from tests.support.report_sequence import make_report_sequence


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    sequence = make_report_sequence(tmp_path_factory.mktemp("lead") / "made")
    return score(sequence), sequence.folder


def test_the_lead_is_the_difference_of_the_scores(scores):
    found, _ = scores
    text = markdown("fine", "rough", {"made": (found, found)})
    fine, rough = (found.methods[name] for name in ("fine", "rough"))
    ahead = fine["psnr_srgb"] - rough["psnr_srgb"]
    assert ahead > 1
    assert f"| mean PSNR over the peer on plain input, dB | {ahead:+.2f} |" in text
    worst = min(a["psnr_srgb"] - b["psnr_srgb"]
                for a, b in zip(fine.per_frame[1:], rough.per_frame[1:]))
    assert f"| the same, worst frame after the first, dB | {worst:+.2f} |" in text
    assert f"| flicker, share of the peer's | {fine['flicker'] / rough['flicker']:.2f} |" in text
    assert all(cause in text for cause in CAUSES)


def test_a_method_is_not_ahead_of_itself(scores):
    text = markdown("fine", "fine", {"made": (scores[0], scores[0])})
    energy = scores[0].methods["fine"]["energy_error"]
    assert text.splitlines() == [
        "| `fine` and `fine` | made |",
        "| --- | --- |",
        "| mean PSNR over the peer on plain input, dB | +0.00 |",
        "| mean PSNR over the peer on our input, dB | +0.00 |",
        "| the same, worst frame after the first, dB | +0.00 |",
        "| the same, first frame, dB | +0.00 |",
        "| FLIP, share of the peer's | 1.00 |",
        "| flicker, share of the peer's | 1.00 |",
        "| PSNR over the peer on glossy pixels, dB | - |",
        "| PSNR over the peer on disoccluded pixels, dB | +0.00 |",
        "| PSNR over the peer on light pixels, dB | - |",
        f"| energy off by | {energy:.2%} |"]


def test_what_is_missing_is_named(scores):
    found, folder = scores
    with pytest.raises(InputError, match="lack 'magic'"):
        markdown("magic", "rough", {"made": (found, found)})
    with pytest.raises(InputError, match="lack 'oidn-high' or 'oidn-split'"):
        markdown("fine", "best", {"made": (found, found)})
    result = CliRunner().invoke(lead, [str(folder)])
    assert isinstance(result.exception, InputError)
    result = CliRunner().invoke(lead, [str(folder), str(folder), "--method", "fine", "--peer",
                                       "rough"])
    assert result.exit_code == 0
    assert "made: 4 frames" in result.output
    result = CliRunner().invoke(lead, [])
    assert "give some, or --suite" in str(result.exception)


def test_best_is_the_form_that_is_best_on_each_input(scores):
    found, _ = scores
    fine, rough = (found.methods[name] for name in ("fine", "rough"))
    ours = found.model_copy(update={"methods": {
        "onespp": fine, "oidn-high": rough, "temporal-oidn-split": fine, "input": rough}})
    plain = found.model_copy(update={"methods": {
        "oidn-high": fine, "temporal-oidn": rough, "input": rough}})
    assert peer_in(ours, BEST, "x") == "temporal-oidn-split"
    assert peer_in(plain, BEST, "x") == "oidn-high"
    assert peer_in(plain, "temporal-oidn", "x") == "temporal-oidn"
    text = markdown("onespp", BEST, {"made": (plain, ours)})
    assert "`onespp` and the best form of OIDN" in text
    assert text.count("dB | +0.00 |") >= 3
