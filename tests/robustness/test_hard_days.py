"""Two writers, links that lead away, files half written, little memory, odd environments."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from onespp.denoise.report.html import write_report
from onespp.denoise.run.sequence import _remove_stale
from onespp.denoise.score.sequence import measure_sequence
from onespp.render import doctor, job
from onespp.render.errors import InputError
from onespp.render.files import atomic, lock
from onespp.render.files.exr import read_exr
from onespp.render.files.lock import writing
from onespp.render.files.manifest import Run
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.host import backend, memory
from onespp.render.references import References
from onespp.render.tracer.reference import SampleSums
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import SceneError
from tests.support.places import ROOT
from tests.support.report_sequence import make_report_sequence
from tests.support.small_sequence import contents, small_frame, small_manifest, small_sequence

from .fuzz import SCENE

posix = pytest.mark.skipif(sys.platform == "win32", reason="no such locks or files on Windows")
linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@pytest.fixture
def scene_file(tmp_path) -> Path:
    (tmp_path / "scene.py").write_text(SCENE)
    return tmp_path / "scene.py"


def refused(act, *arguments) -> str:
    with pytest.raises(InputError) as error:
        act(*arguments)
    return str(error.value)


def take(folder: Path, part: str, alone: bool = False) -> None:
    with writing(folder, part, alone):
        pass


# Two writers


@posix
def test_a_second_writer_of_the_same_part_is_told_who_writes(tmp_path):
    small_sequence(tmp_path)
    with writing(tmp_path, "render"):
        text = refused(take, tmp_path, "render")
        assert f"is being written by another `render` (process {os.getpid()} on " in text
        assert "wait for it" in text
        take(tmp_path, "denoise-atrous")
    with writing(tmp_path, "denoise-atrous"):
        assert "another `denoise atrous`" in refused(take, tmp_path, "denoise-atrous")
        take(tmp_path, "denoise-bilateral")
    take(tmp_path, "render")
    assert not list(tmp_path.glob(".*"))


@posix
def test_nobody_writes_while_everything_is_replaced(tmp_path):
    small_sequence(tmp_path)
    with writing(tmp_path, "score"):
        assert "another `score`" in refused(take, tmp_path, "render", True)
    take(tmp_path, "render", True)


@posix
def test_the_lock_of_a_dead_process_is_taken_whatever_it_says(tmp_path):
    code = ("import pathlib, sys, time; from onespp.render.files.lock import writing\n"
            "with writing(pathlib.Path(sys.argv[1]), 'render'):\n"
            "    print('locked', flush=True); time.sleep(60)")
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE,
                               text=True)
    assert process.stdout is not None
    process.stdout.readline()
    assert f"process {process.pid} on " in refused(take, tmp_path, "render")
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert (tmp_path / ".render.lock").exists()
    take(tmp_path, "render")
    (tmp_path / ".render.lock").write_text("process 1 on another-host since 1999\n\x1b[2J")
    take(tmp_path, "render")
    assert not list(tmp_path.iterdir())


@posix
@posix
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_written_to(monkeypatch, tmp_path, number):
    monkeypatch.setattr(lock.fcntl, "flock", raising(OSError(number, os.strerror(number))))
    with writing(tmp_path / "a", "render"):
        (tmp_path / "a/file").write_text("x")
    assert (tmp_path / "a/file").exists()


@posix
@pytest.mark.parametrize("number", [errno.EIO, errno.EBADF, errno.EINVAL, errno.ESTALE])
def test_a_lock_that_fails_otherwise_is_not_taken_for_one_that_is_held(monkeypatch, tmp_path,
                                                                       number):
    monkeypatch.setattr(lock.fcntl, "flock", raising(OSError(number, os.strerror(number))))
    with pytest.raises(InputError, match=r"\.render\.lock could not be locked \(") as error, \
            writing(tmp_path / "a", "render"):
        pytest.fail("it was written to without a lock")
    assert os.strerror(number) in str(error.value)


def raising(error: Exception):
    def act(*_: object) -> None:
        raise error

    return act


def test_a_reference_is_on_the_disk_before_it_has_its_name(monkeypatch, tmp_path):
    """It cost hours: a loss of power must not leave an empty file in its place."""
    sequence, done = small_sequence(tmp_path), []
    sync, replace = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        done.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        sync(descriptor)

    def replaced(source, target) -> None:
        done.append(Path(target).name)
        replace(source, target)

    monkeypatch.setattr(atomic.os, "fsync", synced)
    monkeypatch.setattr(atomic.os, "replace", replaced)
    color = np.ones((*sequence.size, 3), np.float32)
    after = ["folder"] if os.name != "nt" else []
    sequence.write_reference(0, Reference(color, color, 16))
    assert done == ["file", "0000.exr", *after]
    done.clear()
    sequence.write_partial(0, {"samples": 1})
    assert done == ["file", "0000.partial.npz", *after]
    done.clear()
    sequence.write_result("m", 0, color)  # made again in a second: not worth the wait
    assert done == ["0000.exr"]


@pytest.mark.parametrize(("number", "fine"), [(errno.EINVAL, True), (errno.EIO, False)])
def test_a_disk_that_cannot_sync_is_used_and_one_that_fails_is_told_of(monkeypatch, tmp_path,
                                                                       number, fine):
    monkeypatch.setattr(atomic.os, "fsync", raising(OSError(number, os.strerror(number))))
    if fine:
        atomic.write_bytes(tmp_path / "a", b"x", durable=True)
    else:
        with pytest.raises(InputError, match="could not be written"):
            atomic.write_bytes(tmp_path / "a", b"x", durable=True)
    assert (tmp_path / "a").exists() == fine


def test_commands_take_the_lock(call, scene_file, tmp_path):
    out = tmp_path / "a"
    with writing(out, "render"):
        code, _, error = call("render", scene_file, "--out", out)
        assert (code, error.count("\n")) == (2, 1)
        assert "another `render`" in error
    assert not out.exists()  # as it holds nothing
    assert call("render", scene_file, "--out", out, "--frames", "0", "--resume")[0] == 0
    with writing(out, "denoise-atrous"), writing(out, "score"), writing(out, "time"):
        assert "another `denoise atrous`" in call("denoise", out, "--method", "atrous")[2]
        assert "another `score`" in call("score", out)[2]
        assert "another `time`" in call("time", out, "--method", "atrous")[2]
        assert call("render", scene_file, "--out", out, "--frames", "0", "--overwrite")[0] == 2
    assert not FrameSequence.open(out).methods()


def test_an_error_that_an_impatient_interrupt_turns_into_is_no_bug(call, monkeypatch):
    """Extensions wrap a KeyboardInterrupt that comes while they are imported."""
    def interrupted(_):
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)

    def load(name):
        try:
            interrupted(name)
        except KeyboardInterrupt as error:
            raise ImportError("cannot initialize the extension") from error

    monkeypatch.setattr(catalog, "load", load)
    code, _, error = call("render", "box")
    assert code == 130
    assert error.splitlines()[-1].startswith("onespp: stopped;")


# Links, pipes, and names that lead elsewhere


@posix
@pytest.mark.parametrize("place", ["denoised", "denoised/m", "frames", "pictures", "report/data"])
def test_a_folder_that_is_a_link_outside_is_neither_written_nor_emptied(tmp_path, place):
    inside, outside = tmp_path / "s", tmp_path / "elsewhere"
    sequence = small_sequence(inside)
    sequence.write_result("m", 0, small_frame()["color"])
    (inside / place).parent.mkdir(exist_ok=True)
    if (inside / place).exists():
        (inside / place).rename(outside)
    else:
        outside.mkdir()
    (inside / place).symlink_to("../../elsewhere" if "/" in place else "../elsewhere")
    (outside / "0000.exr").write_bytes(b"mine")
    before = contents(outside)
    assert f"{place} is a link to a place outside" in refused(take, inside, "denoise-m")
    assert "is a link" in refused(FrameSequence.create, inside, small_manifest(seed=1), True)
    assert contents(outside) == before
    assert not list(inside.glob(".*"))


@posix
def test_a_link_at_the_temporary_name_is_not_written_through(tmp_path):
    (tmp_path / "mine").write_text("precious")
    path = tmp_path / "a.json"
    atomic.temporary_name(path).symlink_to("mine")
    atomic.write_text(path, "new")
    assert (tmp_path / "mine").read_text() == "precious"
    assert path.read_text() == "new"
    assert not path.is_symlink()


@posix
def test_a_pipe_or_a_device_in_place_of_a_file_is_not_waited_for(tmp_path):
    small_sequence(tmp_path)
    frame, manifest = tmp_path / "frames/0000.exr", tmp_path / "manifest.json"
    frame.unlink()
    frame.symlink_to("/dev/zero")
    assert "it is not a file" in refused(read_exr, frame)
    manifest.unlink()
    os.mkfifo(manifest)
    assert "it is not a file" in refused(FrameSequence.open, tmp_path)


def test_names_in_a_manifest_are_no_paths(tmp_path):
    folder = tmp_path / "x/y/s"
    sequence = make_report_sequence(folder, 2, scene="../../t", objects=("../a", "/tmp/b"),
                                    fingerprint="../..")
    write_report(sequence, measure_sequence(sequence))
    assert [p.name for p in tmp_path.iterdir()] == ["x"]
    assert [p.name for p in (tmp_path / "x").iterdir()] == ["y"]
    assert [p.name for p in (tmp_path / "x/y").iterdir()] == ["s"]


@pytest.mark.parametrize("name", ["../x", "a/b", "", "/x", "a\nb"])
def test_a_scene_whose_name_is_a_path_is_refused(scene_file, name):
    scene_file.write_text(SCENE.replace('"mine"', repr(name)))
    with pytest.raises(SceneError, match=r"the scene's name is|the name of a scene is"):
        catalog.load(str(scene_file))


# What killed runs leave


def test_half_written_files_of_the_same_part_are_cleared_away(tmp_path):
    small_sequence(tmp_path)
    left = [tmp_path / name for name in (
        "frames/.7.tmp.0001.exr", "reference/.7.tmp.0001.exr", ".7.tmp.manifest.json")]
    others = [tmp_path / "denoised/m/.8.tmp.0000.exr", tmp_path / ".8.tmp.scores.json",
              tmp_path / "frames/.hidden"]
    for path in (*left, *others):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"half")
    take(tmp_path, "render")
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in others)
    take(tmp_path, "denoise-m")
    take(tmp_path, "score")
    assert [path.exists() for path in others] == [False, False, True]


def test_damaged_and_missing_frames_are_rendered_again_to_the_same_bytes(
        call, scene_file, tmp_path):
    command = ("render", scene_file, "--out", tmp_path / "a", "--reference-spp", 4)
    assert call(*command)[0] == 0
    before = contents(tmp_path / "a")
    for name in ("frames/0000.exr", "frames/0001.json", "reference/0001.exr"):
        path = tmp_path / "a" / name
        path.write_bytes(path.read_bytes()[:-40])
    (tmp_path / "a/frames/0002.exr").unlink()
    (tmp_path / "a/reference/0002.exr").write_bytes(b"")
    assert call("denoise", tmp_path / "a", "--method", "atrous")[0] == 2
    assert call(*command)[0] == 0
    for name, data in before.items():
        assert name == "manifest.json" or (tmp_path / "a" / name).read_bytes() == data, name


def test_results_without_a_record_are_not_mixed_with_new_ones(tmp_path):
    """A killed run leaves results, and nothing that says of which parameters."""
    sequence = small_sequence(tmp_path)
    sequence.write_result("m", 1, small_frame()["color"])
    _remove_stale(sequence, "m", Run(method="m"))
    assert not sequence.has_result("m", 1)
    sequence.write_result("m", 1, small_frame()["color"])
    sequence.write_run("m", Run(method="m"))
    _remove_stale(sequence, "m", Run(method="m"))
    assert sequence.has_result("m", 1)


def test_a_reference_does_not_depend_on_the_frames_rendered_before(scene_file):
    """A resumed job begins at another frame than an undisturbed one, and must make its bytes."""
    scene = catalog.load(str(scene_file))
    fresh = Renderer(scene, 32, 32).sample_sum(0, 0, 0, 8)
    used = Renderer(scene, 32, 32)
    used.frame(2, 0, ("color",))
    assert (used.sample_sum(0, 0, 0, 8) == fresh).all()


@pytest.mark.parametrize(("change", "used"), [
    ({}, True), ({"samples": [8, 8, 4]}, False), ({"samples": [-8, 8, 4, 4]}, False),
    ({"samples": [8, 8, 4, 1 << 40]}, False), ({"samples": [8.0, 8.0, 4.0, 4.0]}, False),
    ({"samples": 8}, False), ({"antialias": True}, False), ({"antialias": 0}, False),
    ({"total0": [1.0]}, False), ({"total3": "text"}, False), ({"passes": 3}, False)])
def test_only_a_whole_state_of_the_same_reference_is_continued(tmp_path, change, used):
    sequence = small_sequence(tmp_path)
    zeros = np.zeros((*sequence.size, 3))
    sequence.write_partial(0, {**{f"total{part}": zeros for part in range(4)},
                               "samples": [8, 8, 4, 4], "antialias": False, **change})
    references = References(cast(Renderer, None), sequence, 0, False, {})
    assert (references._saved(0) is not None) == used


def test_an_interrupt_inside_a_sum_leaves_it_as_it_was():
    sums = SampleSums.start(4, 4)
    sums.add(0, np.ones((4, 4, 3)), 2)

    class Interrupted(np.ndarray):
        def __radd__(self, other):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sums.add(0, np.ones((4, 4, 3)).view(Interrupted), 2)
    assert (sums.parts[0][0].max(), sums.samples) == (1.0, [2, 0, 0, 0])


# The environment


def test_too_little_memory_is_said_before_it_is_taken(call, monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "free_memory", lambda: 100 << 20)
    code, _, error = call("render", "box", "--size", "2000x1000", "--out", tmp_path / "a")
    assert code == 2
    assert "2000x1000 pixels take 896 MiB or more and 100 MiB are free" in error
    assert not (tmp_path / "a").exists()

    def exhausted(*_, **__):
        raise MemoryError

    monkeypatch.setattr(job, "render_sequence", exhausted)
    code, _, error = call("render", "box", "--size", "4x4", "--out", tmp_path / "a")
    assert (code, error.count("\n")) == (2, 1)
    assert "not enough memory" in error


@linux
def test_free_memory_is_the_least_that_any_limit_leaves():
    free = memory.free_memory()
    code = "from onespp.render.host.memory import free_memory; print(free_memory())"
    limit = 400 << 20
    limited = subprocess.run(["prlimit", f"--as={limit}", sys.executable, "-c", code],
                             capture_output=True, text=True, check=True)
    assert free is not None
    assert 0 < int(limited.stdout) < limit < free


@linux
@pytest.mark.filterwarnings("ignore")
def test_a_small_scene_renders_in_an_odd_environment_and_512_mb(tmp_path, scene_file):
    """No home, one processor, an odd time zone and locale, a path that is no UTF-8."""
    out = os.fsencode(tmp_path) + b"/a folder \xc3\xbc \xe6\x97\xa5 \xff"
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0",
                   "TZ": "Nowhere/Else", "PATH": "/usr/bin:/bin", "DRJIT_LIBLLVM_PATH": ""}
    # A process counts what it was forked from as its own memory: so one in between, which is small.
    measure = ("import resource, subprocess, sys; code = subprocess.call(sys.argv[1:]); "
               "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(code)")
    done = subprocess.run(
        [sys.executable, "-c", measure, sys.executable, "-m", "onespp", "render", str(scene_file),
         "--reference-spp", "4", "--out", out], env=environment, capture_output=True,
        preexec_fn=lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) < 512 << 10
    files = os.listdir(out + b"/frames")
    assert len(files) == 6
    assert FrameSequence.open(os.fsdecode(out)).manifest.frames == (0, 1, 2)


def test_an_empty_llvm_path_counts_as_none(tmp_path):
    code = ("import onespp.render, drjit, os; from onespp.render.host import backend; "
            "print(backend._SET_BY_USER, "
            "bool(os.environ['DRJIT_LIBLLVM_PATH']))")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                          env={**os.environ, "DRJIT_LIBLLVM_PATH": ""},
                          cwd=ROOT)
    assert done.stdout.split() == ["None", str(backend.find_llvm() is not None)]


def found(look) -> tuple[str, str]:
    finding, = look()
    return finding.state, finding.text


@posix
def test_the_doctor_tells_why_kernels_are_not_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path / "new/folder"))
    assert found(doctor._kernel_cache) == ("ok", str(tmp_path / "new/folder"))
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path / "file"))
    state, text = found(doctor._kernel_cache)
    assert state == "note"
    assert "cannot be written" in text
    monkeypatch.delenv("DRJIT_CACHE_DIR")
    monkeypatch.delenv("HOME", raising=False)
    state, text = found(doctor._kernel_cache)
    assert state == "note"
    assert "HOME is not set" in text


def test_the_doctor_tells_of_little_memory_one_processor_and_ascii(monkeypatch):
    monkeypatch.setattr(doctor, "free_memory", lambda: 100 << 20)
    assert "160 MiB are needed" in found(doctor._memory)[1]
    monkeypatch.setattr(doctor, "free_memory", lambda: (160 << 20) + 470 * 512**2)
    state, text = found(doctor._memory)
    assert (state, "enough for frames of about 512x512 pixels" in text) == ("ok", True)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0}, raising=False)
    assert "1 processor allowed; " in found(doctor._threads)[1]
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: "ascii")
    state, text = found(doctor._text)
    assert state == "note"
    assert "PYTHONUTF8=1" in text


def test_the_time_zone_and_the_clock_do_not_matter(monkeypatch, tmp_path):
    monkeypatch.setenv("TZ", "Asia/Kathmandu")
    time.tzset()
    try:
        take(tmp_path / "a", "render")
        small_sequence(tmp_path / "b")
        os.utime(tmp_path / "b/frames/0000.exr", (0, 0))  # 1970
        assert FrameSequence.open(tmp_path / "b").frame_is_whole(0)
    finally:
        monkeypatch.undo()
        time.tzset()
