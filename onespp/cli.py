"""The command line: scene, frame, file, denoiser, score."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import click
from click.core import ParameterSource

import onespp.render.cli.render
from onespp.denoise.cli.bench import bench
from onespp.denoise.cli.compare import compare
from onespp.denoise.cli.denoise import DEFAULT_METHODS, denoise, denoise_in
from onespp.denoise.cli.report import report
from onespp.denoise.cli.score import score, score_in
from onespp.denoise.cli.time import time_
from onespp.denoise.cli.tune import tune
from onespp.render.cli.terminal import BAD_INPUT, Steps, progress
from onespp.render.cli.terminal import run as run_command

REFERENCE_SPP = 256


@click.group()
@click.version_option(package_name="onespp")
def app() -> None:
    """Render animations at one sample per pixel, denoise them, score the result."""


@app.command()
def scenes() -> None:
    """List the scenes: frames, size, what moves."""
    from onespp.scenes.hard import HARD

    from .scenes import catalog

    for name in catalog.SCENES:
        scene = catalog.load(name)
        click.echo(f"{name}: {scene.about}\n"
                   f"    {scene.frames} frames of {scene.width}x{scene.height} at {scene.fps} fps, "
                   f"{len(scene.shapes)} shapes, paths of up to {scene.max_depth} segments\n"
                   f"    moves: {', '.join(scene.moving) or 'nothing'}")
    click.echo("\nSmall scenes that each isolate one failure; `onespp hard` tries methods on them:")
    for hard_one in HARD.values():
        scene = hard_one.make()
        click.echo(f"    {scene.name}: {scene.about}")


@app.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", default=Path("data/hard"),
              show_default=True, help="Folder of the sequences.")
@click.option("--reference-spp", type=int, default=REFERENCE_SPP, show_default=True, metavar="N",
              help="Samples a pixel of the ground truth.")
@onespp.render.cli.options.device_option
@onespp.render.cli.options.threads_option
def hard(names: tuple[str, ...], out: Path, reference_spp: int, device: str,
         threads: int | None) -> None:
    """Try every method on hard scenes (all, or those named), and print a table in Markdown.

    Renders what is missing. For each scene and method: error, what its history gains, how soon it
    recovers from a sudden change, and whether it keeps the energy.
    """
    onespp.render.cli.options.use(device, threads)
    from onespp.denoise.studies.hard_scenes import markdown
    from onespp.scenes.hard import HARD

    from .scenes import catalog

    unknown = [name for name in names if name not in HARD]
    if unknown:
        catalog.load(f"hard/{unknown[0]}")  # says what there is
    rows = []
    with progress() as begin:
        steps = begin("hard scenes", len(names or HARD))
        for number, name in enumerate(names or HARD):
            rows += _judge_hard(name, out, reference_spp, partial(_within, steps, number, name))
    click.echo(markdown(rows))


def _judge_hard(name: str, out: Path, reference_spp: int, advance: Callable[[float], None]) -> list:
    """Rows of one hard scene; `advance` is told the share that is done."""
    from onespp.denoise.catalog import METHODS
    from onespp.denoise.studies.hard_scenes import judge
    from onespp.render.job import RenderJob, kept_references, render_sequence
    from onespp.scenes.hard import HARD

    hard = HARD[name]
    scene = hard.make()
    job = RenderJob(scene, range(scene.frames), scene.height, scene.width,
                    reference_spp=reference_spp)
    needed = {channel for method in METHODS.values() for channel in method.needs}
    job = replace(job, channels=tuple(dict.fromkeys((*job.channel_names(), *sorted(needed)))))
    sequence = render_sequence(job, out / name, on_references=lambda done, _: advance(
        0.5 * done / scene.frames))
    if kept := kept_references(sequence, sequence.frames, reference_spp):
        click.echo(f"{name}: {kept}", err=True)
    judged = iter(range(1, len(METHODS) + 2))
    return judge(sequence, name, hard.event, hard.diffuse,
                 lambda: advance(0.5 + 0.5 * next(judged) / (len(METHODS) + 1)))


def _within(steps: Steps, number: int, name: str, part: float) -> None:
    steps.advance(number + part, name)


@app.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="As for `denoise`; may be given several times.")
@onespp.render.cli.options.render_options
@click.pass_context
def run(context: click.Context, scene: str, out: Path | None, methods: tuple[str, ...],
        device: str, threads: int | None, reference_spp: int | None, **options) -> None:
    """Render SCENE with ground truth, denoise it and score the result."""
    onespp.render.cli.options.use(device, threads)
    spp = REFERENCE_SPP if reference_spp is None else reference_spp
    sequence = onespp.render.cli.render.render_to(scene, out, reference_spp=spp, **options)
    default = context.get_parameter_source("methods") == ParameterSource.DEFAULT
    denoise_in(sequence.folder, methods, default=default)
    score_in(sequence.folder)


@app.command()
def doctor() -> None:
    """Say what will run on this machine, and what to do about what won't."""
    from onespp.render.host.doctor import examine

    marks = {"ok": "ok   ", "note": "note ", "bad": "BAD  "}
    findings = list(examine())
    for finding in findings:
        click.echo(f"{marks[finding.state]} {finding.subject}: {finding.text}")
    if any(finding.state == "bad" for finding in findings):
        sys.exit(BAD_INPUT)


for command in (onespp.render.cli.render.render, denoise, time_, score, report, compare, bench, tune,
                onespp.render.cli.render.import_, onespp.render.cli.render.export):
    app.add_command(command)


def main() -> None:
    """Entry point of the console command."""
    run_command(app)


if __name__ == "__main__":
    main()
