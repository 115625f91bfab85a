"""`import onespp` in a program: what it loads, what it gives, what it refuses."""

from __future__ import annotations

import doctest
import subprocess
import sys
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

import onespp
from onespp.api import caller, datasets, denoising, rendering, scoring
from onespp.api.caller import Line
from onespp.clips import clips as clips_module
from onespp.denoise.catalog import METHODS, PEERS, build, parameters
from onespp.denoise.methods.outliers import RemoveOutliers
from onespp.render import frame as frame_module
from onespp.scenes.box import box

HEAVY = ("numpy", "click", "mitsuba", "drjit", "pydantic", "rich", "PIL", "matplotlib")


@pytest.fixture(scope="module")
def sequence() -> onespp.FrameSequence:
    made = onespp.render("box", frames=2, size=(18, 24), reference_spp=16)
    return onespp.denoise(made, "atrous")


def loaded(code: str) -> set[str]:
    """The packages that a program has in the end, and `libLLVM` if it has mapped that."""
    ending = ("\nimport sys\nprint(*{m.partition('.')[0] for m in sys.modules})\n"
              "if sys.platform == 'linux' and 'libLLVM' in open('/proc/self/maps').read():\n"
              "    print('libLLVM')\n")
    done = subprocess.run([sys.executable, "-c", code + ending], capture_output=True, text=True,
                          check=True)
    return set(done.stdout.split())


def test_importing_loads_nothing_heavy():
    there = loaded("import onespp\ndir(onespp)")
    assert "onespp" in there
    assert not there & {*HEAVY, "libLLVM"}


def test_frames_and_scenes_and_scores_load_no_kernels():
    there = loaded("import onespp\nonespp.Frame, onespp.FrameSequence, onespp.Scores\n"
                   "onespp.scenes(), onespp.metrics()")
    assert {"numpy", "pydantic"} <= there
    assert not there & {"click", "rich", "mitsuba", "drjit", "libLLVM", "PIL", "matplotlib"}


