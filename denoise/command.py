"""The commands `denoise` and `score`."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import click
from click.core import ParameterSource

from render.command import device_option, threads_option, use
from render.errors import InputError
from render.sequence import Sequence
from render.terminal import progress

DEFAULT_METHODS = ("assignment",)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="One of `--list`, all, or oidn (its three qualities); may be "
              "given several times.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="A parameter of the method; may be given several times.")
@click.option("--name", metavar="NAME", help="Name of the results; default the method's.")
@click.option("--list", "list_methods", is_flag=True, is_eager=True, expose_value=False,
              callback=lambda context, _, chosen: chosen and _list(context),
              help="List the methods and their parameters, then exit.")
@click.option("--external", metavar="COMMAND",
              help="Instead of a method, a program that reads and writes the assignment's files, "
              "as 'PROGRAM {input} {output} {frames}'; with --name.")
@device_option
@threads_option
@click.pass_context
def denoise(context: click.Context, folder: Path, methods: tuple[str, ...],
            settings: tuple[str, ...], name: str | None, external: str | None, device: str,
            threads: int | None) -> None:
    """Denoise the sequence in FOLDER."""
    use(device, threads)
    if external is not None:
        given = context.get_parameter_source("methods") != ParameterSource.DEFAULT
        if given or settings or not name:
            raise InputError("--external takes --name, and no --method or --set")
        _denoise_externally(folder, external, name)
        return
    denoise_in(folder, methods, settings, name)


def denoise_in(folder: Path, methods: tuple[str, ...], settings: tuple[str, ...] = (),
               name: str | None = None) -> None:
    """Do what the options of `denoise` ask."""
    from .methods import build
    from .stream import denoise_sequence

    sequence = Sequence.open(folder)
    chosen = _names(methods)
    if name and len(chosen) > 1:
        raise InputError(f"--name {name} is one name for {len(chosen)} methods: give one --method")
    denoisers = [(method, build(method, _pairs(settings))) for method in chosen]
    frames = sum(map(sequence.has_frame, sequence.frames))
    if not frames:
        raise InputError(f"{folder} has no frames yet: render some first")
    paces = {}
    with progress() as begin:
        for method, denoiser in denoisers:
            steps = begin(f"denoise {name or method}", frames)
            denoise_sequence(sequence, denoiser, name or method,
                             lambda done, ms, steps=steps: steps.advance(done, f"({ms:.0f} ms)"),
                             partial(paces.__setitem__, name or method))
    for method, pace in paces.items():
        click.echo(f"{method}: {pace}")
    click.echo(f"denoised {frames} frames by {', '.join(name or m for m in chosen)} "
               f"into {sequence.folder / 'denoised'}")


def _denoise_externally(folder: Path, command: str, name: str) -> None:
    from .external import denoise_externally

    sequence = Sequence.open(folder)
    run = denoise_externally(sequence, command, name)
    click.echo(f"denoised {len(run.ms)} frames by {name} into {sequence.folder / 'denoised'} "
               f"({run.first_ms:.0f} ms a frame, files included)")


@click.command("time")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME", required=True,
              help="As for `denoise`; give two or more. Ratios are to the first.")
@click.option("--frames", type=click.IntRange(1), default=4, show_default=True, metavar="N",
              help="Frames denoised in each round, the first ones of the sequence.")
@click.option("--rounds", type=click.IntRange(1), default=5, show_default=True, metavar="N",
              help="Rounds that count; one more goes before them.")
@device_option
@threads_option
def time_(folder: Path, methods: tuple[str, ...], frames: int, rounds: int, device: str,
          threads: int | None) -> None:
    """Time methods in turns on the sequence in FOLDER; `score` then uses these times."""
    use(device, threads)
    from .interleave import time_methods
    from .methods import build

    sequence = Sequence.open(folder)
    chosen = {name: build(name) for name in _names(methods)}
    with progress() as begin:
        steps = begin("time", (rounds + 1) * min(frames, len(sequence.frames)))
        times = time_methods(sequence, chosen, frames, rounds, steps.advance)
    for name, t in times.methods.items():
        click.echo(f"{name}: {t.ms:.1f} ms ({t.ms_quartiles[0]:.1f} to {t.ms_quartiles[1]:.1f}), "
                   f"{t.ratio:.2f} times {times.ratio_to} ({t.ratio_quartiles[0]:.2f} to "
                   f"{t.ratio_quartiles[1]:.2f}), first frame {t.first_ms:.0f} ms")
    click.echo(f"medians and quartiles of {times.steps} steps; wrote {folder / 'times.json'}")


def _names(methods: tuple[str, ...]) -> list[str]:
    """The methods meant, `all` and `oidn` replaced by what they stand for."""
    from .methods import METHODS
    from .oidn import QUALITIES
    from .peers import PEERS

    groups = {"all": [*METHODS, *(name for name, peer in PEERS.items() if peer.available())],
              "oidn": [f"oidn-{quality}" for quality in QUALITIES]}
    return list(dict.fromkeys(name for m in methods for name in groups.get(m, [m])))


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
    from .peers import PEERS

    about = {name: (method.__doc__ or "").splitlines()[0] for name, method in METHODS.items()}
    about.update({name: peer.about + ("" if peer.available() else " Not available here.")
                  for name, peer in PEERS.items()})
    for name, line in about.items():
        click.echo(f"{name}: {line}")
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
@click.option("--by-cause", is_flag=True,
              help="Also show the error by cause (disoccluded, moving, ...) and by history.")
@click.option("--seeds", multiple=True, type=click.Path(path_type=Path), metavar="DIR",
              help="A render of the same with another --seed, denoised alike: splits the error "
              "into bias and variance; may be given several times.")
def score(folder: Path, methods: tuple[str, ...], json_to: str | None, pictures: bool,
          by_cause: bool, seeds: tuple[Path, ...]) -> None:
    """Score what the sequence in FOLDER holds; write scores.json, scores.csv and pictures."""
    score_in(folder, methods, json_to, pictures, by_cause, seeds)


def score_in(folder: Path, methods: tuple[str, ...] = (), json_to: str | None = None,
             pictures: bool = True, by_cause: bool = False, seeds: tuple[Path, ...] = ()) -> None:
    """Do what the options of `score` ask."""
    from render.atomic import write_text

    from .score import score as score_sequence
    from .table import print_classes, print_scores, print_splits

    sequence = Sequence.open(folder)
    others = [Sequence.open(other) for other in seeds]
    with progress() as begin:
        parts = {}

        def report(done: int, total: int, what: str) -> None:
            if what not in parts:
                parts[what] = begin(what, total)
            parts[what].advance(done)

        scores = score_sequence(sequence, list(methods) or None, pictures, report, others)
    if json_to == "-":
        click.echo(scores.json_text(), nl=False)
        return
    if json_to:
        write_text(Path(json_to), scores.json_text())
    print_scores(scores)
    if by_cause:
        print_classes(scores)
    if seeds:
        print_splits(scores)
    drawn = " and pictures/" if pictures else ""
    click.echo(f"wrote {folder / 'scores.json'}, scores.csv{drawn}")


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--channels", metavar="NAMES",
              help="Of the frames, as albedo,normal; default all. Fewer make a smaller folder.")
def report(folder: Path, channels: str | None) -> None:
    """Write a report of the scored sequence in FOLDER that opens in any browser."""
    from .report import write_report
    from .scorecard import read_scores

    sequence = Sequence.open(folder)
    if not (folder / "scores.json").exists():
        score_in(folder)
    names = channels and [name.strip() for name in channels.split(",") if name.strip()]
    with progress() as begin:
        parts = {}

        def tell(done: int, total: int, what: str) -> None:
            if what not in parts:
                parts[what] = begin(what, total)
            parts[what].advance(done)

        page = write_report(sequence, read_scores(folder / "scores.json"), names or None, tell)
    click.echo(f"wrote {page}: open it in a browser")


@click.command()
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Compare these alone; default all that both have.")
@click.option("--threshold", "thresholds", multiple=True, metavar="NAME=LIMIT",
              help="What may get worse by how much, as psnr_srgb=0.2, relmse=5% or ms=20%; may be "
                   "given several times. Default psnr_srgb=0.1, other measures 2%, time any.")
@click.option("--all", "show_all", is_flag=True, help="Also list what stayed the same.")
@click.option("--json", "json_to", metavar="FILE",
              help="Also write the comparison to FILE; - prints it instead of the table.")
def compare(a: Path, b: Path, methods: tuple[str, ...], thresholds: tuple[str, ...],
            show_all: bool, json_to: str | None) -> None:
    """Compare the scores.json A with a later B; exit 1 if something got worse past a threshold.

    Change by change, with its standard error over the frames that both have.
    """
    from render.atomic import write_text

    from .compare import comparison, parse_thresholds, print_comparison
    from .scorecard import read_scores

    found = comparison(read_scores(a), read_scores(b), list(methods) or None,
                       parse_thresholds(thresholds))
    if json_to and json_to != "-":
        write_text(Path(json_to), found.json_text())
    if json_to == "-":
        click.echo(found.json_text(), nl=False)
    else:
        print_comparison(found, show_all)
    if found.failed:
        sys.exit(1)
