"""Commands stopped at random moments: what was finished is whole, the same command completes it.

The few kills of the usual suite have larger sisters, 50 moments for each command:
`pytest -m slow tests/robustness/test_kill.py`.
"""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from onespp.render.files.atomic import is_temporary
from onespp.render.files.json_file import read_json
from onespp.render.files.manifest import Manifest, Run
from tests.support.small_sequence import contents

from .fuzz import SCENE

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")

# Partial references are saved after every pass here, so that kills meet them.
PROGRAM = ("import onespp.cli, onespp.render.references; "
           "onespp.render.references.SECONDS_BETWEEN_SAVES = 0; onespp.cli.main()")
COMMANDS = {
    "render": ("render", "{scene}", "--frames", "0:8", "--size", "64x48", "--reference-spp", "16",
               "--out", "{out}"),
    "denoise": ("denoise", "{out}", "--method", "atrous"),
    "score": ("score", "{out}"),
    "report": ("report", "{out}"),
}
LOCKS = {"render": "render", "denoise": "denoise-atrous", "score": "score", "report": "report"}
VOLATILE = {"manifest.json", "run.json", "scores.json", "scores.csv", "index.html",
            "speed_against_error.png"}  # hold times


@dataclass(frozen=True)
class Whole:
    """Folders before and after an undisturbed run, by command, and seconds of work that it took."""

    before: dict[str, Path]
    after: dict[str, Path]
    seconds: dict[str, float]


def start(command: str, folder: Path) -> subprocess.Popen:
    scene = folder.parent / "scene.py"
    scene.write_text(SCENE)
    words = [word.format(scene=scene, out=folder) for word in COMMANDS[command]]
    return subprocess.Popen([sys.executable, "-c", PROGRAM, *words], stderr=subprocess.PIPE,
                            stdout=subprocess.DEVNULL, text=True)


def wait_for_work(process: subprocess.Popen, command: str, folder: Path) -> None:
    """Until it holds the lock; the file may be there before, of a killed process."""
    lock, who = folder / f".{LOCKS[command]}.lock", f"process {process.pid} on "
    while process.poll() is None:
        with suppress(OSError):
            if who in lock.read_text():
                return
        time.sleep(0.002)


def finish(process: subprocess.Popen) -> str:
    """What it says on stderr, once it ends."""
    return process.communicate(timeout=600)[1]


def make_whole(folder: Path, last: str) -> Whole:
    """Undisturbed runs of the commands up to `last`, each on a copy of what was there before."""
    whole = Whole({}, {}, {})
    before = folder / "start"
    before.mkdir(parents=True)
    for command in COMMANDS:
        after = folder / command / "s"
        shutil.copytree(before, after)
        process = start(command, after)
        wait_for_work(process, command, after)
        began = time.monotonic()
        error = finish(process)
        assert process.returncode == 0, error
        whole.before[command], whole.after[command] = before, after
        whole.seconds[command] = time.monotonic() - began
        if command == last:
            break
        before = after
    return whole


def kill(process: subprocess.Popen, how: str) -> str:
    """Send a signal, `SIGINT2` twice; what the process says."""
    process.send_signal(getattr(signal, how.rstrip("2")))
    if how.endswith("2"):
        time.sleep(0.03)
        process.send_signal(signal.SIGINT)
    return finish(process)


def check_intact(folder: Path, whole: Path) -> None:
    """Every file that has its final name is that of the undisturbed run, or at least valid."""
    for name, data in contents(folder).items():
        path = folder / name
        if is_temporary(path) or path.suffix in (".lock", ".npz"):
            continue
        if path.name not in VOLATILE:
            assert data == (whole / name).read_bytes(), f"{name} is not what it should be"
        elif path.name in ("manifest.json", "run.json"):
            read_json(path, Manifest if path.name == "manifest.json" else Run)
        else:
            assert data, name
            assert path.suffix != ".json" or json.loads(data)


def storm(command: str, whole: Whole, kills: list[tuple[str, float]], folder: Path) -> int:
    """Start a command again and again in one folder, killed each time; how many hit it at work.

    Args:
        kills: signal, and after which share of the time that the work takes. (The undisturbed run
            compiled kernels, so this time is found out anew: shorter after each kill too late.)
    """
    hits, seconds = 0, whole.seconds[command]
    shutil.copytree(whole.before[command], folder)
    for how, moment in kills:
        process = start(command, folder)
        wait_for_work(process, command, folder)
        time.sleep(moment * seconds)
        error = kill(process, how)
        code = process.returncode
        # (Once its work is over and the lock gone, Python itself may die of a signal.)
        over = not (folder / f".{LOCKS[command]}.lock").exists()
        assert code in (0, 130) or (code < 0 and (how == "SIGKILL" or over)), (code, error)
        assert "Traceback" not in error
        assert code != 130 or error.splitlines()[-1].startswith("onespp: stopped")
        check_intact(folder, whole.after[command])
        late = over and code <= 0
        hits += not late
        seconds *= 0.5 if late else 1.2
        if late:  # it was done before
            shutil.rmtree(folder)
            shutil.copytree(whole.before[command], folder)
    process = start(command, folder)
    error = finish(process)
    assert process.returncode == 0, error
    check_intact(folder, whole.after[command])
    assert set(contents(folder)) == set(contents(whole.after[command]))
    return hits


def test_a_killed_command_leaves_whole_files_and_the_next_run_the_same_bytes(tmp_path):
    whole = make_whole(tmp_path / "whole", "denoise")
    hits = storm("render", whole, [("SIGKILL", 0.3), ("SIGINT2", 0.5)], tmp_path / "render/s")
    hits += storm("denoise", whole, [("SIGKILL", 0.3)], tmp_path / "denoise/s")
    assert hits  # a slow machine may let some pass


@pytest.mark.slow
@pytest.mark.parametrize("command", list(COMMANDS))
def test_fifty_kills_at_random_moments(tmp_path, command):
    rng = random.Random(command)
    whole = make_whole(tmp_path / "whole", command)
    signals = ("SIGINT", "SIGTERM", "SIGKILL", "SIGINT2", "SIGKILL") * 10
    hits = storm(command, whole, [(how, rng.random()) for how in signals], tmp_path / "storm/s")
    print(f"{command}: 50 kills, {hits} of them at work")
    assert hits > 15  # the others came when the work was done
