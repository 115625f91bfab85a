"""The command `run`: render, denoise and score in one."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource

from onespp.denoise.cli.denoise import DEFAULT_METHODS, check_methods, denoise_in
from onespp.denoise.cli.score import score_in
from onespp.render.channels import asked_channels
from onespp.render.cli.options import render_options, use
from onespp.render.cli.render import render_to

REFERENCE_ERROR = 0.05  # dB


@click.command()
@click.argument("scene")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the sequence; default data/SCENE.")
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="As for `denoise`; may be given several times.")
@render_options
@click.pass_context
def run(context: click.Context, scene: str, out: Path | None, methods: tuple[str, ...],
        device: str, threads: int | None, reference_spp: int | None, channels: str | None,
        reference_error: float | None, **options) -> None:
    """Render SCENE with ground truth, denoise it and score the result.

    References are as with --reference-error 0.05, unless their samples are given.
    """
    use(device, threads)
    named, added = asked_channels(channels)
    check_methods(methods, (*(named or ()), *added))
    if reference_spp is None and reference_error is None:
        reference_error = REFERENCE_ERROR
    sequence = render_to(scene, out, reference_spp=reference_spp, reference_error=reference_error,
                         channels=channels, **options)
    default = context.get_parameter_source("methods") == ParameterSource.DEFAULT
    denoise_in(sequence.folder, methods, default=default)
    score_in(sequence.folder)
