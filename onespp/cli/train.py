"""The commands `train`: weights of networks from data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from onespp.denoise.methods.learned.architecture import WIDTHS, Architecture
from onespp.denoise.methods.learned.networks import NETWORKS


@click.group()
def train() -> None:
    """Train a network; pip install 'onespp[train]'."""


def _command(kind: Architecture) -> click.Command:
    @click.command(kind.name, help=f"""Train {kind.about} on the data set in DIR.

    Without DIR one is drawn beside FILE first, by the plan `rooms`. The same command goes on where
    it was stopped, to the same weights, and with more --steps further. Use the result by `onespp
    denoise --method {kind.name}-{kind.width} --set weights=FILE`.
    """)
    @click.argument("folder", required=False, type=click.Path(path_type=Path), metavar="[DIR]")
    @click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE",
                  help="The weights (.npz). Beside them: a checkpoint, the log of losses (.json), "
                  "and their picture (.png).")
    @click.option("--steps", type=int, default=2000, show_default=True, metavar="N",
                  help="In all.")
    @click.option("--width", type=click.Choice([*WIDTHS]), default=kind.width, show_default=True,
                  help="Share of the published numbers of features.")
    @click.option("--seed", type=int, default=0, show_default=True, metavar="N",
                  help="Of the first weights and of all batches.")
    @click.option("--batch", type=int, default=4, show_default=True, metavar="N",
                  help="Clips of seven frames a step.")
    @click.option("--crop", type=int, default=128, show_default=True, metavar="PIXELS",
                  help="Side of a clip, a multiple of 32.")
    @click.option("--checkpoint", type=int, default=100, show_default=True, metavar="N",
                  help="Steps between checkpoints.")
    @click.option("--cache", type=click.Path(path_type=Path), metavar="FOLDER",
                  help="Keep decoded frames there, which are read quicker.")
    @click.option("--sequences", type=int, default=100, show_default=True, metavar="N",
                  help="Of the data set that is drawn where no DIR is given.")
    @click.option("--result", default="", metavar="NAME",
                  help="Train on what `onespp denoise` has made of all sequences in DIR under this "
                  "name, in the place of their noisy frames.")
    def run(folder: Path | None, out: Path, **options: Any) -> None:
        from onespp.api.training import train_network

        found = train_network(kind.name, folder, out, **options)
        others = "" if found.validation is None else f", {found.validation:.4f} on other scenes"
        click.echo(f"{found.steps} steps in {found.seconds / 60:.1f} minutes, loss "
                   f"{found.loss:.4f}{others}: {found.weights}, {found.log}, {found.curve}")

    return run


@train.command()
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE",
              help="Also draw their losses into FILE (.png).")
def losses(logs: tuple[Path, ...], plot: Path | None) -> None:
    """Compare trainings by their logs (.json), and print the spread over seeds."""
    from onespp.training.log import read_logs, table

    read = read_logs(logs)
    click.echo(table(read))
    if plot is not None:
        from onespp.training.curve import draw_curves

        draw_curves(read, plot)


for _kind in NETWORKS.values():
    train.add_command(_command(_kind))
