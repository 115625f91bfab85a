"""Data sets given to Slurm: what sbatch is told, and the same jobs by submitit's processes here."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

import onespp
from onespp.datasets import slurm
from onespp.datasets.folder import DataSet
from onespp.datasets.plan import read_plan
from onespp.render.errors import InputError
from onespp.render.host.versions import versions
from tests.datasets.test_making import files

SMALL = {"sequences": 3, "frames": 2, "height": 16, "width": 24, "reference_spp": 16}


@pytest.fixture
def sbatch(tmp_path, monkeypatch) -> Path:
    """A folder where an sbatch that only takes note puts the scripts it is given."""
    pytest.importorskip("submitit")
    if sys.platform == "win32":
        pytest.skip("commands are shell scripts here")
    place = tmp_path / "bin"
    place.mkdir()
    for name, text in (("srun", ""), ("sbatch", 'n=$(ls "$(dirname "$0")" | wc -l)\ncp "$1" '
                                      '"$(dirname "$0")/$n.sh"\necho Submitted batch job 7$n')):
        (place / name).write_text(f"#!/bin/sh\n{text}\n")
        (place / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(place), prepend=":")
    return place


def test_sbatch_is_given_an_array_of_parts_and_a_step_after_it(sbatch, tmp_path, call):
    command = ("dataset", "simple", "--sequences", 3, "--out", tmp_path / "d", "--slurm", 8)
    code, out, err = call(*command, "--sbatch", "time=90", "--sbatch", "partition=cpu",
                          "--sbatch", "--cpus-per-task=4", "--sbatch", "mem=8G")
    assert code == 0, err
    assert "3 parts are jobs 72_0 to 72_2 of Slurm, and 73 ends the data set after them" in out
    array, last = ((sbatch / f"{n}.sh").read_text() for n in (2, 3))
    for line in ("--partition=cpu", "--time=90", "--mem=8G", "--cpus-per-task=4",
                 "--job-name=onespp-simple"):
        assert f"#SBATCH {line}\n" in array
        assert f"#SBATCH {line}\n" in last
    assert "#SBATCH --array=0-2%3\n" in array
    assert "--array" not in last
    assert "#SBATCH --dependency=afterany:72\n" in last
    for more, words in ((("--sbatch", "array=3"), "--sbatch array is set by --slurm itself"),
                        ((), "--slurm needs the time"),
                        (("--sbatch", "time=1:30"), "whole minutes"),
                        (("--sbatch", "time"), "use KEY=VALUE"),
                        (("--part", "1/2"), "three ways to share the work")):
        code, _, err = call(*command, *more)
        assert (code, words in err) == (2, True), err
    (sbatch / "sbatch").write_text("#!/bin/sh\necho no such partition >&2\nexit 1\n")
    code, _, err = call(*command, "--sbatch", "time=90")
    assert (code, "no such partition" in err, "Traceback" in err) == (2, True, False), err


def test_without_submitit_or_slurm_it_is_said_what_to_do(monkeypatch, tmp_path):
    data = DataSet.create(tmp_path / "d", read_plan("simple", SMALL), {})
    with pytest.raises(InputError, match="--slurm is 0: use 1 to 1000"):
        slurm.submit(data, 0, {"time": 5})
    monkeypatch.setenv("PATH", str(tmp_path))
    if "submitit" in sys.modules or pytest.importorskip("submitit"):
        with pytest.raises(InputError, match=r"could not be given to Slurm .*srun.* --part"):
            slurm.submit(data, 2, {"time": 5})
    monkeypatch.setitem(sys.modules, "submitit", None)
    with pytest.raises(InputError, match="pip install 'onespp\\[slurm\\]'"):
        slurm.submit(data, 2, {"time": 5})


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for the process in /proc")
def test_jobs_of_which_one_is_ended_and_queued_again_make_the_same_bytes(tmp_path, monkeypatch):
    """By submitit's processes; one is told to end as Slurm tells it, when it has made a frame."""
    submitit = pytest.importorskip("submitit")
    whole = onespp.dataset(read_plan("simple", SMALL), tmp_path / "one")
    data = DataSet.create(tmp_path / "jobs", whole.plan, versions("mitsuba", "drjit", "numpy"))
    begun: list[Any] = []
    works = submitit.AutoExecutor.map_array

    def map_array(self, *arguments):
        begun.extend(works(self, *arguments))
        return begun

    def end_one() -> None:
        while not list(data.place(0).rglob("frames/*.exr")):
            time.sleep(0.1)
        controller = begun[0].job_id
        process = Path(f"/proc/{controller}/task/{controller}/children").read_text().split()[0]
        os.kill(int(process), signal.SIGUSR2)

    monkeypatch.setattr(submitit.AutoExecutor, "map_array", map_array)
    ended = threading.Thread(target=end_one, daemon=True)
    ended.start()
    jobs, last = slurm.submit(data, 2, {"time": 9}, threads=1, cluster="local")
    assert last.result() == "3 made, 0 failed"
    assert [job.result() for job in jobs] == ["2 made, 0 failed", "1 made, 0 failed"]
    assert "Requeued job" in jobs[0].stderr() + jobs[0].stdout()
    made = {name: text for name, text in files(data.folder).items()
            if not name.startswith(slurm.LOGS)}
    assert made == files(whole.folder)