def test_a_package_that_is_a_function_is_still_a_package():
    code = ("import onespp.render.frame, onespp.denoise.catalog\n"
            "import onespp\nimport onespp.scenes.description as d\n"
            "assert onespp.render.frame.Frame is onespp.Frame\n"
            "assert onespp.Scene is d.Scene\n"
            "assert all(map(callable, (onespp.render, onespp.denoise, onespp.scenes)))\n"
            "assert 'psnr_srgb' in onespp.metrics()\n"
            "import inspect; print(*inspect.signature(onespp.render).parameters)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "reference_spp" in done.stdout.split()


def test_every_public_name_is_there_and_documented():
    for name in onespp.__all__:
        assert name in dir(onespp)
        found = getattr(onespp, name)
        if not isinstance(found, ModuleType):
            assert found.__doc__
    with pytest.raises(AttributeError, match="no attribute 'rendr'"):
        _ = onespp.rendr  # type: ignore[attr-defined]


EXAMPLES = (rendering, denoising, scoring, datasets, caller, frame_module, clips_module)


@pytest.mark.parametrize("module", EXAMPLES, ids=lambda m: m.__name__)
def test_examples_run(module: ModuleType):
    assert doctest.testmod(module, raise_on_error=False).failed == 0


PUBLIC = [f for m in (rendering, denoising, scoring, datasets) for name, f in vars(m).items()
          if name in onespp.__all__ and f.__module__ == m.__name__]


@pytest.mark.parametrize("function", [*PUBLIC, onespp.Frame.from_arrays], ids=lambda f: f.__name__)
def test_every_function_has_an_example(function: Callable):
    if function is not scoring.Report:
        assert any("onespp" in test.source or "Frame" in test.source
                   for found in doctest.DocTestFinder().find(function) for test in found.examples)


def test_a_scene_may_be_a_name_a_file_or_an_object(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("from onespp.scenes.box import box\nscene = box\n")
    made = [onespp.render(scene, frames=[1], size=(9, 12)) for scene in ("box", file, box())]
    for other in made[1:]:
        np.testing.assert_array_equal(other.read_frame(1)["color"], made[0].read_frame(1)["color"])


def test_a_folder_of_ones_own_is_kept_and_continued(tmp_path):
    out = tmp_path / "kept"
    onespp.render("box", out, frames=1, size=(9, 12))
    first = (out / "frames/0000.exr").stat().st_mtime_ns
    sequence = onespp.render("box", out, frames=2, size=(9, 12))
    assert sequence.frames == [0, 1]
    assert (out / "frames/0000.exr").stat().st_mtime_ns == first
    assert onespp.open(out).manifest == sequence.manifest


def test_a_temporary_folder_goes_when_python_ends():
    code = "import onespp; print(onespp.render('box', frames=1, size=(9, 12)).folder)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    folder = done.stdout.strip()
    assert folder
    assert subprocess.run(["test", "-e", folder]).returncode == 1


def test_one_frame_after_another_gives_the_bytes_of_the_sequence(sequence):
    onespp.denoise(sequence, "svgf", alpha=0.3, name="mine")
    method, state = onespp.method("svgf", alpha=0.3), None
    for i in sequence.frames:
        image, state = method(sequence.read_frame(i), state)
        np.testing.assert_array_equal(image, sequence.read_result("mine", i))
    assert sequence.read_run("mine").changed == {"alpha": 0.3}


@pytest.mark.parametrize("name", [n for n in (*METHODS, *PEERS) if n not in PEERS
                                  or PEERS[n].available()])
def test_every_method_begins_with_none(name, sequence):
    frame = sequence.read_frame(0)
    method = build(name)
    if "replay" in method.needs:
        frame = onespp.Frame.from_arrays(**frame.images, **dict.fromkeys(
            ("replay", "replay_before"), np.full((18, 24, 2), -1.0)),
            camera_from_world=frame.camera_from_world, screen_from_world=frame.screen_from_world,
            world_from_object=frame.world_from_object)
    begun, _ = method(frame, None)
    np.testing.assert_array_equal(begun, method(frame, method.init(18, 24))[0])


class Half:
    """Half of the light."""

    needs = ("color",)

    def init(self, height, width):
        return 0

    def __call__(self, frame, state):
        return frame["color"] / 2, state + 1


def test_a_method_object_denoises_under_its_own_name(sequence):
    onespp.denoise(sequence, onespp.method("atrous", levels=2))
    assert sequence.read_run("atrous").parameters["levels"] == 2


def test_a_plain_class_is_a_method(sequence):
    half = Half()
    half.share = 0.5
    onespp.denoise(sequence, half)
    np.testing.assert_array_equal(sequence.read_result("Half", 1),
                                  sequence.read_frame(1)["color"] / 2)
    assert sequence.read_run("Half").parameters == {"share": 0.5}
    sequence.remove_results("Half")


def test_no_parameter_has_the_name_of_an_argument():
    taken = {"sequence", "method", "name", "outliers"}
    for name in (*METHODS, *PEERS):
        assert not taken & parameters(build(name)).keys()
    assert not taken & parameters(RemoveOutliers()).keys()


REFUSED = [
    (lambda s: onespp.render("bax"), "unknown scene 'bax': did you mean 'box'?"),
    (lambda s: onespp.render(3), "a scene is a int: use a name of onespp.scenes()"),
    (lambda s: onespp.render("box", size=(0, 4)), "size is (0, 4): use (height, width)"),
    (lambda s: onespp.render("box", size=12), "size is 12: use (height, width)"),
    (lambda s: onespp.render("box", frames=0), "frames is 0: use 1 or more"),
    (lambda s: onespp.render("box", frames="0:2"), "frames is '0:2': use how many"),
    (lambda s: onespp.render("box", frames=[2, 1]), "not in increasing order"),
    (lambda s: onespp.render("box", seed=-1), "seed is -1: use 0 or more"),
    (lambda s: onespp.render("box", direct="all"), "direct is 'all': use mis or resampled"),
    (lambda s: onespp.render("box", channels=["colour"]), "channels names colour"),
    (lambda s: onespp.render("box", frames=1, size=(9, 9), reference_spp=4, reference_error=0.1),
     "reference_spp and reference_error both say"),
    (lambda s: onespp.render("box", s.folder, frames=1, size=(9, 24)), "use overwrite to replace"),
    (lambda s: onespp.open("nowhere"), "nowhere does not exist"),
    (lambda s: onespp.denoise("folder", "svgf"), "denoise takes a sequence, not a str"),
    (lambda s: onespp.denoise(s, "svfg"), "unknown method 'svfg'"),
    (lambda s: onespp.denoise(s, "svgf", alfa=1), "has no parameter 'alfa'"),
    (lambda s: onespp.denoise(s, "atrous", levels=2.5), "levels is '2.5': use a whole number"),
    (lambda s: onespp.denoise(s, onespp.method("svgf"), alpha=0.1), "method's name only"),
    (lambda s: onespp.denoise(s, Half), "denoise was given the class Half"),
    (lambda s: onespp.denoise(s, 3), "denoise was given a int without `needs`"),
    (lambda s: onespp.denoise(s, "asvgf"), "asvgf needs the channels replay and replay_before"),
    (lambda s: onespp.score("folder"), "score takes a sequence"),
    (lambda s: onespp.score(s, ["svfg"]), "svfg"),
    (lambda s: onespp.compare("a.json", "b.json"), "a.json"),
    (lambda s: onespp.report(s, ["colour"]), "lacks the channel 'colour'"),
]


@pytest.mark.parametrize("case", range(len(REFUSED)))
def test_what_cannot_be_used_is_refused_in_a_sentence(case, sequence):
    call, words = REFUSED[case]
    with pytest.raises((onespp.InputError, onespp.SceneError)) as caught:
        call(sequence)
    assert words in str(caught.value)
    assert "--" not in str(caught.value)


def test_progress_is_one_line_that_grows_no_longer():
    shown, times = [], iter((0.0, 0.05, 1.0, 2.0))

    class Stream:
        def write(self, text):
            shown.append(text)

        def flush(self):
            pass

    line = Line(Stream(), lambda: next(times))
    for done in (1, 2, 3, 4):
        line(done, 4, "render", "(12 ms)" if done == 3 else "")
    line.end()
    assert shown == ["\rrender: 1 of 4", "\rrender: 3 of 4 (12 ms), 0 s left",
                     "\r" + "render: 4 of 4".ljust(32), "\n"]


def test_nothing_is_printed_where_nobody_looks():
    code = "import onespp; onespp.denoise(onespp.render('box', frames=1, size=(9, 12)), 'atrous')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
