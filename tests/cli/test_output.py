"""Standard streams that are closed, full or no longer read: the job is done all the same."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from onespp.render.cli import terminal
from tests.support.report_sequence import make_report_sequence

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a shell of POSIX closes streams")


def shell(words: str, redirection: str) -> subprocess.CompletedProcess:
    line = f"set -o pipefail; {sys.executable} -m onespp {words} {redirection}"
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_report_sequence(tmp_path_factory.mktemp("streams"), 2).folder


SCORE, COMPARE = "score {} --no-pictures", "compare {0}/{1} {0}/{1}"
FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
SLOW = pytest.mark.slow


@pytest.mark.parametrize(("words", "redirection"), [
    (SCORE, ">&-"), (SCORE, "2>&-"), (SCORE, "<&- >&- 2>&-"), (SCORE, "2>&1 | true"),
    (COMPARE, "2>&1 | true"), pytest.param(SCORE, "2>/dev/full", marks=FULL),
    *(pytest.param(SCORE, where, marks=SLOW) for where in (">&- 2>&-", "| true")),
    *(pytest.param(COMPARE, where, marks=SLOW) for where in (
        ">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-", "| true")),
    pytest.param(COMPARE, "2>/dev/full", marks=[FULL, SLOW])])
def test_a_closed_stream_ends_no_job(folder, call, words, redirection):
    scores = folder / "scores.json"
    scores.unlink(missing_ok=True)
    if words.startswith("compare"):
        assert call("score", folder, "--no-pictures")[0] == 0
    done = shell(words.format(folder, scores.name), redirection)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert scores.exists()


def test_a_closed_stream_does_not_end_a_job_halfway(tmp_path):
    """`run` prints between its parts."""
    done = shell(f"run box --frames 0:1 --size 16x16 --reference-spp 4 --method atrous --out "
                 f"{tmp_path / 'a'}", "2>&1 | true")
    assert done.returncode == 0
    assert (tmp_path / "a/scores.json").exists()


@pytest.mark.parametrize("redirection", [
    "2>&-", "2>&1 | true", *(pytest.param(where, marks=SLOW) for where in (">&-", "| true"))])
def test_bad_input_still_says_so_by_its_exit_code(redirection, tmp_path):
    done = shell(f"score {tmp_path / 'none'}", redirection)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_output_that_finds_no_room_is_an_error(folder):
    done = shell("denoise --list", ">/dev/full")
    assert done.returncode == 2
    assert done.stderr.startswith("onespp: the disk is full")


def test_the_streams_are_given_back(call):
    before = sys.stdout, sys.stderr
    assert call("denoise", "--list")[0] == 0
    assert (sys.stdout, sys.stderr) == before
    assert not isinstance(sys.stdout, terminal._Output)


def test_a_name_that_the_locale_cannot_write_is_one_sentence(tmp_path):
    environment = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    scene = tmp_path / "scene.py"
    scene.write_text(
        "from onespp.scenes.description import *\nfrom onespp.scenes.materials import diffuse\n"
        "SCENE = Scene('W\\u00fcrfel', '', (Shape('s', Sphere(), diffuse((1, 1, 1)), "
        "emission=1),), Camera([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]]), "
        "1, 4, 4)")
    done = subprocess.run([sys.executable, "-m", "onespp", "render", str(scene)], cwd=tmp_path,
                          env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False), done.stderr
    assert "locale (ascii)" in done.stderr
