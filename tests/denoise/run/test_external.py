"""A program of someone else's as a method in the table."""

from __future__ import annotations

import shlex
import subprocess
import sys

import numpy as np
import pytest

from onespp.denoise.run import external
from onespp.denoise.run.external import denoise_externally
from onespp.render.errors import InputError
from tests.support.clock import Clock
from tests.support.small_sequence import HEIGHT, WIDTH, small_sequence

# Doubles every frame, and notes in its results how many it was told of.
PROGRAM = '''
import sys
from pathlib import Path
from onespp.render.files.exr import read_exr, write_exr
given, made, frames = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
for k in range(frames):
    planes, _ = read_exr(given / f"beauty_{k}.exr", ("R", "G", "B"))
    assert (given / f"matrix_{k}.mat").stat().st_size and (given / f"ID_{k}.exr").exists()
    write_exr(made / f"result_{k}.exr", {c: 2 * p for c, p in planes.items()})
'''


# Writes a first result that is good and a second one that is not.
SPOILED = """
import sys
from pathlib import Path
import numpy as np
from onespp.render.files.exr import read_exr, write_exr
given, made = Path(sys.argv[1]), Path(sys.argv[2])
for k in range(2):
    planes, _ = read_exr(given / f"beauty_{k}.exr", ("R", "G", "B"))
    write_exr(made / f"result_{k}.exr", {c: np.ones_like(p) for c, p in planes.items()})
data = bytearray((made / "result_1.exr").read_bytes())
data[-12:] = bytes(12)
(made / "result_1.exr").write_bytes(data)
print("a warning", file=sys.stderr)
"""


@pytest.fixture
def sequence(tmp_path):
    return small_sequence(tmp_path / "a sequence")


@pytest.fixture
def program(tmp_path):
    path = tmp_path / "a program.py"
    path.write_text(PROGRAM)
    return f"{shlex.quote(sys.executable)} '{path}' {{input}} {{output}} {{frames}}"


def python(code: str) -> str:
    return shlex.join([sys.executable, "-c", code, "{input}", "{output}"])


def test_its_results_and_its_time_are_those_of_a_method(sequence, program, monkeypatch):
    """0.5 s of the program over two frames; export and import take no part in it."""
    clock, start = Clock(), subprocess.run

    def taking_half_a_second(*arguments, **options):
        clock.pass_(0.5)
        return start(*arguments, **options)

    def passing(function):
        def slowly(*arguments):
            clock.pass_(7)
            return function(*arguments)
        return slowly

    clock.put_into(monkeypatch, "onespp.denoise.run.external")
    monkeypatch.setattr(subprocess, "run", taking_half_a_second)
    for name in ("export_games202", "import_result"):
        monkeypatch.setattr(external, name, passing(getattr(external, name)))
    run = denoise_externally(sequence, program, "doubled")
    assert sequence.methods() == ["doubled"]
    for i in sequence.frames:
        np.testing.assert_allclose(sequence.read_result("doubled", i),
                                   2 * sequence.read_frame(i, ("color",))["color"])
    assert run == sequence.read_run("doubled")
    assert run.ms == dict.fromkeys(sequence.frames, 250)
    assert run.first_ms == 250
    assert run.parameters["external"] == program


def test_results_of_an_earlier_run_are_not_mixed_in(sequence, program):
    sequence.write_result("doubled", 1, np.full((HEIGHT, WIDTH, 3), 7, np.float32))
    one = program.replace("{frames}", "1 {frames}")
    denoise_externally(sequence, one, "doubled")
    assert sequence.has_result("doubled", 0)
    assert not sequence.has_result("doubled", 1)


@pytest.mark.parametrize(("command", "words"), [
    (python("import sys; print('a\\nno such model', file=sys.stderr); sys.exit(3)"),
     "failed with exit code 3; its last words on stderr: a / no such model$"),
    (python("print('out of luck'); raise SystemExit(3)"),
     "failed with exit code 3; its last words on stdout: out of luck$"),
    (python("import os, signal; os.kill(os.getpid(), signal.SIGKILL)"), "the signal SIGKILL"),
    (python("print('nothing to do')"),
     r"has no result_0\.exr.*; its last words on stdout: nothing to do$"),
    (python("import sys; sys.exit(4)"), "failed with exit code 4 and said nothing"),
    (python("pass"), r"has no result_0\.exr"),
    ("no-such-program-anywhere {input} {output}", "no-such-program-anywhere could not be started"),
    ("prog 'open {input} {output}", "check its quotes"),
    ("prog {input}", r"lacks \{input\} or \{output\}"), ("", r"lacks \{input\}")])
def test_what_goes_wrong_is_one_sentence(sequence, command, words):
    with pytest.raises(InputError, match=words) as error:
        denoise_externally(sequence, command, "mine")
    assert "\n" not in str(error.value)
    assert sequence.methods() == []


def test_a_bad_result_is_one_sentence_and_leaves_none(sequence, program):
    with pytest.raises(InputError, match="is damaged and cannot be decoded") as error:
        denoise_externally(sequence, python(SPOILED), "mine")
    assert "last words on stderr: a warning" in str(error.value)
    assert not list((sequence.folder / "denoised").glob("mine/*"))


def test_no_shell_reads_the_line(sequence, tmp_path):
    trap = tmp_path / "trap"
    with pytest.raises(InputError):
        denoise_externally(sequence, f"false {{input}} {{output}}; touch {trap}", "mine")
    assert not trap.exists()


def test_a_sequence_with_frames_missing_or_a_bad_name_is_refused_first(sequence, program):
    with pytest.raises(InputError, match="is not a name"):
        denoise_externally(sequence, program, "../up")
    (sequence.folder / "frames/0001.exr").unlink()
    with pytest.raises(InputError, match="lacks frame 1"):
        denoise_externally(sequence, program, "mine")
