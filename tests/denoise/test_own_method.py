"""Methods of one's own: files that work, everywhere a method is named, and files that do not."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from onespp.denoise.catalog import build, changed, name_of, parameters, source_of
from onespp.denoise.own_method import OwnMethod, result_name
from onespp.denoise.run.sequence import denoise_sequence
from onespp.denoise.score.sequence import score
from onespp.denoise.studies.hard_scenes import judge
from onespp.render.errors import InputError
from tests.support.frames import make_frame
from tests.support.report_sequence import make_report_sequence

HALF = '''
from dataclasses import dataclass
import numpy as np

@dataclass(frozen=True)
class Darker:
    """Multiplies the colour.

    More text.
    """

    gain: float = 0.5
    on: bool = True
    needs = ("color",)

    def __post_init__(self):
        if self.gain < 0:
            raise ValueError(f"gain is {self.gain}: use 0 or more")

    def init(self, height, width):
        return {"frames": 0}

    def __call__(self, frame, state):
        state["frames"] += 1
        return frame["color"] * (self.gain if self.on else 1), state
'''
BARE = "class Bare:\n    def __call__(self, frame, state):\n        "


@pytest.fixture
def write(tmp_path):
    """Writes my_filter.py (or another); the path as text."""
    def written(text: str | bytes, name: str = "my_filter.py") -> str:
        path = tmp_path / "own" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return str(path)
    return written


@pytest.fixture
def sequence(tmp_path):
    return make_report_sequence(tmp_path / "made", frames=2)


def once(method) -> np.ndarray:
    frame = make_frame(6, 8)
    image, _ = method(frame, None)  # None begins
    np.testing.assert_array_equal(image, method(frame, method.init(6, 8))[0])
    return image


def test_a_file_is_a_method_with_its_parameters(write):
    method = build(write(HALF), {"gain": "0.25", "on": "yes"})
    assert isinstance(method, OwnMethod)
    assert name_of(method) == "my_filter.py"
    assert parameters(method) == {"gain": 0.25, "on": True}
    assert changed(method) == {"gain": 0.25}
    image = once(method)
    np.testing.assert_array_equal(image, 0.25 * make_frame(6, 8)["color"])
    assert (image.dtype, image.flags.writeable) == (np.float32, True)
    assert name_of(build(write(HALF), outliers=2.0)) == "my_filter.py+outliers"


@pytest.mark.parametrize(("name", "gain"), [("Darker", 0.5), ("dark", 0.1), ("plain", 2.0)])
def test_a_name_behind_the_file_is_a_class_an_object_or_a_function(write, name, gain):
    path = write(HALF + "class Other(Darker): pass\ndark = Darker(gain=0.1)\n"
                 "def plain(frame, state):\n    return 2 * frame['color'], state\n")
    method = build(f"{path}:{name}")
    assert name_of(method) == f"my_filter.py:{name}"
    np.testing.assert_allclose(once(method), gain * make_frame(6, 8)["color"])


def test_without_needs_and_init_it_is_given_all_channels_and_no_state(write, sequence):
    path = write(BARE + "assert state is None\n        return frame['normal'] * 0 + "
                 "len(frame.images), state\n")
    denoise_sequence(sequence, build(path), "bare")
    assert sequence.read_result("bare", 0).max() == len(sequence.channels)


def test_neighbours_can_be_imported_in_every_call(write):
    write("def gain():\n    from deeper import GAIN\n    return GAIN", "parts.py")
    write("GAIN = 3", "deeper.py")
    method = build(write(BARE + "from parts import gain\n"
                         "        return gain() * frame['color'], 0"))
    for _ in range(2):
        np.testing.assert_allclose(once(method), 3 * make_frame(6, 8)["color"])


def test_neighbours_are_the_same_modules_from_call_to_call(write):
    write("seen = []", "parts.py")
    method = build(write(BARE + "import parts; parts.seen.append(1)\n"
                         "        return len(parts.seen) * frame['color'], 0"))
    frame = make_frame(6, 8)
    method(frame, None)
    np.testing.assert_allclose(method(frame, None)[0], 2 * frame["color"])
    assert "parts" not in sys.modules


def test_a_library_that_lies_deeper_in_the_folder_is_no_neighbour(write, tmp_path, monkeypatch):
    """As Python's own does where it is in the home folder, and the file too."""
    write("", "lib/some_library.py")
    monkeypatch.syspath_prepend(str(tmp_path / "own/lib"))
    build(write("import some_library\n" + HALF))
    assert sys.modules.pop("some_library").__name__ == "some_library"


