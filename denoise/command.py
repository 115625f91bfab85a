"""The commands `denoise` and `time`."""

from __future__ import annotations

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
