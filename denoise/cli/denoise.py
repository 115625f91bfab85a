"""The commands `denoise` and `time`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from onespp.denoise.methods.parameters import pairs
from onespp.denoise.own_method import result_name
from onespp.render.channels import REPLAY, SPLIT
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import command_line, note, progress
from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.manifest import check_result_name
from onespp.render.files.sequence import FrameSequence
from onespp.render.games202.layout import gaps

if TYPE_CHECKING:
    from onespp.denoise.catalog import Method

DEFAULT_METHODS = ("onespp",)
BETTER_ON_PLAIN = ("temporal-oidn", "oidn-high")
"""On most frames without visibility apart, as imported ones: up to 4 dB, if not on all."""


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--method", "methods", multiple=True, metavar="NAME", default=DEFAULT_METHODS,
              show_default=True, help="One of `--list`, all, oidn (its three qualities), or a "
              "file of your own, as my_filter.py or my_filter.py:MyFilter; may be given several "
              "times.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE",
              help="A parameter of the method; may be given several times.")
@click.option("--outliers", type=float, metavar="K",
              help="Before the method, clamp each pixel to K standard "
              "deviations from the mean of its neighbours on the same surface, as 3.")
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
            settings: tuple[str, ...], outliers: float | None, name: str | None,
            external: str | None, device: str, threads: int | None) -> None:
    """Denoise the sequence in FOLDER."""
    use(device, threads)
    if external is not None:
        given = context.get_parameter_source("methods") != ParameterSource.DEFAULT
        if given or settings or outliers is not None or not name:
            raise InputError("--external takes --name, and no --method, --set or --outliers")
        _denoise_externally(folder, external, name)
        return
    default = context.get_parameter_source("methods") == ParameterSource.DEFAULT
    denoise_in(folder, methods, settings, name, outliers, default)


def denoise_in(folder: Path, methods: tuple[str, ...], settings: tuple[str, ...] = (),
               name: str | None = None, outliers: float | None = None,
               default: bool = False) -> None:
    """Do what the options of `denoise` ask; `default`: nobody chose the methods."""
    from onespp.denoise.catalog import OUTLIERS
    from onespp.denoise.run.sequence import denoise_sequence

    sequence = FrameSequence.open(folder)
    chosen = method_names(methods)
    if name is not None and len(chosen) > 1:
        raise InputError(f"--name {name} is one name for {len(chosen)} methods: give one --method")
    denoisers = {made + (OUTLIERS if outliers is not None else "") if name is None else name: method
                 for made, method in built(chosen, pairs(settings), outliers).items()}
    for name, denoiser in denoisers.items():
        _check_replay(name, denoiser.needs, sequence.channels, str(folder))
    frames = sum(map(sequence.has_frame, sequence.frames))
    if not frames:
        raise InputError(f"{folder} has no frames yet: render some first")
    paces, runs = {}, {}
    with progress() as report:
        for name, denoiser in denoisers.items():
            with writing(folder, f"denoise-{name}"):
                runs[name] = denoise_sequence(sequence, denoiser, name, report,
                                              partial(paces.__setitem__, name), command_line())
    for name, pace in paces.items():
        click.echo(f"{name}: {pace}")
    for name, run in runs.items():
        if run.energy_kept is not None:
            click.echo(f"{name}: removing outliers took {1 - run.energy_kept:.2%} of the energy")
    for line in _what_to_know(sequence, default):
        click.echo(line)
    click.echo(f"denoised {frames} frames by {', '.join(runs)} "
               f"into {sequence.folder / 'denoised'}")


def check_methods(methods: tuple[str, ...], channels: tuple[str, ...]) -> None:
    """InputError for methods that `denoise_in` would refuse for frames with these channels asked
    for: said before hours of rendering."""
    from onespp.denoise.catalog import check_not_a_method, name_of

    for name, method in built(method_names(methods)).items():
        check_result_name(name)
        check_not_a_method(name, name_of(method))
        _check_replay(name, method.needs, channels, "this run")


def built(methods: Iterable[str], settings: Mapping[str, str] | None = None,
          outliers: float | None = None) -> dict[str, Method]:
    """Name of its results -> method; InputError where two would be called the same."""
    from onespp.denoise.catalog import build

    found: dict[str, Method] = {}
    for name in methods:
        called = result_name(name)
        if called in found:
            raise InputError(f"the results of two methods would be called '{called}': denoise by "
                             f"one of them after the other, {name} with a --name of its own")
        found[called] = build(name, settings, outliers, note)
    return found


def _check_replay(name: str, needs: Iterable[str], channels: Iterable[str], who: str) -> None:
    if set(REPLAY) & set(needs) - set(channels):
        raise InputError(f"{name} needs the channels {' and '.join(REPLAY)}, which {who} "
                         "lacks: render it with --channels +gradient")


def _what_to_know(sequence: FrameSequence, default: bool) -> Iterator[str]:
    """What a user may not know of these frames, a sentence each; `default`: of the method, too."""
    if default and not set(SPLIT) <= set(sequence.channels):
        from onespp.denoise.catalog import PEERS

        install = "" if all(PEERS[name].available() for name in BETTER_ON_PLAIN) else (
            ", with Open Image Denoise installed (pip install 'onespp[oidn]')")
        yield (f"these frames lack {' and '.join(SPLIT)}, on which the default method builds: "
               f"without them --method {' or '.join(BETTER_ON_PLAIN)} is often better{install}")
    for a, b in _gaps(sequence):
        yield (f"there is no frame between {a} and {b}: methods with a history took {b} for the "
               f"frame after {a}")


def _gaps(sequence: FrameSequence) -> list[tuple[int, int]]:
    """Neighbours between which frames are missing; a stride that was asked for misses none."""
    there = [i for i in sequence.frames if sequence.has_frame(i)]
    known = gaps(there) if sequence.manifest.source == "games202" else []
    return [(a, b) for a, b in pairwise(there)
            if (a, b) in known or any(a < i < b for i in sequence.frames)]


def _denoise_externally(folder: Path, command: str, name: str) -> None:
    from onespp.denoise.run.external import denoise_externally

    sequence = FrameSequence.open(folder)
    with writing(folder, f"denoise-{name}"):
        run = denoise_externally(sequence, command, name, command_line())
    click.echo(f"denoised {len(run.ms)} frames by {name} into {sequence.folder / 'denoised'} "
               f"({run.first_ms:.0f} ms a frame, files included)")


def method_names(methods: tuple[str, ...]) -> list[str]:
    """The methods meant, `all` and `oidn` replaced by what they stand for."""
    from onespp.denoise.catalog import METHODS, PEERS
    from onespp.denoise.peers.oidn import QUALITIES

    groups = {"all": [*METHODS, *(name for name, peer in PEERS.items() if peer.available())],
              "oidn": [f"oidn-{quality}" for quality in QUALITIES]}
    return list(dict.fromkeys(name for m in methods for name in groups.get(m, [m])))


def _list(context: click.Context) -> None:
    from onespp.denoise.catalog import METHODS, PEERS, build, parameters
    from onespp.denoise.own_method import about_own, offers

    about = {name: (method.__doc__ or "").splitlines()[0] for name, method in METHODS.items()}
    about.update({name: peer.about + ("" if peer.available() else " Not available here.")
                  for name, peer in PEERS.items()})
    for name, line in about.items():
        click.echo(f"{name}: {line}")
        click.echo("    " + ", ".join(f"{k}={v}" for k, v in parameters(build(name)).items()))
    for offer in offers():
        if offer.name in about:
            click.echo(f"{offer.name} of the package {offer.package} {offer.version} is hidden by "
                       "ours of that name")
            continue
        try:
            method = build(offer.name)
        except InputError as error:  # one broken package does not keep the others from view
            click.echo(f"{offer.name}: not usable, {error}")
            continue
        click.echo(f"{offer.name}: {about_own(method)}Of the package {offer.package} "
                   f"{offer.version}.")
        click.echo("    " + ", ".join(f"{k}={v}" for k, v in parameters(method).items()))
    context.exit()
