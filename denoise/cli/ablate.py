"""The command `ablate`: what each part of a method is worth."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.denoise.metrics.tonemap import TONE_MAP
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import progress
from onespp.render.files.sequence import FrameSequence

from .options import json_option, show_or_print


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path),
                metavar="DIR...")
@click.option("--method", default="svgf", show_default=True, metavar="NAME")
@json_option
@device_option
@threads_option
def ablate(folders: tuple[Path, ...], method: str, json_to: str | None, device: str,
           threads: int | None) -> None:
    """Print what each part of a method is worth on the sequences in DIR, as Markdown."""
    use(device, threads)
    from onespp.denoise.studies.ablation import ablate as ablate_sequence
    from onespp.denoise.studies.ablation import markdown, variants

    methods, results, notes = variants(method), {}, []
    with progress() as report:
        for folder in folders:
            sequence = FrameSequence.open(folder)
            results[folder.name] = ablate_sequence(sequence, methods, report)
            m = sequence.manifest
            made = "imported" if m.direct is None else (
                f"seed {m.seed}, --direct {m.direct} --sampler {m.sampler}")
            notes.append(f"{folder.name}: {m.scene}, {len(m.frames)} frames of "
                         f"{m.width}x{m.height}, {made}, "
                         f"reference {m.reference_spp or 'of unknown'} spp")

    def show() -> None:
        click.echo(markdown(method, results))
        click.echo("\n" + "; ".join(notes) + f"; means over frames, PSNR on {TONE_MAP}.")

    show_or_print({"method": method, "tone_map": TONE_MAP, "sequences": results}, json_to, show)