def test_a_network_is_no_method_though_it_can_be_called(write):
    write("class Module:\n    def __call__(self, x): return self.forward(x)", "networks.py")
    path = write("from networks import Module\n"
                 "class Net(Module):\n    def forward(self, x): return 2 * x\n"
                 + BARE + "return Net()(frame['color']), state")
    np.testing.assert_allclose(once(build(path)), 2 * make_frame(6, 8)["color"])


class Unique:
    """A stand-in for a network: there is one, it cannot be copied or pickled."""

    def __deepcopy__(self, memo):
        raise TypeError("copied")

    __copy__ = __reduce_ex__ = __deepcopy__  # pyright: ignore


NETWORK = """
from dataclasses import dataclass, field
from tests.denoise.test_own_method import Unique

@dataclass
class Learned:
    strength: float = 1.0
    network: Unique = field(default_factory=Unique)

    def __call__(self, frame, state):
        assert isinstance(self.network, Unique)
        return self.strength * frame["color"], state
"""


def test_a_model_that_cannot_be_copied_is_never_copied(write, sequence, call):
    path, folder = write(NETWORK), sequence.folder
    for words in (("denoise", folder, "--method", path, "--set", "strength=0.5"),
                  ("time", folder, "--method", path, "--rounds", 1),
                  ("tune", folder, "--method", path)):
        code, _, error = call(*words)
        assert code == 0, error
    assert sequence.read_run("my_filter").parameters == {"strength": 0.5}


def test_modules_that_make_up_attributes_are_borne(write):
    """As `torch.classes`, which comes with the first network."""
    path = write("""
import sys, types

class Odd(types.ModuleType):
    def __getattr__(self, name):
        return Odd(name)

sys.modules["odd_one"] = Odd("odd_one")

class Half:
    needs = ("color",)

    def __call__(self, frame, state):
        return frame["color"] / 2, state
""")
    try:
        np.testing.assert_allclose(once(build(path)), make_frame(6, 8)["color"] / 2)
    finally:
        sys.modules.pop("odd_one", None)


def test_a_torch_module_is_no_method_but_what_uses_it_is(write):
    pytest.importorskip("torch")
    path = write("""
import torch

class Net(torch.nn.Module):
    def forward(self, x):
        return 2 * x

class Learned:
    needs = ("color",)

    def __init__(self):
        self.net = Net().eval()

    def __call__(self, frame, state):
        with torch.no_grad():
            image = self.net(torch.tensor(frame["color"]))
        return image.numpy(), state
""")
    np.testing.assert_allclose(once(build(path)), 2 * make_frame(6, 8)["color"])


# Wherever a method is named


def test_results_are_called_after_the_file_and_the_class(write, sequence, call):
    path = write(HALF)
    assert call("denoise", sequence.folder, "--method", path, "--method", f"{path}:Darker")[0] == 0
    assert call("denoise", sequence.folder, "--method", path, "--set", "on=no",
                "--name", "same")[0] == 0
    assert sequence.methods() == ["fine", "my_filter", "my_filter-Darker", "rough", "same"]
    scores = score(sequence, [path, "same"])
    assert [scores.label(name) for name in scores.methods] == [
        "input", "my_filter", "same (my_filter.py)"]
    assert scores.methods["same"].changed == {"on": False}
    assert scores.methods["my_filter"]["psnr_srgb"] < scores.methods["same"]["psnr_srgb"]


@pytest.mark.parametrize(("name", "called"), [
    ("a/my filter.py", "my_filter"), ("_x.py", "x"), ("фильтр.py", "own"), ("x.py:Y", "x-Y"),
    ("a.b.py", "a.b"), ("atrous", "atrous"), ("atrous+outliers", "atrous+outliers")])
def test_names_of_files_that_folders_cannot_have_are_made_fit(name, called):
    assert result_name(name) == called


def test_an_edited_file_is_told_from_what_it_was(write, sequence, call):
    folder, path = sequence.folder, write(HALF)
    before = source_of(build(path))
    call("denoise", folder, "--method", path)
    call("time", folder, "--method", path, "--rounds", 1)
    assert score(sequence).methods["my_filter"].interleaved
    write(HALF.replace("on else 1", "on else 2"))
    assert source_of(build(path)) != before
    (folder / "denoised/my_filter/left-over").write_text("")
    call("denoise", folder, "--method", path)
    assert not score(sequence).methods["my_filter"].interleaved


