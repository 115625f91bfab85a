"""The command `dataset`: many drawn animations in one folder."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api import datasets as api
from onespp.datasets.folder import DataSet
from onespp.datasets.plan import PRESETS, value_of
from onespp.render.cli.arguments import parse_size
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import progress
from onespp.render.errors import InputError


@click.command()
@click.argument("plan", required=False)
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the data set; default data/NAME, NAME that of the plan.")
@click.option("--sequences", type=int, metavar="N", help="How many; more than there are adds some.")
@click.option("--frames", type=int, metavar="N", help="Of each sequence.")
@click.option("--size", metavar="WxH", help="Pixels, as 128x128.")
@click.option("--seed", type=int, metavar="N", help="Of all that is drawn.")
@click.option("--seeds", type=int, metavar="N",
              help="Noisy renders of each frame, which share its reference.")
@click.option("--reference-spp", type=int, metavar="N", help="Samples a pixel of references.")
@click.option("--reference-error", type=float, metavar="DB",
              help="As for `render`; instead of --reference-spp.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE",
              help="Another setting of the plan, as draw.things=[3,5] or split.test=0.2; may be "
              "given several times.")
@click.option("--part", metavar="K/N", help="Every N-th sequence only, from the K-th on.")
@click.option("--dask", metavar="ADDRESS",
              help="By a pool of processes: local for one here, or the address of a Dask scheduler "
              "whose workers see the folder by the same path; pip install 'onespp[dask]'.")
@click.option("--workers", type=click.IntRange(1, 1024), metavar="N",
              help="Processes of --dask local; default one a core.")
@click.option("--slurm", type=int, metavar="K",
              help="By K jobs of Slurm and one after them, and do not wait; pip install "
              "'onespp[slurm]'.")
@click.option("--sbatch", "sbatch", multiple=True, metavar="KEY=VALUE",
              help="An option of these jobs as sbatch has it, without the dashes: time=120 (in "
              "minutes), partition=cpu, cpus-per-task=4, mem=8G; may be given several times.")
@click.option("--preview", type=int, metavar="N",
              help="Only draw a contact sheet of the first N scenes: preview.png in the folder, or "
              "DIR-preview.png while there is no data set.")
@click.option("--status", is_flag=True, help="Only say how far the data set in --out is.")
@click.option("--verify", type=click.Path(path_type=Path), metavar="DIR",
              help="Only read the data set in DIR again, and compare it with its hashes.")
@device_option
@threads_option
def dataset(plan: str | None, out: Path | None, settings: tuple[str, ...], preview: int | None,
            status: bool, verify: Path | None, device: str, threads: int | None, size: str | None,
            part: str | None, dask: str | None, workers: int | None, slurm: int | None,
            sbatch: tuple[str, ...], **numbers) -> None:
    """Make a data set by PLAN: simple, rooms, hard, or a TOML file.

    Running the same command again makes what is missing, also at the same time on several machines
    that share the folder. A sequence that fails is tried twice and listed; the others go on.
    """
    if verify is not None:
        _verify(DataSet.open(verify))
        return
    if status and out is not None:
        click.echo(str(DataSet.open(out).status()))
        return
    if plan is None:
        raise InputError(f"there is no PLAN: use {', '.join(PRESETS)}, or a .toml file")
    options = {**numbers, "size": None if size is None else parse_size(size),
               "changes": dict(map(value_of, settings))}
    planned = api.planned(plan, **options)
    folder = out or Path("data") / planned.name
    if status:
        click.echo(str(DataSet.open(folder).status()))
        return
    use(device, threads if dask is None and slurm is None else None)
    if preview is not None:
        # Beside the folder while there is no data set: a folder that holds other files is refused.
        sheet = (folder / "preview.png" if (folder / "dataset.json").exists()
                 else folder.with_name(f"{folder.name}-preview.png"))
        for line in api.preview(planned, preview, sheet):
            click.echo(line)
        click.echo(f"drew {preview} scenes into {sheet}")
        return
    data = api.dataset(planned, folder, part=part, dask=dask, workers=workers, threads=threads,
                       slurm=slurm, sbatch=dict(map(option_of, sbatch)))
    if slurm is not None:
        return
    found = data.status()
    click.echo(f"{data.folder}: {found}")
    if found.failed:
        raise InputError(f"{len(found.failed)} of {data.plan.sequences} sequences could not be "
                         f"made: see {data.folder}/failures, then run the same command again")


def option_of(text: str) -> tuple[str, str]:
    """The key and the value of 'KEY=VALUE'; InputError if it is none."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip("- ") or not value.strip():
        raise InputError(f"--sbatch {text} is not understood: use KEY=VALUE, as time=120")
    return key.strip("- "), value.strip()


def _verify(data: DataSet) -> None:
    with progress() as report:
        wrong = data.verify(report)
    for sentence in wrong:
        click.echo(sentence)
    if wrong:
        raise InputError(f"{data.folder} is not whole: {len(wrong)} things are wrong")
    click.echo(f"{data.folder} is whole: all {data.plan.sequences} sequences are as they were "
               "written")
