"""The command line: scene, frame, file, denoiser, score."""

from __future__ import annotations

import click

from onespp.denoise.cli.ablate import ablate
from onespp.denoise.cli.bench import bench
from onespp.denoise.cli.check import check
from onespp.denoise.cli.compare import compare
from onespp.denoise.cli.denoise import denoise
from onespp.denoise.cli.report import report
from onespp.denoise.cli.score import score
from onespp.denoise.cli.time import time_
from onespp.denoise.cli.truth import truth
from onespp.denoise.cli.tune import tune
from onespp.denoise.cli.view import view
from onespp.render.cli.imports import import_
from onespp.render.cli.render import export, render
from onespp.render.cli.terminal import run as run_command

from .bench_clips import bench_clips
from .completion import completion
from .dataset import dataset
from .doctor import doctor
from .hard import hard
from .lead import lead
from .new import new
from .run import run
from .scenes import scenes
from .train import train

EXIT_CODES = {
    "": "Exit codes: 0 done, 2 bad input or a machine that lacks something, 130 interrupted.",
    "compare": "Exit codes: 0 nothing got worse, 1 something did, 2 bad input, 130 interrupted.",
    "doctor": "Exit codes: 0 all that is needed runs, 2 something does not, 130 interrupted.",
}


@click.group(epilog=EXIT_CODES[""])
@click.version_option(package_name="onespp")
def app() -> None:
    """Render animations at one sample per pixel, denoise them, score the result."""


for command in (scenes, render, denoise, time_, score, run, report, view, compare, bench, tune,
                ablate, lead, truth, hard, dataset, train, import_, check, export, new, doctor,
                completion):
    command.epilog = EXIT_CODES.get(command.name or "", EXIT_CODES[""])
    app.add_command(command)
bench.add_command(bench_clips)
for command in (*bench.commands.values(), *train.commands.values()):
    command.epilog = EXIT_CODES[""]


def main() -> None:
    """Entry point of the console command."""
    run_command(app)
