"""Metrics of one's own: measured, kept, compared and shown as ours are; and what goes wrong."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console

from onespp.denoise.metrics.own_metric import own_metrics
from onespp.denoise.report.page_data import best_cells, page_data, table_data
from onespp.denoise.report.terminal import print_scores
from onespp.denoise.score.compare import comparison
from onespp.denoise.score.scorecard import read_scores
from onespp.denoise.score.sequence import score
from onespp.render.errors import InputError
from tests.support.made_sequence import make_sequence

WORST = '''
import numpy as np

def worst_error(image, reference):
    """The largest difference of display values."""
    return np.abs(image - reference).max()
'''
ROW = '''
import numpy as np
from onespp.denoise.metrics.metric import Metric

def _mean(image, reference):
    return float(image.mean())

light = Metric("light", "light kept", _mean, "linear", "cd", True, ".1f", "mean radiance",
               most_frames=2)
'''


@pytest.fixture
def write(tmp_path):
    def written(text: str) -> str:
        path = tmp_path / "my_metric.py"
        path.write_text(text)
        return str(path)
    return written


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    return make_sequence(tmp_path_factory.mktemp("made") / "made")


def test_a_function_is_measured_kept_and_shown_by_every_reader(write, sequence):
    scores = score(sequence, metrics=own_metrics([write(WORST)]))
    assert scores.methods["fine"]["worst_error"] < scores.methods["rough"]["worst_error"] < 1
    again = read_scores(sequence.folder / "scores.json")
    assert again == scores
    assert "worst_error" in (sequence.folder / "scores.csv").read_text().splitlines()[0]
    text = io.StringIO()
    print_scores(again, Console(width=200, file=text))
    assert "worst error" in text.getvalue()
    columns, rows = table_data(again)
    assert ("worst error", "The largest difference of display values.") in columns
    assert [heading for heading, _ in columns].count("worst error") == 1
    index = [heading for heading, _ in columns].index("worst error")
    fine = next(texts for name, texts in rows if name == "fine")
    assert best_cells(again, columns)[index] == {fine[index]}
    page = page_data(sequence, again, ["color"], {}, {}, np.zeros(2))
    assert "worst_error" in [m["name"] for m in page["metrics"]]
    values = page["methods"][0]["perFrame"]["worst_error"]
    assert all(isinstance(value, float) for value in values)


def test_a_row_says_its_space_direction_and_frames(write, sequence):
    scores = score(sequence, metrics=own_metrics([f"{write(ROW)}:light"]))
    rows = scores.methods["input"].per_frame
    assert [row["light"] is None for row in rows] == [False, True, True, False]
    frame = sequence.read_frame(0)["color"]
    assert rows[0]["light"] == pytest.approx(frame.mean(dtype=np.float64), rel=1e-5)
    assert scores.measures["light"].text(1.23) == "1.2"
    assert scores.own_metrics["light"].higher_is_better


def test_a_class_is_built_once_and_may_hold_a_network(write, sequence):
    path = write("class Net:\n    made = 0\n    def __init__(self): Net.made += 1\n"
                 "    def __call__(self, a, b): return Net.made\n")
    scores = score(sequence, metrics=own_metrics([path]))
    assert {row["Net"] for m in scores.methods.values() for row in m.per_frame} == {1}


def test_compare_takes_what_both_scores_have(write, sequence, tmp_path, call):
    better = score(sequence, metrics=own_metrics([write(WORST)]))
    (tmp_path / "a.json").write_text(better.json_text())
    data = json.loads(better.json_text())
    for row in data["methods"]["fine"]["per_frame"]:
        row["worst_error"] *= 1.5
    (tmp_path / "b.json").write_text(json.dumps(data))
    code, text, _ = call("compare", tmp_path / "a.json", tmp_path / "b.json")
    assert (code, "worst error" in text, "Worse past" in text) == (1, True, True)
    code, text, _ = call("compare", tmp_path / "a.json", tmp_path / "b.json", "--threshold",
                         "worst_error=60%")
    assert (code, "worst error" in text) == (0, True)
    without = score(sequence)
    assert "worst_error" not in {c.measure for c in comparison(better, without).changes}
    other = score(sequence, metrics=own_metrics([write(WORST + "\n")]))
    assert "The metric worst_error is not the same in A and B." in comparison(better, other).notes


def test_the_command_measures_it_and_what_it_prints_is_not_in_the_figures(write, sequence, call):
    path = write(WORST.replace("    return", "    print('seen')\n    return"))
    code, out, error = call("score", sequence.folder, "--metric", path, "--json", "-",
                            "--no-pictures")
    assert code == 0
    assert json.loads(out)["methods"]["fine"]["worst_error"] > 0
    assert "seen" in error


HEAD = "from onespp.denoise.metrics.metric import Metric\ndef _f(a, b): return 0.5\n"


@pytest.mark.parametrize(("text", "words"), [
    ("", "there is no metric here: add a function of (image, reference)"),
    ("def f(a, b): return 1 +", "line 1: SyntaxError"),
    ("import no_such_package", "line 1: ModuleNotFoundError"),
    ("def f(a, b): return 1\ndef g(a, b): return 2", "as my_metric.py:f (or g)"),
    ("def f(a): return 1", "line 1: 'f' does not take (image, reference)"),
    ("def f(a, b):\n    pass", None),
    ("def f(a, b):\n    return a", "line 1: f returned an array of shape (21, 33, 3): return"),
    ("def f(a, b):\n    return 'x'", "line 1: f returned a str"),
    ("def f(a, b):\n    return True", "returned a bool"),
    ("def f(a, b):\n    return float('nan')", "f returned nan: return a finite number"),
    ("def f(a, b):\n    return 1 / 0", "line 2: ZeroDivisionError"),
    ("def f(a, b):\n    a[0] = 1\n    return 0.5", "line 2: ValueError: assignment destination is"),
    ("def flip(a, b): return 1", "'flip' is a metric of ours: use another name"),
    ("def ms(a, b): return 1", "has something else called 'ms'"),
    ("def psnr_srgb_error(a, b): return 1", "has something else called 'psnr_srgb_error'"),
    (HEAD + "m = Metric('m', 'PSNR', _f, 'srgb', '', True, '.2f', '')", "one that no metric has"),
    (HEAD + "m = Metric('m', 'm', _f, 'step', '', True, '.2f', '')", "use srgb or linear"),
    (HEAD + "m = Metric('m', 'm', _f, 'srgb', '', True, '%s', '')", "one such as .4f or .1%"),
    (HEAD + "m = Metric('m', 'a\\nb', _f, 'srgb', '', True, '.2f', '')", "use one line of text"),
    (HEAD + "m = Metric('m n', 'm', _f, 'srgb', '', True, '.2f', '')", "use letters, digits"),
    (HEAD + "m = Metric('m', 'm', _f, 'srgb', '', True, '.2f', '', most_frames=0)", "above 0"),
])
def test_what_is_wrong_is_one_sentence_with_its_line(write, sequence, call, text, words):
    code, _, error = call("score", sequence.folder, "--metric", write(text), "--no-pictures")
    if words is None:  # None is "does not apply"
        assert code == 0
        assert score(sequence, metrics=own_metrics([write(text)])).methods["fine"]["f"] is None
        return
    assert (code, words in error) == (2, True), error
    assert [line for line in error.splitlines() if line.startswith("onespp: ")][-1:] == (
        error.splitlines()[-1:])


@pytest.mark.parametrize(("names", "words"), [
    (["nothing.py"], "there is no metric file 'nothing.py'"), (["psnr_srgb"], "always measured"),
    (["nonsense"], "unknown metric 'nonsense': use a file of your own"),
    (["{}:g"], "there is no 'g' here: it has worst_error"), (["{}:np"], "use a function"),
    (["{}", "{}:worst_error"], "two metrics are called 'worst_error'")])
def test_a_name_that_is_no_metric_is_one_sentence(write, names, words):
    path = write(WORST)
    with pytest.raises(InputError) as caught:
        own_metrics([name.format(path) for name in names])
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_damaged_format_in_a_file_is_refused(write, sequence):
    text = score(sequence, metrics=own_metrics([write(WORST)])).json_text()
    path = sequence.folder / "damaged.json"
    path.write_text(text.replace('"format": ".4f"', '"format": "{}"'))
    with pytest.raises(InputError, match="format"):
        read_scores(path)
