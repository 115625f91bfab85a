"""Making data sets: many drawn animations from one plan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from onespp.datasets.files import opened
from onespp.datasets.folder import DataSet
from onespp.datasets.making import make_all
from onespp.datasets.plan import Plan, changed_plan, read_plan
from onespp.datasets.pool import make_by_pool
from onespp.datasets.slurm import LOGS, submit
from onespp.render.errors import InputError
from onespp.render.files.atomic import write_bytes
from onespp.render.files.frame_ranges import part_of
from onespp.render.host.memory import require_memory
from onespp.render.host.turns import turn
from onespp.render.host.versions import versions

from .caller import caller, public
from .rendering import checked_size


@public
def dataset(plan: str | Path | Plan, out: Path | str, *, sequences: int | None = None,
            frames: int | None = None, size: tuple[int, int] | None = None,
            seed: int | None = None, seeds: int | None = None, reference_spp: int | None = None,
            reference_error: float | None = None, changes: Mapping[str, Any] | None = None,
            part: str | None = None, dask: str | None = None, workers: int | None = None,
            threads: int | None = None, slurm: int | None = None,
            sbatch: Mapping[str, Any] | None = None) -> DataSet:
    """Make a data set: many different animated scenes, with noisy frames and references.

    What the folder holds already is not made again: the same call goes on where it was stopped, and
    one for more sequences adds them. Several processes, on one machine or on many that share the
    folder, may run the same call at once.

    Args:
        plan: "simple", "rooms" or "hard", the path of a `.toml` file, or a plan.
        out: folder of the data set.
        sequences, frames, size, seed, seeds, reference_spp, reference_error: instead of the plan's;
            how many sequences, how many frames in each, (height, width) in pixels, the seed of all
            that is drawn, how many noisy renders of each frame, and how good references are.
        changes: other settings by key, as {"draw.things": [3, 5], "split.test": 0.2}.
        part: "K/N" makes every N-th sequence only, from the K-th on.
        dask: "local" for a pool of processes here (`workers` of them, default one a core), or the
            address of a Dask scheduler whose workers see the folder by the same path.
        threads: of each worker for kernels.
        slurm: give the sequences to Slurm in so many parts, and do not wait for them. sbatch: long
            options of its command of this name, as {"partition": "cpu", "time": 60}.

    Returns:
        The data set; `status()` says how far it is, `verify()` reads everything again, and
        `onespp.Clips(folder)` gives clips to train on.

    Raises:
        InputError: a plan that cannot be used, the folder holds another one, or the disk refuses.
        KeyboardInterrupt: at the end of a step; what was finished is kept in the folder.

    Example:
        >>> import onespp, tempfile
        >>> data = onespp.dataset("simple", tempfile.mkdtemp(), sequences=1, frames=2,
        ...                       size=(16, 24), reference_spp=16)
        >>> data.status().made, data.verify()
        (1, [])
    """
    if sum(way is not None for way in (part, dask, slurm)) > 1:
        raise InputError("--part, --dask and --slurm are three ways to share the work: use one")
    made = planned(plan, sequences=sequences, frames=frames, size=size, seed=seed, seeds=seeds,
                   reference_spp=reference_spp, reference_error=reference_error, changes=changes)
    numbers = part_of(range(made.sequences), part)
    require_memory(made.height, made.width)
    if dask is None:
        with turn():
            import onespp.datasets.look  # noqa: F401  # imports Mitsuba
    who = caller()
    made = opened(made, who.inform)
    data = DataSet.create(out, made, versions("mitsuba", "drjit", "numpy"))
    if slurm is not None:
        jobs, last = submit(data, slurm, sbatch or {}, threads)
        who.inform(f"{len(jobs)} parts are jobs {jobs[0].job_id} to {jobs[-1].job_id} of Slurm, "
                   f"and {last.job_id} ends the data set after them: see {data.folder / LOGS} for "
                   "what they say, and --status")
        return data
    try:
        with who.progress() as report:
            if dask is None:
                outcome = make_all(data, numbers, report, who.tell)
            else:
                outcome = make_by_pool(data, numbers, dask, workers, threads, report, who.tell)
    finally:
        data.finish()
    for number, why in outcome.failed.items():
        who.inform(f"sequence {number} failed twice ({why}): see {data.folder}/failures")
    if outcome.elsewhere:
        who.inform(f"{len(outcome.elsewhere)} sequences are being made by other processes")
    return data


@public
def preview(plan: str | Path | Plan, count: int, out: Path, **options: Any) -> list[str]:
    """Draw a contact sheet of a plan's first `count` scenes into the PNG file `out`.

    Args:
        options: as of `dataset`.

    Returns:
        A line about each scene.
    """
    made = planned(plan, **options)
    if not 1 <= count <= 400:
        raise InputError(f"--preview is {count}: use 1 to 400")
    made = opened(made, caller().inform)
    with turn():
        from onespp.datasets.preview import preview as drawn  # imports Mitsuba
    from onespp.show.png import png

    with caller().progress() as report:
        sheet, lines = drawn(made, count, report)
    write_bytes(out, png(sheet))
    return lines


def planned(plan: str | Path | Plan, *, size: tuple[int, int] | None = None,
            changes: Mapping[str, Any] | None = None, **numbers: Any) -> Plan:
    """The plan with what is asked for in its place; InputError where that cannot be."""
    asked = {key: value for key, value in numbers.items() if value is not None}
    if size is not None:
        asked["height"], asked["width"] = checked_size(size)
    changed = {**(changes or {}), **asked}
    if isinstance(plan, Plan):
        return changed_plan(plan, changed)
    return read_plan(plan, changed)
