"""Methods, metrics and scenes of installed packages: used, listed, and broken."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from onespp.denoise.catalog import build, changed, name_of, source_of
from onespp.denoise.metrics.own_metric import own_metrics
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from onespp.scenes import catalog
from onespp.scenes.description import SceneError
from tests.support.report_sequence import make_report_sequence

CODE = '''
from dataclasses import dataclass
from onespp.scenes.box import box as their_box

@dataclass(frozen=True)
class Gain:
    """Multiplies the colour."""

    gain: float = 0.5
    needs = ("color",)

    def __call__(self, frame, state):
        if self.gain == 7:
            raise RuntimeError("seven")
        return frame["color"] * self.gain, state

def mean_error(image, reference):
    """Of display values."""
    return float(abs(image - reference).mean())

class NoMethod:
    pass
'''
POINTS = """[onespp.methods]
gain = their_package.code:Gain
broken-one = their_package.missing:Gain
no-method = their_package.code:NoMethod
svgf = their_package.code:Gain
[onespp.metrics]
mean-error = their_package.code:mean_error
[onespp.scenes]
their-box = their_package.code:their_box
no-scene = their_package.code:mean_error
"""


def install(folder: Path, name: str, points: str) -> None:
    info = folder / f"{name.replace('-', '_')}-1.2.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text(points)


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder on the search path, with a package installed in it."""
    folder = tmp_path / "site"
    install(folder, "their-package", POINTS)
    (folder / "their_package").mkdir()
    (folder / "their_package/__init__.py").write_text("")
    (folder / "their_package/code.py").write_text(CODE)
    monkeypatch.syspath_prepend(str(folder))
    importlib.invalidate_caches()
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "their_package"]:
        del sys.modules[name]


def test_a_method_is_used_by_its_name_and_runs_say_the_package(site, tmp_path, call):
    sequence = make_report_sequence(tmp_path / "made", frames=2)
    assert call("denoise", sequence.folder, "--method", "gain", "--set", "gain=0.25")[0] == 0
    run = sequence.read_run("gain")
    assert (run.method, run.changed, run.versions["their-package"]) == (
        "gain", {"gain": 0.25}, "1.2")
    np.testing.assert_allclose(sequence.read_result("gain", 0),
                               0.25 * sequence.read_frame(0)["color"], rtol=1e-6)
    assert "gain" in score(sequence).methods
    assert (name_of(build("gain")), changed(build("gain")), source_of(build("gain"))) == (
        "gain", {}, "")


def test_a_metric_and_a_scene_are_used_by_their_names(site, tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=2)
    scores = score(sequence, metrics=own_metrics(["mean-error"]))
    assert 0 < scores.methods["fine"]["mean_error"] < scores.methods["rough"]["mean_error"]
    assert catalog.load("their-box").name == "box"


@pytest.mark.parametrize(("act", "words"), [
    (lambda: build("broken-one"), "the method 'broken-one' of the package their-package: "
                                  "ModuleNotFoundError: No module named 'their_package.missing'"),
    (lambda: build("no-method"), "NoMethod cannot be called"),
    (lambda: catalog.load("no-scene"), "the scene 'no-scene' of the package their-package"),
    (lambda: catalog.load("their-bix"), "did you mean 'their-box'?"),
    (lambda: build("nonsense"), "optix-temporal, broken-one, gain, no-method, or a file"),
    (lambda: own_metrics(["nonsense"]), "use mean-error, a file of your own"),
])
def test_what_is_broken_is_one_sentence_with_the_package(site, act, words):
    with pytest.raises((InputError, SceneError)) as caught:
        act()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_it_raises_later_names_its_line(site, tmp_path, call):
    folder = make_report_sequence(tmp_path / "made", frames=2).folder
    code, _, error = call("denoise", folder, "--method", "gain", "--set", "gain=7")
    assert code == 2
    assert f"their-package, {site / 'their_package/code.py'}, line 14: RuntimeError: seven" in error


def test_lists_show_what_is_there_and_what_is_broken(site, call):
    code, text, _ = call("denoise", "--list")
    assert code == 0
    assert "gain: Multiplies the colour. Of the package their-package 1.2.\n    gain=0.5\n" in text
    assert "broken-one: not usable, the method 'broken-one' of the package their-package" in text
    assert "svgf of the package their-package 1.2 is hidden by ours" in text
    code, text, _ = call("scenes")
    assert code == 0
    assert "their-box: " in text
    assert "no-scene: not usable, the scene 'no-scene' of the package their-package" in text


def test_ours_go_before_theirs(site):
    assert type(build("svgf")).__name__ == "Svgf"


def test_a_name_that_two_packages_offer_is_refused(site):
    install(site, "others", "[onespp.methods]\ngain = their_package.code:Gain\n")
    with pytest.raises(InputError, match="by several packages, others and their-package: remove"):
        build("gain")


def test_nothing_is_looked_up_for_names_of_ours(site):
    """In a process of its own: other tests load the library that looks entry points up."""
    program = ("import sys, importlib.metadata as m\n"
               "def no(**_): raise SystemExit('looked up')\n"
               "m.entry_points = no\n"
               "from onespp.denoise.catalog import build\n"
               "from onespp.scenes import catalog\n"
               "build('svgf'), catalog.load('box')")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          timeout=100, check=False)
    assert done.returncode == 0, done.stderr
