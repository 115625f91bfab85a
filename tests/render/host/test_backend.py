"""LLVM is found, checked and refused before Dr.Jit can crash on it. Each case in a new process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from onespp.render.cli.arguments import parse_size
from onespp.render.errors import InputError
from onespp.render.host import backend
from onespp.render.trials import TRIALS, TrialError, attempt
from tests.support.places import ROOT

OLD = sorted(Path("/usr/lib").glob("*/libLLVM-1[0-5].so"))


def onespp(*arguments: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "onespp", *arguments], capture_output=True,
                          text=True, env=os.environ | environment, timeout=120, check=False)


def one_sentence(text: str) -> bool:
    return text.startswith("onespp: ") and text.count("\n") == 1 and "Traceback" not in text


@pytest.mark.skipif(not OLD, reason="no libLLVM older than 16 on this machine")
@pytest.mark.parametrize("path", list(map(str, OLD[-1:])))
def test_an_old_llvm_is_refused_in_a_sentence(path, tmp_path):
    done = onespp("render", "box", "--out", str(tmp_path / "a"), "--size", "8x8",
                  DRJIT_LIBLLVM_PATH=path, ONESPP_DEVICE="llvm")
    assert done.returncode == 2
    assert one_sentence(done.stderr)
    assert path in done.stderr
    assert "16" in done.stderr
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("make", [lambda p: None, lambda p: p.write_text("not a library")])
def test_a_wrong_llvm_path_is_refused_in_a_sentence(make, tmp_path):
    path = tmp_path / "libLLVM.so"
    make(path)
    done = onespp("render", "box", "--out", str(tmp_path / "a"), "--size", "8x8",
                  DRJIT_LIBLLVM_PATH=str(path), ONESPP_DEVICE="llvm")
    assert done.returncode == 2
    assert one_sentence(done.stderr)


@pytest.mark.skipif(not OLD, reason="no libLLVM older than 16 on this machine")
def test_importing_drjit_first_with_an_old_llvm_is_an_error_not_an_abort():
    code = "import drjit, drjit.llvm as l; l.Float([1, 2]) + 1\nimport onespp.render"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False,
                          env=os.environ | {"DRJIT_LIBLLVM_PATH": str(OLD[-1])})
    assert done.returncode == 1
    assert "import onespp.render before drjit" in done.stderr


def test_doctor_finds_everything_here():
    done = onespp("doctor")
    assert done.returncode == 0, done.stdout
    for subject in ("Python", "LLVM", "CUDA", "threads", "kernel cache", *TRIALS):
        assert f" {subject}: " in done.stdout
    for word in ("wrote and read a file", "rendered a pixel", "drew a plot", "read a video"):
        assert word in done.stdout


def spoiled(tmp_path, module: str, code: str) -> str:
    """A folder for PYTHONPATH in which a library is what it should not be."""
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / f"{module}.py").write_text(code)
    return str(tmp_path / "bad")


@pytest.mark.skipif(sys.platform == "win32", reason="no signals to die of")
def test_doctor_names_a_wrong_llvm_and_a_library_that_crashes_and_survives(tmp_path):
    code = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    done = onespp("doctor", DRJIT_LIBLLVM_PATH=str(OLD[0] if OLD else tmp_path / "none.so"),
                  PYTHONPATH=spoiled(tmp_path, "OpenEXR", code))
    assert done.returncode == 2
    for words in ("BAD   LLVM", "BAD   OpenEXR: crashed (SIGSEGV) where it was tried: run `",
                  "BAD   test kernel: "):
        assert words in done.stdout, done.stdout + done.stderr
    assert "ok    Matplotlib: drew a plot" in done.stdout  # and the rest is looked at
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("module", "code", "words"), [
    ("OpenEXR", "import ctypes; ctypes.string_at(8)", "BAD   OpenEXR: crashed (SIGSEGV)"),
    ("matplotlib", "raise ImportError('no such symbol')",
     "BAD   Matplotlib: ImportError: no such symbol"),
    ("av", "def open(*_, **__): raise RuntimeError('none for this platform')",
     "note  PyAV: RuntimeError: none for this platform; movies are left out")])
@pytest.mark.skipif(sys.platform == "win32", reason="no signals to die of")
def test_doctor_survives_a_library_that_crashes_and_names_it(tmp_path, module, code, words):
    done = onespp("doctor", PYTHONPATH=spoiled(tmp_path, module, code))
    assert words in done.stdout, done.stdout + done.stderr
    assert done.returncode == (2 if words.startswith("BAD") else 0)
    assert "ok    test kernel: ran on" in done.stdout  # and the rest is looked at
    assert "Traceback" not in done.stdout + done.stderr


def test_a_library_that_hangs_is_not_waited_for(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "path", [spoiled(tmp_path, "PIL", "import time; time.sleep(60)"),
                                      *sys.path])
    with pytest.raises(TrialError, match=r"did not come to an end in 1 s: run `.* pillow`"):
        attempt("Pillow", 1)


def test_the_llvm_in_use_is_new_enough():
    llvm = backend.require_llvm()
    assert llvm.usable
    assert backend.llvm_version(llvm.path) == llvm.version


def test_an_unknown_device_is_refused():
    with pytest.raises(InputError, match="auto, llvm, cuda or metal"):
        backend.choose("gpu")


@pytest.fixture
def afresh():
    backend.choose.cache_clear()
    yield
    backend.choose.cache_clear()


@pytest.mark.usefixtures("afresh")
@pytest.mark.skipif(sys.platform == "darwin", reason="it is not refused there")
def test_metal_is_refused_in_a_sentence_where_there_is_none(tmp_path):
    done = onespp("render", "box", "--device", "metal", "--out", str(tmp_path / "a"))
    assert done.returncode == 2
    assert done.stderr == (f"onespp: metal is for macOS, and this is {sys.platform}: use --device "
                           "llvm\n")
    assert not (tmp_path / "a").exists()


@pytest.mark.usefixtures("afresh")
def test_metal_is_chosen_on_macos_where_it_is_asked_for_and_needs_no_llvm(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(backend, "find_llvm", lambda: None)
    monkeypatch.setattr(backend, "has_cuda", lambda: False)
    assert backend.choose("metal") == "metal"
    monkeypatch.setenv("ONESPP_DEVICE", "metal")
    assert backend.choose() == "metal"
    assert backend.VARIANTS[backend.choose()] == "metal_ad_rgb"


def test_every_device_has_a_variant_and_a_backend():
    from onespp.denoise.jit.grid import _BACKENDS

    assert {*_BACKENDS} == {*backend.VARIANTS}
    assert len({*_BACKENDS.values()}) == len(_BACKENDS)


@pytest.mark.parametrize(("text", "size"), [("640x360", (360, 640)), ("1x1", (1, 1)),
                                            ("8X6", (6, 8))])
def test_sizes_are_width_by_height(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["0x4", "640", "4x", "-1x5", "99999x4", "4x4x4", "axb", ""])
def test_odd_sizes_are_refused(text):
    with pytest.raises(InputError, match="--size"):
        parse_size(text)


def test_denoise_imports_no_renderer():
    code = ("import sys, onespp.denoise.run.sequence, onespp.denoise.score.sequence; "
            "sys.exit('mitsuba' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="a folder that is used cannot be removed")
def test_a_working_directory_that_is_gone_is_one_sentence(tmp_path):
    """Mitsuba's import ended the process: SIGABRT.

    From a file, as the console script is: by `python -c` Python 3.13 itself fails where an
    attribute is missing, since it looks for modules of its name in the working directory.
    """
    gone = tmp_path / "gone"
    gone.mkdir()
    program = tmp_path / "program.py"
    program.write_text(
        f"import os, sys; sys.path[0] = {str(ROOT)!r}\n"
        f"os.chdir({str(gone)!r}); os.rmdir({str(gone)!r})\n"
        "from onespp.cli import main; sys.argv[1:] = ['render', 'box', '--size', '4x4', "
        f"'--out', {str(tmp_path / 'o')!r}]; main()", "utf-8")
    done = subprocess.run([sys.executable, program], capture_output=True, text=True,
                          timeout=120, check=False)
    assert (done.returncode, done.stderr) == (
        2, "onespp: the working directory has been removed: change to another one\n")
