"""Any program as a method: it reads frames in the assignment's layout and writes results.

`'PROGRAM {input} {output} {frames}'`: {input} becomes a folder with beauty_0.exr, normal_0.exr, ...
(`render/games202/`), {output} an empty one, where the program leaves result_0.exr, ...; {frames}
is how many there are. The line is split as a shell would, and no shell runs it.
"""

from __future__ import annotations

import shlex
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from onespp.denoise.catalog import check_not_a_method
from onespp.render.errors import InputError, readable
from onespp.render.files.manifest import Run, check_result_name
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.convert import export_games202, import_result
from onespp.render.host.machine import machine

_LAST_LINES, _MOST_LETTERS = 3, 300
PLACES: tuple[str, ...] = ("{input}", "{output}", "{frames}")


def denoise_externally(sequence: FrameSequence, command: str, name: str, typed: str = "") -> Run:
    """Export the frames, run the program, import its results as those of the method `name`.

    Args:
        command: of the program. typed: our own command line, for run.json.
    Returns:
        The run. Its time a frame is the program's wall time, with its start and its reading and
        writing of files, over the number of frames: the same for all of them.

    Raises:
        InputError: the command cannot be used or fails, or it left no results, or bad ones; the
            message has its exit code and the last lines it wrote.
    """
    check_result_name(name, sequence.methods())
    check_not_a_method(name, "external")
    words = _split(command)
    if missing := [i for i in sequence.frames if not sequence.has_frame(i)]:
        raise InputError(f"{sequence.folder} lacks frame {missing[0]}: render all frames first")
    with tempfile.TemporaryDirectory(prefix="onespp-") as folder:
        given, made = Path(folder, "input"), Path(folder, "output")
        made.mkdir()
        export_games202(sequence, given)
        places = dict(zip(PLACES, (str(given), str(made), str(len(sequence.frames)))))
        said, ms = _run([_filled(word, places) for word in words])
        ms /= len(sequence.frames)
        sequence.remove_results(name)
        try:
            done = import_result(sequence, made, name)
        except InputError as error:  # a program may fail with exit code 0
            raise InputError(f"{error}{said}".replace(f"{made}/", "").replace(
                str(made), "the output folder")) from error
    settings = {"external": readable(command), "timing": "whole program, with files"}
    run = Run(method="external", parameters=settings, device="external", machine=machine(),
              command=typed, first_ms=ms, ms=dict.fromkeys(done, ms))
    sequence.write_run(name, run)
    return run


def _split(command: str) -> list[str]:
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"--external cannot be split into words ({error}): "
                         "check its quotes") from None
    if not all(any(place in word for word in words) for place in PLACES[:2]):
        raise InputError("--external lacks {input} or {output}: "
                         "write 'PROGRAM {input} {output} {frames}'")
    return words


def _filled(word: str, places: dict[str, str]) -> str:
    for place, value in places.items():
        word = word.replace(place, value)
    return word


def _run(words: list[str]) -> tuple[str, float]:
    """What a program said last, and its wall time in milliseconds; InputError where it fails."""
    started = time.perf_counter()
    try:
        done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True,
                              check=False)
    except OSError as error:
        raise InputError(f"{words[0]} could not be started ({error.strerror}): give a program "
                         "that exists and may be run") from None
    ms = 1e3 * (time.perf_counter() - started)
    said = _last_words(done.stderr, "stderr") + _last_words(done.stdout, "stdout")
    if done.returncode:
        how = (f"failed with exit code {done.returncode}" if done.returncode > 0 else
               f"was ended by {_signal(-done.returncode)}")
        raise InputError(f"{words[0]} {how}{said or ' and said nothing'}")
    return said, ms


def _last_words(output: bytes, stream: str) -> str:
    """The last lines of a program's output, as the end of a sentence; "" where there are none."""
    lines = [line for line in output[-4000:].decode(errors="replace").splitlines() if line.strip()]
    text = " / ".join("".join(c if c.isprintable() else "?" for c in line.strip())
                      for line in lines[-_LAST_LINES:])
    return f"; its last words on {stream}: {text[-_MOST_LETTERS:]}" if text else ""


def _signal(number: int) -> str:
    try:
        return f"the signal {signal.Signals(number).name}"
    except ValueError:
        return f"signal {number}"