def test_every_command_that_names_a_method_takes_a_file(write, sequence, call, tmp_path):
    folder, path = sequence.folder, write(HALF)
    assert call("denoise", folder, "--method", path)[0] == 0
    code, text, _ = call("time", folder, "--method", path, "--method", "atrous", "--rounds", 1)
    assert (code, text.startswith("my_filter.py: ")) == (0, True)
    code, text, _ = call("score", folder, "--method", path, "--by-cause", "--no-pictures")
    assert (code, text.count("│ my_filter ")) == (0, 3)
    code, text, _ = call("compare", folder / "scores.json", folder / "scores.json", "--all",
                         "--method", path)
    assert (code, "my_filter" in text, "input" in text) == (0, True, False)
    code, text, _ = call("ablate", folder, "--method", path)
    assert (code, "| without on |" in text) == (0, True)
    out = tmp_path / "tried.json"
    code, text, _ = call("tune", folder, "--method", path, "--parameter", "gain", "--out", out)
    assert (code, "--set gain=" in text) == (0, True)
    assert source_of(build(path)) in next(iter(json.loads(out.read_text())))
    call("denoise", folder, "--method", "atrous")
    call("score", folder, "--no-pictures")
    code, text, _ = call("lead", folder, folder, "--method", path, "--peer", "atrous")
    assert (code, text.startswith("| `my_filter` and `atrous` |")) == (0, True)
    code, text, _ = call("lead", folder, folder, "--method", "atrous", "--peer", path)
    assert (code, text.startswith("| `atrous` and `my_filter` |")) == (0, True)


@pytest.mark.parametrize(("text", "name", "words"), [
    ("1 / 0", "my_filter.py", "ZeroDivisionError"), (HALF, "svgf.py", "is the name of a method"),
    (HALF, "reference.py", "cannot be the name of results")])
def test_what_cannot_be_run_is_said_before_a_run_renders(write, tmp_path, call, text, name, words):
    code, _, error = call("run", "box", "--out", tmp_path / "run", "--method", write(text, name))
    assert (code, words in error) == (2, True)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["svgf.py", "onespp.py", "reference.py", "all.py"])
def test_a_file_named_like_a_method_needs_a_name(write, sequence, call, name):
    code, _, error = call("denoise", sequence.folder, "--method", write(HALF, name))
    assert (code, "use another --name" in error) == (2, True)
    assert call("denoise", sequence.folder, "--method", write(HALF, name), "--name", "x")[0] == 0


def test_two_files_of_one_name_are_not_mixed(write, sequence, call):
    code, _, error = call("denoise", sequence.folder, "--method", write(HALF),
                          "--method", write(HALF, "deeper/my_filter.py"))
    assert (code, "two methods would be called 'my_filter'" in error) == (2, True)
    assert sequence.methods() == ["fine", "rough"]


# What goes wrong, in one sentence


@pytest.mark.parametrize(("text", "words"), [
    ("def f(:\n", "line 1: SyntaxError"),
    ("", "there is no method here"),
    ("x = 1\nclass _Hidden:\n    def __call__(self, frame, state): pass", "there is no method"),
    (b"x = 'caf\xe9'\n", "SyntaxError"),
    (b"\0\0", "null bytes"),
    ("import no_such_package", "line 1: ModuleNotFoundError: No module named 'no_such_package'"),
    ("import sys\nsys.exit(3)", "line 2: SystemExit"),
    ("x = 1\n\n1 / 0", "line 3: ZeroDivisionError"),
    (BARE + "pass\n" + BARE.replace("Bare", "Two") + "pass", "as my_filter.py:Bare (or Two)"),
    ("class A:\n    def __init__(self, radius): pass\n    def __call__(self, f, s): pass",
     "line 2: A() lacks radius: give every parameter a default"),
    ("class A:\n    def __init__(self): self.x\n    def __call__(self, f, s): pass",
     "line 2: AttributeError"),
    ("class A:\n    def __call__(self, frame): pass",
     "line 2: A.__call__ does not take (frame, state)"),
    ("class A:\n    def init(self): pass\n    def __call__(self, f, s): pass",
     "line 2: A.init does not take (height, width)"),
    ("class A:\n    needs = 'color'\n    def __call__(self, f, s): pass", "use a tuple of chan"),
    ("class A:\n    needs = ('colour',)\n    def __call__(self, f, s): pass", "'colour' is none"),
    ("class A:\n    @property\n    def needs(self): return 1 / 0\n"
     "    def __call__(self, f, s): pass", "line 3: ZeroDivisionError"),
])
def test_a_file_that_is_no_method_is_one_sentence_with_its_line(write, call, sequence, text, words):
    code, _, error = call("denoise", sequence.folder, "--method", write(text))
    assert code == 2
    assert words in error
    assert "my_filter.py" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(("result", "words"), [
    ("pass", "returned None for frame 0: return image, state"),
    ("return frame['color']", "line 2: Bare.__call__ returned an array for frame 0"),
    ("return None, state", "returned None for frame 0: use a NumPy array"),
    ("return [1, 2], state", "returned a list"),
    ("return frame['color'].astype(int), state", "an image of int64 for frame 0: use float32"),
    ("return frame['color'][..., 0], state", "shape (32, 48) for frame 0: use (32, 48, 3)"),
    ("return frame['color'][1:], state", "shape (31, 48, 3)"),
    ("return frame['color'] * float('nan'), state", "1536 pixels that are not finite"),
    ("x = frame['color'].copy(); x[3, 4, 1] = float('inf'); return x, state",
     "1 pixels that are not finite for frame 0, the first in row 3, column 4"),
    ("return frame['color'].astype('f8') * 1e300, state", "not finite"),
    ("return frame['colour'], state", "line 3: frame 0 lacks the channel 'colour'"),
    ("frame['color'][0] = 1; return frame['color'], state", "line 3: ValueError: assignment "
     "destination is read-only"),
    ("raise KeyError('x')", "line 3: KeyError: 'x'"),
    ("import parts; return parts.f(frame), state", "line 4 of parts.py: ZeroDivisionError"),
    ("raise SystemExit", "line 3: SystemExit"),
    ("return self(frame, state)", "RecursionError"),
])
def test_what_a_call_does_wrong_is_one_sentence_with_its_line(write, call, sequence, result, words):
    write("\n\ndef f(frame):\n    return 1 / 0", "parts.py")
    code, _, error = call("denoise", sequence.folder, "--method", write(BARE + result))
    assert code == 2
    assert words in error
    assert "my_filter.py" in error
    assert error.count("\n") == 1


