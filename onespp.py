"""The command line: scene, frame, file, denoiser, score."""

from __future__ import annotations

import sys
from pathlib import Path

import click

import render.command
from denoise.bench_command import bench
from denoise.command import DEFAULT_METHODS, denoise, denoise_in, time_
from denoise.score_command import compare, report, score, score_in
from render.terminal import BAD_INPUT
from render.terminal import run as run_command

REFERENCE_SPP = 256


@click.group()
@click.version_option(package_name="onespp")
def app() -> None:
    """Render animations at one sample per pixel, denoise them, score the result."""


@app.command()
def scenes() -> None:
    """List the scenes: frames, size, what moves."""
    from scenes import catalog

    for name in catalog.SCENES:
        scene = catalog.load(name)
        click.echo(f"{name}: {scene.about}\n"
                   f"    {scene.frames} frames of {scene.width}x{scene.height} at {scene.fps} fps, "
                   f"{len(scene.shapes)} shapes, paths of up to {scene.max_depth} segments\n"
                   f"    moves: {', '.join(scene.moving) or 'nothing'}")


@app.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="As for `denoise`; may be given several times.")
@render.command.render_options
def run(scene: str, out: Path | None, methods: tuple[str, ...], device: str, threads: int | None,
        reference_spp: int | None, **options) -> None:
    """Render SCENE with ground truth, denoise it and score the result."""
    render.command.use(device, threads)
    spp = REFERENCE_SPP if reference_spp is None else reference_spp
    sequence = render.command.render_to(scene, out, reference_spp=spp, **options)
    denoise_in(sequence.folder, methods)
    score_in(sequence.folder)


@app.command()
def doctor() -> None:
    """Say what will run on this machine, and what to do about what won't."""
    from render.doctor import examine

    marks = {"ok": "ok   ", "note": "note ", "bad": "BAD  "}
    findings = list(examine())
    for finding in findings:
        click.echo(f"{marks[finding.state]} {finding.subject}: {finding.text}")
    if any(finding.state == "bad" for finding in findings):
        sys.exit(BAD_INPUT)


for command in (render.command.render, denoise, time_, score, report, compare, bench,
                render.command.import_, render.command.export):
    app.add_command(command)


def main() -> None:
    """Entry point of the console command."""
    run_command(app)


if __name__ == "__main__":
    main()
