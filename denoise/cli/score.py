"""The commands `score`, `report` and `compare`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from onespp.render.cli.terminal import command_line, named_progress
from onespp.render.files.lock import writing
from onespp.render.files.sequence import Sequence

from .options import json_option, show_or_print


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Score these alone; default all that have results.")
@json_option
@click.option("--pictures/--no-pictures", default=True, show_default=True,
              help="Draw contact sheets, plot and movie.")
@click.option("--by-cause", is_flag=True,
              help="Also show the error by cause (disoccluded, moving, ...) and by history.")
@click.option("--seeds", multiple=True, type=click.Path(path_type=Path), metavar="DIR",
              help="A render of the same with another --seed, denoised alike: splits the error "
              "into bias and variance; may be given several times.")
def score(folder: Path, methods: tuple[str, ...], json_to: str | None, pictures: bool,
          by_cause: bool, seeds: tuple[Path, ...]) -> None:
    """Score what the sequence in FOLDER holds; write scores.json, scores.csv and pictures."""
    score_in(folder, methods, json_to, pictures, by_cause, seeds)


def score_in(folder: Path, methods: tuple[str, ...] = (), json_to: str | None = None,
             pictures: bool = True, by_cause: bool = False, seeds: tuple[Path, ...] = ()) -> None:
    """Do what the options of `score` ask."""
    from onespp.denoise.report.terminal import print_classes, print_scores, print_splits
    from onespp.denoise.score.sequence import score as score_sequence

    sequence = Sequence.open(folder)
    others = [Sequence.open(other) for other in seeds]
    with writing(folder, "score"), named_progress() as report:
        scores = score_sequence(sequence, list(methods) or None, pictures, report, others,
                                command_line())

    def show() -> None:
        print_scores(scores)
        if by_cause:
            print_classes(scores)
        if seeds:
            print_splits(scores)
        drawn = " and pictures/" if pictures else ""
        click.echo(f"wrote {folder / 'scores.json'}, scores.csv{drawn}")

    show_or_print(scores.json_text(), json_to, show)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--channels", metavar="NAMES",
              help="Of the frames, as albedo,normal; default all. Fewer make a smaller folder.")
def report(folder: Path, channels: str | None) -> None:
    """Write a report of the scored sequence in FOLDER that opens in any browser."""
    from onespp.denoise.report.html import write_report
    from onespp.denoise.score.scorecard import read_scores

    sequence = Sequence.open(folder)
    if not (folder / "scores.json").exists():
        score_in(folder)
    names = channels and [name.strip() for name in channels.split(",") if name.strip()]
    with writing(folder, "report"), named_progress() as tell:
        page = write_report(sequence, read_scores(folder / "scores.json"), names or None, tell,
                            command_line())
    click.echo(f"wrote {page}: open it in a browser")


@click.command()
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Compare these alone; default all that both have.")
@click.option("--threshold", "thresholds", multiple=True, metavar="NAME=LIMIT",
              help="What may get worse by how much, as psnr_srgb=0.2, relmse=5% or ms=20%; may be "
                   "given several times. Default psnr_srgb=0.1, other measures 2%, time any.")
@click.option("--all", "show_all", is_flag=True, help="Also list what stayed the same.")
@json_option
def compare(a: Path, b: Path, methods: tuple[str, ...], thresholds: tuple[str, ...],
            show_all: bool, json_to: str | None) -> None:
    """Compare the scores.json A with a later B; exit 1 if something got worse past a threshold.

    Change by change, with its standard error over the frames that both have.
    """
    from onespp.denoise.report.comparison import print_comparison
    from onespp.denoise.score.compare import comparison, parse_thresholds
    from onespp.denoise.score.scorecard import read_scores

    found = comparison(read_scores(a), read_scores(b), list(methods) or None,
                       parse_thresholds(thresholds))
    show_or_print(found.json_text(), json_to, lambda: print_comparison(found, show_all))
    if found.failed:
        sys.exit(1)
