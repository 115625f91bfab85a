"""The command `lead`: how far a method is ahead of a peer."""

from __future__ import annotations

from pathlib import Path

import click

from onespp.render.errors import InputError


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path),
                metavar="PLAIN OURS [PLAIN OURS]...")
@click.option("--method", default="onespp", show_default=True, metavar="NAME")
@click.option("--peer", default="oidn-high", show_default=True, metavar="NAME")
def lead(folders: tuple[Path, ...], method: str, peer: str) -> None:
    """Print how far a method is ahead of a peer, from the scores of pairs of folders."""
    from onespp.denoise.score.scorecard import read_scores
    from onespp.denoise.studies.lead import markdown, psnr_of

    if len(folders) % 2:
        raise InputError("folders come in pairs, of plain input and of ours: give one more")
    read = [read_scores(folder / "scores.json") for folder in folders]
    scenes = {folder.name: (a, b) for folder, a, b in zip(folders[1::2], read[::2], read[1::2])}
    click.echo(markdown(method, peer, scenes))
    for name, (plain, ours) in scenes.items():
        floor = ours.reference_floor_db
        click.echo(f"\n{name}: {len(ours.frames)} frames of {ours.size[0]}x{ours.size[1]}, "
                   f"reference {ours.reference_spp or 'of unknown'} spp, floor "
                   + (f"{floor:.1f} dB" if floor is not None else "not known")
                   + "".join(f"; {key} {psnr_of(s.methods[key]):.2f} dB{where}"
                             for s, key, where in ((plain, "input", " (plain)"),
                                                   (plain, peer, " (plain)"), (ours, "input", ""),
                                                   (ours, peer, ""), (ours, method, ""))), nl=False)
    click.echo()
