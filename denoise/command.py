"""The commands `denoise` and `score`."""

from __future__ import annotations

from pathlib import Path

import click

from render.command import device_option, threads_option, use
from render.errors import InputError
from render.sequence import Sequence
from render.terminal import progress

DEFAULT_METHODS = ("assignment",)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="One of `--list`, or all; may be given several times.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="A parameter of the method; may be given several times.")
@click.option("--name", metavar="NAME", help="Name of the results; default the method's.")
@click.option("--list", "list_methods", is_flag=True, is_eager=True, expose_value=False,
              callback=lambda context, _, chosen: chosen and _list(context),
              help="List the methods and their parameters, then exit.")
@device_option
@threads_option
def denoise(folder: Path, methods: tuple[str, ...], settings: tuple[str, ...], name: str | None,
            device: str, threads: int | None) -> None:
    """Denoise the sequence in FOLDER."""
    use(device, threads)
    denoise_in(folder, methods, settings, name)


def denoise_in(folder: Path, methods: tuple[str, ...], settings: tuple[str, ...] = (),
               name: str | None = None) -> None:
    """Do what the options of `denoise` ask."""
    from .methods import METHODS, build
    from .stream import denoise_sequence

    sequence = Sequence.open(folder)
    chosen = list(METHODS) if "all" in methods else list(dict.fromkeys(methods))
    if name and len(chosen) > 1:
        raise InputError(f"--name {name} is one name for {len(chosen)} methods: give one --method")
    denoisers = [(method, build(method, _pairs(settings))) for method in chosen]
    frames = sum(map(sequence.has_frame, sequence.frames))
    if not frames:
        raise InputError(f"{folder} has no frames yet: render some first")
    with progress() as begin:
        for method, denoiser in denoisers:
            steps = begin(f"denoise {name or method}", frames)
            denoise_sequence(sequence, denoiser, name or method,
                             lambda done, ms, steps=steps: steps.advance(done, f"({ms:.0f} ms)"))
    click.echo(f"denoised {frames} frames by {', '.join(name or m for m in chosen)} "
               f"into {sequence.folder / 'denoised'}")


def _pairs(settings: tuple[str, ...]) -> dict[str, str]:
    pairs = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key and equals and value):
            raise InputError(f"--set {setting} is not understood: use NAME=VALUE, as in alpha=0.1")
        pairs[key.strip()] = value.strip()
    return pairs


def _list(context: click.Context) -> None:
    from .methods import METHODS, build, parameters

    for name, method in METHODS.items():
        click.echo(f"{name}: {(method.__doc__ or '').splitlines()[0]}")
        click.echo("    " + ", ".join(f"{k}={v}" for k, v in parameters(build(name)).items()))
    context.exit()


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Score these alone; default all that have results.")
@click.option("--json", "json_to", metavar="FILE",
              help="Also write the scores to FILE; - prints them instead of the table.")
@click.option("--pictures/--no-pictures", default=True, show_default=True,
              help="Draw contact sheets, plot and movie.")
def score(folder: Path, methods: tuple[str, ...], json_to: str | None, pictures: bool) -> None:
    """Score what the sequence in FOLDER holds; write scores.json, scores.csv and pictures."""
    score_in(folder, methods, json_to, pictures)


def score_in(folder: Path, methods: tuple[str, ...] = (), json_to: str | None = None,
             pictures: bool = True) -> None:
    """Do what the options of `score` ask."""
    from render.atomic import write_text

    from .score import score as score_sequence
    from .table import print_scores

    sequence = Sequence.open(folder)
    with progress() as begin:
        parts = {}

        def report(done: int, total: int, what: str) -> None:
            if what not in parts:
                parts[what] = begin(what, total)
            parts[what].advance(done)

        scores = score_sequence(sequence, list(methods) or None, pictures, report)
    if json_to == "-":
        click.echo(scores.json_text(), nl=False)
        return
    if json_to:
        write_text(Path(json_to), scores.json_text())
    print_scores(scores)
    drawn = " and pictures/" if pictures else ""
    click.echo(f"wrote {folder / 'scores.json'}, scores.csv{drawn}")
