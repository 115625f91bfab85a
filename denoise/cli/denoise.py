"""The commands `denoise` and `time`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from onespp.denoise.methods.parameters import pairs
from onespp.denoise.own_method import result_name
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import command_line, note, progress
from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.manifest import check_result_name
from onespp.render.files.sequence import FrameSequence

if TYPE_CHECKING:
    from onespp.denoise.catalog import Method

DEFAULT_METHODS = ("onespp",)


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
    from onespp.denoise.run.several import denoise_by, what_to_know

    sequence = FrameSequence.open(folder)
    chosen = method_names(methods)
    if name is not None and len(chosen) > 1:
        raise InputError(f"--name {name} is one name for {len(chosen)} methods: give one --method")
    denoisers = {made + (OUTLIERS if outliers is not None else "") if name is None else name: method
                 for made, method in built(chosen, pairs(settings), outliers).items()}
    with progress() as report:
        done = denoise_by(sequence, denoisers, report, command_line())
    for name, (_, pace) in done.items():
        if pace is not None:
            click.echo(f"{name}: {pace}")
    for name, (run, _) in done.items():
        if run.energy_kept is not None:
            click.echo(f"{name}: removing outliers took {1 - run.energy_kept:.2%} of the energy")
    for line in what_to_know(sequence, default):
        click.echo(line)
    frames = sum(map(sequence.has_frame, sequence.frames))
    click.echo(f"denoised {frames} frames by {', '.join(done)} "
               f"into {sequence.folder / 'denoised'}")


def check_methods(methods: tuple[str, ...], channels: tuple[str, ...]) -> None:
    """InputError for methods that `denoise_in` would refuse for frames with these channels asked
    for: said before hours of rendering."""
    from onespp.denoise.catalog import check_not_a_method, name_of
    from onespp.denoise.run.several import check_replay

    for name, method in built(method_names(methods)).items():
        check_result_name(name)
        check_not_a_method(name, name_of(method))
        check_replay(name, method.needs, channels, "this run")


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
    from onespp.denoise.catalog import build, described, parameters
    from onespp.denoise.own_method import about_own, offers

    about = described()
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
