"""Ctrl-C, threads and processes around Dr.Jit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import onespp
from onespp.denoise.methods.atrous import Atrous
from onespp.render.host.turns import turn
from tests.support.frames import make_frame, noisy

FRAMES = [noisy(make_frame(24, 32, index=i), seed=i) for i in range(3)]
linux = pytest.mark.skipif(sys.platform != "linux", reason="signals and fork as on Linux")


def run(code: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          timeout=100, **options)


def denoised(name: str) -> list[np.ndarray]:
    method, state, images = onespp.method(name), None, []
    for frame in FRAMES:
        image, state = method(frame, state)
        images.append(image)
    return images


@pytest.fixture
def interrupted_step(monkeypatch):
    """Ctrl-C while a kernel is traced; the list grows when that was done."""
    done, traced = [], Atrous.on_lanes

    def on_lanes(self, *arguments):
        if not done:
            os.kill(os.getpid(), signal.SIGINT)
            result = traced(self, *arguments)
            done.append(True)
            return result
        return traced(self, *arguments)

    monkeypatch.setattr(Atrous, "on_lanes", on_lanes)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield done
    signal.signal(signal.SIGINT, before)


@linux
def test_an_interrupt_comes_after_the_step_and_the_next_one_works(interrupted_step):
    method = onespp.method("atrous")
    with pytest.raises(KeyboardInterrupt):
        method(FRAMES[0], None)
    assert interrupted_step == [True]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    image, _ = method(FRAMES[0], None)
    np.testing.assert_array_equal(image, Atrous()(FRAMES[0], None)[0])


@linux
def test_a_second_interrupt_does_not_wait():
    reached = []

    def press_twice() -> None:
        with turn():
            os.kill(os.getpid(), signal.SIGINT)
            reached.append(1)
            os.kill(os.getpid(), signal.SIGINT)
            reached.append(2)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            press_twice()
    finally:
        signal.signal(signal.SIGINT, before)
    assert reached == [1]


@linux
def test_a_handler_of_ones_own_is_left_alone():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(True))
    try:
        with turn():
            os.kill(os.getpid(), signal.SIGINT)
            assert seen == [True]
    finally:
        signal.signal(signal.SIGINT, before)


@linux
def test_a_render_that_is_interrupted_is_gone_on_with(tmp_path):
    """As a notebook's stop button does it: a signal from outside, at any moment."""
    code = f"""
import onespp, sys
onespp.render("box", r"{tmp_path}/warm", frames=1, size=(12, 16))
print("ready", flush=True)
try:
    onespp.render("box", r"{tmp_path}/long", frames=2, size=(96, 128), reference_spp=1 << 20)
except KeyboardInterrupt:
    print("stopped", flush=True)
sequence = onespp.render("box", r"{tmp_path}/long", frames=2, size=(96, 128))
print(onespp.denoise(sequence, "svgf").read_result("svgf", 1).mean() > 0)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    while not list((tmp_path / "long").glob("frames/0001.exr")):
        assert process.poll() is None
        threading.Event().wait(0.1)
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=300)
    assert out == "stopped\nTrue\n", error


def test_threads_take_turns_and_get_what_one_alone_gets():
    names = ("svgf", "atrous", "temporal", "onespp")
    alone = {name: denoised(name) for name in names}
    with ThreadPoolExecutor(4) as threads:
        together = dict(zip(names, threads.map(denoised, names)))
    for name in names:
        np.testing.assert_array_equal(together[name], alone[name])


def test_a_state_may_go_from_thread_to_thread():
    method, state = onespp.method("svgf"), None
    expected = denoised("svgf")
    for frame, image in zip(FRAMES, expected):
        with ThreadPoolExecutor(1) as thread:
            result, state = thread.submit(method, frame, state).result()
        np.testing.assert_array_equal(result, image)


def test_threads_render_the_same_bytes():
    def rendered(seed: int) -> np.ndarray:
        return onespp.render("box", frames=1, size=(12, 16), seed=seed).read_frame(0)["color"]

    alone = [rendered(seed) for seed in range(3)]
    with ThreadPoolExecutor(3) as threads:
        for a, b in zip(alone, threads.map(rendered, range(3))):
            np.testing.assert_array_equal(a, b)


def test_a_turn_waits_for_that_of_another_thread():
    order, inside = [], threading.Event()

    def other() -> None:
        inside.wait()
        with turn():
            order.append("other")

    thread = threading.Thread(target=other)
    thread.start()
    with turn():
        inside.set()
        thread.join(0.2)
        order.append("first")
    thread.join()
    assert order == ["first", "other"]


@linux
def test_a_fork_after_use_is_refused_in_a_sentence():
    code = """
import os, onespp
sequence = onespp.render("box", frames=1, size=(12, 16))
method = onespp.method("atrous")
if os.fork():
    _, status = os.wait()
    print(os.waitstatus_to_exitcode(status), sequence.folder.exists())
else:
    for use in (lambda: onespp.denoise(sequence, "atrous"),
                lambda: method(sequence.read_frame(0), None),
                lambda: onespp.render("box", frames=1, size=(12, 16))):
        try:
            use()
        except onespp.InputError as error:
            print(error, flush=True)
    onespp.api.rendering._remove_temporary()  # at the end of this process, which is not its maker
    os._exit(3)
"""
    done = run(code)
    assert done.returncode == 0, done.stderr
    *refused, status = done.stdout.splitlines()
    assert status == "3 True"
    assert len(refused) == 3
    assert all("forked after Dr.Jit had been loaded" in line for line in refused)
    assert all("get_context('spawn')" in line for line in refused)


@linux
def test_a_fork_before_use_works():
    done = run("import os, onespp\nif os.fork():\n    _, status = os.wait()\n"
               "    print(os.waitstatus_to_exitcode(status))\nelse:\n"
               "    onespp.render('box', frames=1, size=(12, 16))\n    os._exit(0)")
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr


def test_spawned_processes_work_after_use(tmp_path):
    script = tmp_path / "work.py"
    script.write_text("""
import multiprocessing, onespp

def brightness(folder):
    sequence = onespp.denoise(onespp.open(folder), "atrous")
    return float(sequence.read_result("atrous", 0).mean())

if __name__ == "__main__":
    folders = [onespp.render("box", frames=1, size=(12, 16), seed=i).folder for i in (0, 1)]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.map(brightness, folders)
    assert found == [brightness(folder) for folder in folders]
    print("equal")
""")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True,
                          timeout=300)
    assert done.stdout == "equal\n", done.stderr


COLLECTED_WHILE_TRACING = """
import gc
import onespp, onespp.render
from onespp.render.tracer import path
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog

class Cycle:
    pass

kept = Cycle()
kept.itself, kept.other = kept, Renderer(catalog.load("generated/3"), 4, 4)  # of other emitters
kept.other.frame(0, 0)
found_light = path.found_light

def collecting(*args, **options):
    global kept
    kept = None
    if gc.isenabled():
        gc.collect()
    return found_light(*args, **options)

path.found_light = collecting
image = Renderer(catalog.load("box"), 4, 4).sample_sum(0, 0, 0, 2)
assert kept is None and gc.isenabled()
print(image.mean() > 0)
"""


def test_scenes_in_reference_cycles_are_not_freed_while_another_is_traced():
    """Dr.Jit aborts when one is, so this runs in a process of its own."""
    done = run(COLLECTED_WHILE_TRACING)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split() == ["True"]
