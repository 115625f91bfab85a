"""The commands `train`: weights of networks from data sets."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.denoise.methods.recurrent.architecture import WIDTHS


@click.group()
def train() -> None:
    """Train a network; pip install 'onespp[train]'."""


@train.command()
@click.argument("folder", required=False, type=click.Path(path_type=Path), metavar="[DIR]")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE",
              help="The weights (.npz). Beside them: a checkpoint, the log of losses (.json), and "
              "their picture (.png).")
@click.option("--steps", type=int, default=2000, show_default=True, metavar="N", help="In all.")
@click.option("--width", type=click.Choice([*WIDTHS]), default="quarter", show_default=True,
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
def rae(folder: Path | None, out: Path, steps: int, width: str, seed: int, batch: int, crop: int,
        checkpoint: int, cache: Path | None, sequences: int) -> None:
    """Train the recurrent autoencoder on the data set in DIR.

    Without DIR one is drawn beside FILE first, by the plan `rooms`. The same command goes on where
    it was stopped, to the same weights, and with more --steps further. Use the result by `onespp
    denoise --method rae-quarter --set weights=FILE`.
    """
    from onespp.api.training import train_rae

    found = train_rae(folder, out, steps=steps, width=width, seed=seed, batch=batch, crop=crop,
                      checkpoint=checkpoint, cache=cache, sequences=sequences)
    others = "" if found.validation is None else f", {found.validation:.4f} on other scenes"
    click.echo(f"{found.steps} steps in {found.seconds / 60:.1f} minutes, loss {found.loss:.4f}"
               f"{others}: {found.weights}, {found.log}, {found.curve}")
