"""The command `compare`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from onespp.api import scoring as api

from .options import json_option, show_or_print


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
    from onespp.denoise.score.compare import parse_thresholds
    from onespp.denoise.score.scorecard import read_scores

    old, new = read_scores(a), read_scores(b)
    found = api.compare(old, new, methods, parse_thresholds(
        thresholds, {**old.own_metrics, **new.own_metrics}))
    show_or_print(found.json_text(), json_to, lambda: print_comparison(found, show_all))
    if found.failed:
        sys.exit(1)
