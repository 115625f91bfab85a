"""References of few samples beside the truth: the table, the command, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import onespp.denoise.cli.truth
from onespp.cli.group import app
from onespp.denoise.studies.truth import compare_references, markdown, off
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from tests.support.halved import halved
from tests.support.made_sequence import METHODS, make_sequence, truth


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    return [make_sequence(folder / name, methods=name == "large") for name in ("large", "small")]


def test_halves_say_what_the_truth_says_and_the_mean_does_not(folders):
    large, small = folders
    found = compare_references(halved(large, truth, 0.0),
                               [halved(small, truth, 0.03, seed) for seed in (1, 2, 3)])
    assert set(found) == set(METHODS)
    for trusts in found.values():
        true = trusts[0].plain
        assert trusts[0].halves.value == pytest.approx(true, abs=1e-3)
        for t in trusts[1:]:
            assert t.halves.value == pytest.approx(true, abs=4 * t.halves.error)
    rows = off(found)
    assert np.mean([halves for _, _, halves, _ in rows]) < 0.6 * np.mean([p for _, p, _, _ in rows])
    assert all(scaled < 3 for *_, scaled in rows)
    assert max(scaled for *_, scaled in rows) > 0.1
    table = markdown("made", found)
    assert table.count("\n") == 1 + len(METHODS)
    fine = found["fine"]
    assert f"| made, fine | {fine[0].plain:.2f} ±0.00 | {fine[1].plain:.2f} |" in table


def test_references_of_the_old_kind_have_no_halves(folders):
    found = compare_references(folders[0], [folders[1]])
    assert {t.halves for trusts in found.values() for t in trusts} == {None}
    assert " | - |" in markdown("made", found)


def test_the_command_prints_the_table(folders, monkeypatch):
    real = FrameSequence.open
    monkeypatch.setattr(onespp.denoise.cli.truth.FrameSequence, "open", lambda folder: halved(
        real(folder), truth, 0.0 if folder.name == "large" else 0.05))
    done = CliRunner().invoke(app, ["truth", *(str(s.folder) for s in folders)],
                              catch_exceptions=False)
    assert done.exit_code == 0
    assert done.output.startswith("| PSNR, dB | true (64 spp) | plain 64 spp | halves 64 spp |")
    assert "64 spp: off by " in done.output


def test_other_frames_are_refused(folders, tmp_path):
    other = make_sequence(tmp_path / "other")
    changed = FrameSequence(other.folder, other.manifest.model_copy(update={"scene": "another"}))
    with pytest.raises(InputError, match="another scene than"):
        compare_references(folders[0], [changed])
    with pytest.raises(InputError, match="has no results"):
        compare_references(folders[1], [folders[0]])
    (tmp_path / "other/reference/0002.exr").unlink()
    with pytest.raises(InputError, match="no reference of frame 2"):
        compare_references(folders[0], [other])
    assert np.isfinite(compare_references(folders[0], [folders[0]])["fine"][1].plain)
