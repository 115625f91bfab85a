"""A data set made by processes that are killed is that of a single process, to the bit."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from types import SimpleNamespace

import pytest

import onespp
from onespp.datasets import pool
from onespp.datasets.folder import DataSet
from onespp.datasets.plan import read_plan
from onespp.render.errors import InputError
from onespp.render.host.versions import versions
from tests.datasets.test_making import files

SMALL = {"sequences": 4, "frames": 2, "size": (16, 24), "reference_spp": 16}


def test_without_dask_it_is_said_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="pip install 'onespp\\[dask\\]'"):
        onespp.dataset("simple", tmp_path / "d", dask="local", **SMALL)


def test_a_scheduler_that_is_not_there_is_told(monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "_SECONDS_TO_CONNECT", 0.2)
    with pytest.raises(InputError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        onespp.dataset("simple", tmp_path / "d", dask="tcp://127.0.0.1:9", **SMALL)


@pytest.mark.slow
def test_workers_that_are_killed_lose_nothing(tmp_path):
    distributed = pytest.importorskip("distributed")
    onespp.dataset("simple", tmp_path / "one", **SMALL)
    killed = []

    def kill_workers(client, folder) -> None:
        """Each time that a frame has come, one of the workers that make something."""
        while len(killed) < 3:
            busy = [name for name, tasks in client.processing().items() if tasks]
            if busy and len(list(folder.rglob("frames/*.exr"))) > len(killed):
                process = client.run(os.getpid, workers=busy[:1])[busy[0]]
                os.kill(process, signal.SIGKILL)
                killed.append(process)
            time.sleep(0.2)

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True,
                                  dashboard_address=None) as cluster, \
            distributed.Client(cluster) as client:
        killer = threading.Thread(target=kill_workers, args=(client, tmp_path / "pool"),
                                  daemon=True)
        killer.start()
        data = onespp.dataset("simple", tmp_path / "pool", dask=cluster.scheduler_address,
                              threads=1, **SMALL)
        killer.join(60)
    assert len(killed) == 3
    assert data.status().left == 0
    assert data.verify() == []
    left = {name: text for name, text in files(data.folder).items() if not name.endswith(".lock")}
    assert left == files(tmp_path / "one")


@pytest.mark.slow
def test_a_scheduler_that_is_killed_and_started_anew_loses_nothing(tmp_path):
    """Its workers, which end with it, are started anew as well."""
    pytest.importorskip("distributed")
    onespp.dataset("simple", tmp_path / "one", **SMALL)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, running = f"tcp://127.0.0.1:{port}", ExitStack()

    def start() -> subprocess.Popen[bytes]:
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
        worker = ["worker", address, "--nthreads", "1", "--no-dashboard"]
        begun = [running.enter_context(subprocess.Popen(
            [sys.executable, "-m", "dask", *command], stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)) for command in (scheduler, worker, worker)]
        for process in begun:
            running.callback(process.terminate)
        while True:
            with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
                return begun[0]
            assert begun[0].poll() is None
            time.sleep(0.1)

    def restart() -> None:
        while not list((tmp_path / "pool").rglob("frames/*.exr")):
            time.sleep(0.1)
        scheduler.kill()
        scheduler.wait()
        killed.append(len(DataSet.open(tmp_path / "pool").numbers()))
        start()

    with running:
        killed: list[int] = []
        scheduler = start()
        killer = threading.Thread(target=restart, daemon=True)
        killer.start()
        said: list[str] = []
        data = DataSet.create(tmp_path / "pool", read_plan("simple", {
            **{key: SMALL[key] for key in ("sequences", "frames", "reference_spp")},
            "height": 16, "width": 24}), versions("mitsuba", "drjit", "numpy"))
        outcome = pool.make_by_pool(data, range(4), address, threads=1, tell=said.append)
        killer.join(60)
    assert killed[0] < 4
    assert sorted(outcome.made) == [0, 1, 2, 3]
    assert len(said) == 1
    assert "the scheduler was lost with" in said[0]
    data.finish()
    assert data.verify() == []
    left = {name: text for name, text in files(data.folder).items() if not name.endswith(".lock")}
    assert left == files(tmp_path / "one")


def test_a_scheduler_that_does_not_come_back_is_told(tmp_path, monkeypatch):
    """A client whose tasks are all cancelled, as those of a scheduler that is gone."""
    class Gone:
        status = "cancelled"

        def done(self) -> bool:
            return True

    opened: list[float] = []

    @contextmanager
    def client(address, workers, seconds=15):
        if seconds != 15:
            opened.append(seconds)
            if len(opened) == 2:
                raise InputError("there is no Dask scheduler")
        yield SimpleNamespace(submit=lambda *arguments, **options: Gone())

    monkeypatch.setattr(pool, "_client", client)
    data = DataSet.create(tmp_path / "d", read_plan("simple", {"sequences": 2}), {})
    told: list[str] = []
    with pytest.raises(InputError, match=r"at tcp://a:1 was lost, .* run the same command again"):
        pool.make_by_pool(data, range(2), "tcp://a:1", tell=told.append)
    assert len(opened) == len(told) == 2
    opened[:] = [0, 0]
    with pytest.raises(InputError, match="it was lost 4 times"):
        pool.make_by_pool(data, range(2), "tcp://a:1")
    assert data.failed() == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a group of processes")
def test_ctrl_c_ends_a_pool_and_the_same_command_goes_on(tmp_path, call):
    """Sent to all processes, as a terminal does."""
    pytest.importorskip("distributed")
    command = ["dataset", "simple", "--sequences", "4", "--frames", "2", "--size", "24x16",
               "--reference-spp", "16", "--dask", "local", "--workers", "2", "--out",
               str(tmp_path / "d")]
    with subprocess.Popen([sys.executable, "-m", "onespp", *command], stderr=subprocess.PIPE,
                          text=True, start_new_session=True) as process:
        while not list((tmp_path / "d").rglob("frames/*.exr")):
            assert process.poll() is None
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "the same command goes on from there" in err
    assert "Traceback" not in err
    assert call(*command)[0] == 0
    assert DataSet.open(tmp_path / "d").verify() == []


@pytest.mark.slow
def test_a_pool_here_lists_what_fails_twice(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    data = DataSet.create(tmp_path / "d", read_plan("simple", {"sequences": 2, "frames": 1,
                                                               "height": 8, "width": 8}), {})
    data.place(0).parent.mkdir()
    data.place(0).write_text("in the way")
    told: list[str] = []
    outcome = pool.make_by_pool(data, range(2), pool.LOCAL, 2, tell=told.append)
    assert outcome.made == [1]
    assert [*outcome.failed] == data.failed() == [0]
    assert len(told) == 1
