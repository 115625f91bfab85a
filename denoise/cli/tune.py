"""`onespp tune`: the parameters of a method by measurement."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.denoise.methods.parameters import pairs, renamed_parameters, with_present_names
from onespp.denoise.metrics.tonemap import TONE_MAP
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import note, progress
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence

from .options import json_option, show_or_print


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path),
                metavar="DIR...")
@click.option("--method", default="onespp", show_default=True, metavar="NAME")
@click.option("--parameter", "names", multiple=True, metavar="NAME",
              help="Search this parameter; may be given several times. Default: all.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="Where the search starts; default the method's defaults.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE",
              help="Keep what was tried in FILE (JSON); the same command goes on from there.")
@json_option
@device_option
@threads_option
def tune(folders: tuple[Path, ...], method: str, names: tuple[str, ...],
         settings: tuple[str, ...], out: Path | None, json_to: str | None, device: str,
         threads: int | None) -> None:
    """Search parameters of a method for the best mean PSNR on the sequences in DIR.

    Give other frames and seeds than those that you report scores of.
    """
    use(device, threads)
    from onespp.denoise.catalog import build
    from onespp.denoise.studies.tune import Search, read_case, starting_point

    denoiser = build(method, pairs(settings), note=note)
    start = starting_point(denoiser)
    names = tuple(with_present_names(dict.fromkeys(names), renamed_parameters(denoiser), note))
    unknown = [name for name in names if name not in start]
    if unknown:
        raise InputError(f"method '{method}' has no parameter '{unknown[0]}': "
                         f"it has {', '.join(start) or 'none'}")
    if not start:
        raise InputError(f"method '{method}' has no parameter to search: give it one, the field of "
                         "a dataclass that is a number, or true or false")
    cases = [read_case(FrameSequence.open(folder), denoiser) for folder in folders]
    with progress() as report:
        search = Search(denoiser, cases, out, report)
        found, value = search.run(list(names) or list(start))
    changed = {k: v for k, v in found.items() if v != start[k]}

    def show() -> None:
        click.echo(f"{value:.2f} dB on {TONE_MAP}, mean over {', '.join(c.name for c in cases)}; "
                   f"{search.value(start):.2f} dB at the start; {len(search.tried)} settings tried")
        click.echo(" ".join(f"--set {k}={v}" for k, v in changed.items())
                   or "nothing better found")

    show_or_print({"method": method, "sequences": [c.name for c in cases], "psnr_srgb": value,
                   "psnr_srgb_at_start": search.value(start), "tried": len(search.tried),
                   "changed": changed}, json_to, show)