def test_a_frame_that_is_not_finite_itself_is_named_as_the_cause(write):
    frame = make_frame(6, 8)
    frame.images["color"][2, 3] = np.nan
    method = build(write(BARE + "return frame['color'], state"))
    with pytest.raises(InputError, match=r"row 2, column 3: the frame's colour is not finite th"):
        method(frame, None)


def test_what_it_prints_is_not_among_the_results(write, call, sequence):
    text = HALF.replace("state[", "print('seen')\n        state[")
    code, out, error = call("denoise", sequence.folder, "--method", write("print('read')" + text))
    assert code == 0
    assert "seen" not in out
    assert "read" not in out
    assert error.count("seen") == 2


@pytest.mark.parametrize(("name", "words"), [
    ("nothing.py", "there is no method file 'nothing.py'"),
    ("my_filter.py:None_such", "there is no 'None_such' here: it has Darker"),
    ("my_filter.py:", "there is no '' here"), ("my_filter.py:np", "cannot be called"),
    ("folder.py", "it is a folder"), ("my_filter", "did you mean my_filter.py?"),
    ("a\0.py", "there is no method file")])
def test_a_name_that_is_no_method_is_one_sentence(write, tmp_path, monkeypatch, name, words):
    folder = Path(write(HALF)).parent
    (folder / "folder.py").mkdir()
    monkeypatch.chdir(folder)
    with pytest.raises(InputError) as caught:
        build(name)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("settings", "words"), [
    ({"gian": "1"}, "has no parameter 'gian': it has gain, on"),
    ({"gain": "much"}, "gain is 'much': use a number"),
    ({"gain": "-1"}, "line 18: ValueError: gain is -1.0: use 0 or more")])
def test_parameters_that_it_has_not_or_refuses(write, settings, words):
    with pytest.raises(InputError) as caught:
        build(write(HALF), settings)
    assert words in str(caught.value)


def test_a_class_that_is_no_dataclass_has_no_parameters(write, sequence, call):
    path = write(BARE + "return frame['color'], state")
    code, _, error = call("denoise", sequence.folder, "--method", path, "--set", "x=1")
    assert (code, "since it is no dataclass" in error) == (2, True)
    code, _, error = call("tune", sequence.folder, "--method", path)
    assert (code, "has no parameter to search" in error) == (2, True)


# What a study asks of it


def test_a_state_that_is_written_to_is_a_new_one_for_each_frame_alone(write, sequence):
    """`hard` compares a method with the same without a history."""
    path = write(HALF.replace('self.gain if self.on else 1', '1 / state["frames"]'))
    _, row = judge(sequence, "made", None, False, methods={"mine": build(path)})
    first, second = row.psnr
    assert row.method == "mine"
    assert row.alone == pytest.approx((first, row.alone[1]))
    assert abs(row.alone[1] - second) > 1


def test_hard_takes_it(write, tmp_path, call):
    code, text, error = call("hard", "tiny", "--method", write(HALF), "--reference-spp", 4,
                             "--out", tmp_path / "hard")
    assert code == 0, error
    assert "| PSNR, dB (mean over frames) | input | my_filter |" in text
