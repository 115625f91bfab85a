"""Making a data set by jobs of Slurm: an array of parts, and a step after them for what they left.

Through submitit, which writes the scripts, gives each job its arguments, and keeps what it said and
raised. A part that Slurm ends, at its limit of time or because others go before it, is queued again
by submitit (`Part.checkpoint`) and goes on with what is whole. The step after them waits for their
end by Slurm's `dependency`, so that nothing has to run meanwhile.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import part_of
from onespp.render.host import backend

from .folder import DataSet
from .making import in_a_line, make_all

SLURM = "slurm"
LOGS = ".jobs"
_MOST_PARTS = 1000  # Slurm's own limit of an array, unless its administrator has changed it
_MOST_TIMEOUTS = 100
_OURS = ("job-name", "array", "dependency", "output", "error", "signal", "open-mode", "nodes",
         "ntasks-per-node")


class Part:
    """What a job does: make the sequences of a part "K/N"; None: whatever is missing, and say so
    if something still is, then."""

    def __call__(self, folder: str, part: str | None, threads: int | None) -> str:
        own = os.environ.get("SLURM_CPUS_PER_TASK", "")
        backend.set_threads(threads or (int(own) if own.isdigit() else None))
        data = DataSet.open(Path(folder))
        outcome = make_all(data, part_of(range(data.plan.sequences), part), tell=print)
        if part is None:
            data.finish()
            if data.status().left:
                raise InputError(f"{folder}: {data.status()}")
        return f"{len(outcome.made)} made, {len(outcome.failed)} failed"

    def checkpoint(self, *arguments: Any) -> Any:
        """The job that goes on for one that Slurm ends: the same."""
        from submitit.helpers import DelayedSubmission

        return DelayedSubmission(self, *arguments)


def submit(data: DataSet, parts: int, settings: Mapping[str, Any], threads: int | None = None,
           cluster: str = SLURM) -> tuple[list[Any], Any]:
    """Give a data set's sequences to Slurm, in parts.

    Args:
        parts: how many jobs. settings: sbatch's long options, as {"partition": "cpu", "time": 60,
            "mem": "8G", "cpus-per-task": 4}; time in minutes.
        threads: of each job for kernels; default: its `cpus-per-task`.
        cluster: "local": by processes here, for tests, which the step after them is started behind.

    Returns:
        The jobs of the parts, and the job of the step after them; submitit's.

    Raises:
        InputError: submitit is not installed, there is no Slurm, or it refuses the jobs.
    """
    if not 1 <= parts <= _MOST_PARTS:
        raise InputError(f"--slurm is {parts}: use 1 to {_MOST_PARTS} parts")
    parts = min(parts, data.plan.sequences)
    folder = str(data.folder.resolve())
    try:
        executor = _executor(data, settings, cluster)
        jobs = executor.map_array(Part(), [folder] * parts,
                                  [f"{k + 1}/{parts}" for k in range(parts)], [threads] * parts)
        if cluster == SLURM:
            array = str(jobs[0].job_id).partition("_")[0]
            executor.update_parameters(slurm_dependency=f"afterany:{array}")
        else:
            for job in jobs:
                job.wait()
        return jobs, executor.submit(Part(), folder, None, threads)
    except (RuntimeError, OSError) as error:  # submitit's own are among them
        raise InputError(f"the jobs could not be given to Slurm ({in_a_line(error)}): run this "
                         "where sbatch and srun are, or use --part") from error


def _executor(data: DataSet, settings: Mapping[str, Any], cluster: str) -> Any:
    try:
        from submitit import AutoExecutor
    except ImportError:
        raise InputError("--slurm needs submitit, which is not installed: pip install "
                         "'onespp[slurm]'") from None
    known, others = {}, {}
    for key, value in settings.items():
        if key in _OURS:
            raise InputError(f"--sbatch {key} is set by --slurm itself: leave it out")
        if key == "time":
            if not str(value).isdigit() or int(value) < 1:
                raise InputError(f"--sbatch time is {value}: use whole minutes, as time=120")
            known["slurm_time"] = int(value)
        else:
            others[key] = value
    if "time" not in settings:
        raise InputError("--slurm needs the time that a job may take: --sbatch time=MINUTES (one "
                         "that is not done by then is queued again, and goes on)")
    executor = AutoExecutor(data.folder / LOGS, cluster=cluster,
                            slurm_max_num_timeout=_MOST_TIMEOUTS)
    executor.update_parameters(name=f"onespp-{data.plan.name}", timeout_min=known["slurm_time"],
                               slurm_array_parallelism=_MOST_PARTS,
                               slurm_additional_parameters=others, **known)
    return executor
