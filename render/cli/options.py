"""Options that several commands share."""

from __future__ import annotations

import os

import click

from onespp.render.channels import OFFERED, REPLAY
from onespp.render.files.manifest import DIRECT, JITTERS, SAMPLERS
from onespp.render.host import backend


def use(device: str, threads: int | None) -> None:
    """Fix the device and the number of threads. Call before anything imports Mitsuba."""
    chosen = backend.choose(device)
    if device != "auto":
        os.environ["ONESPP_DEVICE"] = chosen
    backend.set_threads(threads)


device_option = click.option("--device", default="auto", show_default=True, metavar="DEVICE",
                             help="Where kernels run: auto, llvm (CPU), cuda or metal (macOS).")
threads_option = click.option("--threads", type=int, metavar="N", help="CPU threads; default all.")
frames_option = click.option("--frames", metavar="RANGE",
                             help="As 0:20 (0 to 19), 0:20:2, 7 or 0,5,9; default all.")
overwrite_option = click.option(
    "--overwrite/--resume", default=False,
    help="Replace another sequence in the folder, or go on with the same one where it stopped; "
         "default resume.")


scene_options = (
    click.option("-D", "--define", "define", multiple=True, metavar="NAME=VALUE",
                 help="Value of a parameter, $NAME, of a Mitsuba XML file; may be given several "
                      "times."),
    click.option("--sensor", type=int, default=0, show_default=True, metavar="N",
                 help="Which camera of a Mitsuba or glTF file, from 0."),
    click.option("--camera", metavar="MOVE",
                 help="Set a still camera in motion, as far as there is room: orbit, dolly or "
                      "handheld; or make it still."),
    click.option("--move", "moves", multiple=True, metavar="NAME=MOVE",
                 help="Set the shape NAME in motion: spin, swing or slide; may be given several "
                      "times."),
)


def render_options(command):
    """Options of every command that renders."""
    for option in reversed((
        frames_option,
        *scene_options,
        click.option("--size", metavar="WxH", help="Pixels, as 640x360; default the scene's."),
        click.option("--seed", default=0, show_default=True, metavar="N",
                     help="Seed of all random numbers."),
        click.option("--reference-spp", type=int, metavar="N",
                     help="Also render ground truth with N samples a pixel; what is there "
                          "with more is kept."),
        click.option("--reference-error", type=float, metavar="DB",
                     help="Also render ground truth, of as many samples in each frame as it takes "
                          "to know the PSNR of a method of 40 dB to DB (one standard error); tells "
                          "what it is likely to cost first. Instead of --reference-spp."),
        click.option("--antialias", is_flag=True,
                     help="Box-filter the reference over each pixel instead of its centre."),
        click.option("--channels", metavar="NAMES",
                     help=f"What frames carry, of {', '.join(OFFERED)}; default those that "
                          "say something about the scene; +NAMES: beside those, as +gradient for "
                          f"{' and '.join(REPLAY)}; training: what methods read, without what "
                          "follows from the rest."),
        click.option("--half", is_flag=True,
                     help="Store radiance and guides, but not depth, in half precision: relative "
                          "error at most 0.05 %."),
        click.option("--direct", default="resampled", show_default=True,
                     type=click.Choice(DIRECT),
                     help="Direct light at the first hit: as Mitsuba's path, or by resampling all "
                          "lights, split into unshadowed light and visibility."),
        click.option("--sampler", default="zsobol", show_default=True,
                     type=click.Choice(SAMPLERS),
                     help="Random numbers: independent, or with blue-noise error (two kinds)."),
        click.option("--jitter", default="none", show_default=True,
                     type=click.Choice(JITTERS),
                     help="Move all rays of a frame by an offset of its own within the pixel, for "
                          "temporal anti-aliasing; compare with a reference of --antialias."),
        overwrite_option, device_option, threads_option,
    )):
        command = option(command)
    return command
