"""The commands `score`, `report` and `compare`."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.api import scoring as api
from onespp.render.files.sequence import FrameSequence

from .options import json_option, show_or_print


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Score these alone; default all that have results.")
@click.option("--metric", "metrics", multiple=True, metavar="NAME",
              help="Also measure this one: a file of your own, as my_metric.py or "
              "my_metric.py:edge_error, or an installed one; may be given several times.")
@json_option
@click.option("--pictures/--no-pictures", default=True, show_default=True,
              help="Draw contact sheets, plot and movie.")
@click.option("--movie/--no-movie", default=None,
              help="Insist on the movie, or leave it out; default: make it where PyAV is "
              "(`pip install 'onespp[movie]'`).")
@click.option("--by-cause", is_flag=True,
              help="Also show the error by cause (disoccluded, moving, ...) and by history.")
@click.option("--seeds", multiple=True, type=click.Path(path_type=Path), metavar="DIR",
              help="A render of the same with another --seed, denoised alike: splits the error "
              "into bias and variance; may be given several times.")
def score(folder: Path, methods: tuple[str, ...], metrics: tuple[str, ...], json_to: str | None,
          pictures: bool, movie: bool | None, by_cause: bool, seeds: tuple[Path, ...]) -> None:
    """Score what the sequence in FOLDER holds; write scores.json, scores.csv and pictures."""
    score_in(folder, methods, json_to, pictures, by_cause, seeds, movie, metrics)


def score_in(folder: Path, methods: tuple[str, ...] = (), json_to: str | None = None,
             pictures: bool = True, by_cause: bool = False, seeds: tuple[Path, ...] = (),
             movie: bool | None = None, metrics: tuple[str, ...] = ()) -> None:
    """Do what the options of `score` ask."""
    from onespp.denoise.report.terminal import print_classes, print_scores, print_splits

    scores = api.score(FrameSequence.open(folder), methods, metrics=metrics, pictures=pictures,
                       seeds=[FrameSequence.open(other) for other in seeds], movie=movie)

    def show() -> None:
        print_scores(scores)
        if by_cause:
            print_classes(scores)
        if seeds:
            print_splits(scores)
        drawn = " and pictures/" if pictures else ""
        click.echo(f"wrote {folder / 'scores.json'}, scores.csv{drawn}")

    show_or_print(scores.json_text(), json_to, show)
