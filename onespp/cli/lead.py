"""The command `lead`: how far a method is ahead of a peer."""

from __future__ import annotations

import re
from pathlib import Path

import click

from onespp.denoise.own_method import result_name
from onespp.render.cli.arguments import parse_size
from onespp.render.cli.figures import json_option, show_or_print
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import parse_frames


@click.command()
@click.argument("folders", nargs=-1, type=click.Path(path_type=Path),
                metavar="[PLAIN OURS]...")
@click.option("--method", default="onespp", show_default=True, metavar="NAME")
@click.option("--peer", default="best", show_default=True, metavar="NAME",
              help="A method, or best: on each scene the best form of OIDN that was scored.")
@click.option("--suite", is_flag=True,
              help="Instead of folders: render box, room, the kept generated scenes and the hard "
              "ones, export and import some as plain frames, denoise, score, and print what is "
              "asked for and what was found. What is rendered, and peers' results, are kept.")
@click.option("--scenes", metavar="PATTERN", default=".", help="Of the suite, scenes whose name "
              "has this regular expression; default all.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("data/suite"),
              show_default=True, metavar="DIR", help="Folder of the suite's sequences.")
@click.option("--size", metavar="WxH", help="Pixels of the suite; default 256x256 for box, 320x180 "
              "for room, 160x108 for generated scenes, and the hard ones' own.")
@click.option("--frames", metavar="RANGE", default="0:10", show_default=True,
              help="Frames of the suite.")
@click.option("--reference-spp", type=int, default=512, show_default=True, metavar="N",
              help="Samples a pixel of the suite's ground truth.")
@click.option("--seed", type=int, default=2026, show_default=True, metavar="N",
              help="Seed of the suite's frames.")
@json_option
@device_option
@threads_option
def lead(folders: tuple[Path, ...], method: str, peer: str, suite: bool, scenes: str, out: Path,
         size: str | None, frames: str, reference_spp: int, seed: int,
         json_to: str | None, device: str, threads: int | None) -> None:
    """Print how far a method is ahead of a peer, from the scores of pairs of folders."""
    if not suite:
        _pairs(folders, result_name(method), result_name(peer), json_to)
        return
    if folders:
        raise InputError("--suite takes no folders: it renders its own into --out")
    use(device, threads)
    _suite(method, _pattern(scenes), out, size, frames, reference_spp, seed, json_to)


def _pairs(folders: tuple[Path, ...], method: str, peer: str, json_to: str | None) -> None:
    from onespp.denoise.score.scorecard import read_scores
    from onespp.denoise.studies.lead import markdown, measure, peer_in, psnr_of

    if len(folders) % 2 or not folders:
        raise InputError("folders come in pairs, of plain input and of ours: give "
                         + ("one more" if folders else "some, or --suite"))
    read = [read_scores(folder / "scores.json") for folder in folders]
    scenes = {folder.name: (a, b) for folder, a, b in zip(folders[1::2], read[::2], read[1::2])}

    def show() -> None:
        click.echo(markdown(method, peer, scenes))
        for name, (plain, ours) in scenes.items():
            floor = ours.headline_floor
            on_plain, on_ours = (peer_in(scores, peer, name) for scores in (plain, ours))
            click.echo(f"\n{name}: {len(ours.frames)} frames of {ours.size[0]}x{ours.size[1]}, "
                       f"reference {ours.reference_spp or 'of unknown'} spp"
                       + (" in halves" if ours.reference_halves else
                          f", floor {floor:.1f} dB" if floor is not None else ", floor not known")
                       + "".join(f"; {key} {psnr_of(s.methods[key]):.2f} dB{where}"
                                 for s, key, where in ((plain, "input", " (plain)"),
                                                       (plain, on_plain, " (plain)"),
                                                       (ours, "input", ""), (ours, on_ours, ""),
                                                       (ours, method, ""))), nl=False)
        click.echo()

    show_or_print({"method": method, "peer": peer, "figures": measure(method, peer, scenes)},
                  json_to, show)


def _suite(method: str, pattern: re.Pattern[str], out: Path, size: str | None, frames: str,
           reference_spp: int, seed: int, json_to: str | None) -> None:
    from onespp.api.studies import score_suite
    from onespp.denoise.studies.suite import figures, markdown

    found = score_suite(method, pattern, out, None if size is None else parse_size(size),
                        parse_frames(frames), reference_spp, seed)
    show_or_print(figures(result_name(method), found), json_to,
                  lambda: click.echo(markdown(result_name(method), found)))


def _pattern(text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise InputError(f"--scenes is '{text}', which is no regular expression: {error}") from None
