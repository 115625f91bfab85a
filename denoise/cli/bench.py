"""The command `bench`."""

from __future__ import annotations

import click

from onespp.render.cli.arguments import parse_size
from onespp.render.cli.bench import bench_reference, bench_render
from onespp.render.cli.options import device_option, threads_option, use
from onespp.render.cli.terminal import progress
from onespp.render.errors import InputError

from .denoise import built, method_names
from .options import json_option, show_or_print


@click.group(invoke_without_command=True)
@click.option("--size", default="512x512", show_default=True, metavar="WxH", help="Pixels.")
@click.option("--repeats", type=click.IntRange(1, 1000), default=15, show_default=True, metavar="N",
              help="Runs of each kernel, of which the median counts.")
@click.option("--method", "methods", multiple=True, metavar="NAME",
              help="Also time the calls of this one: a peer, or a file of your own, as for "
              "`denoise`; may be given several times.")
@click.option("--scaling", is_flag=True,
              help="The kernels' times from 256x256 to 1920x1080 instead; --size does not count.")
@json_option
@device_option
@threads_option
@click.pass_context
def bench(context: click.Context, size: str, repeats: int, methods: tuple[str, ...], scaling: bool,
          json_to: str | None, device: str, threads: int | None) -> None:
    """Measure the denoising kernels on this machine, against Open Image Denoise and its limits.

    `bench render` times the renderer, `bench reference` says what its references are worth, `bench
    clips` how fast a data set is read.
    """
    if context.invoked_subcommand is not None:
        return
    height, width = parse_size(size)
    use(device, threads)
    from onespp.denoise.bench.kernels import KERNELS
    from onespp.denoise.bench.kernels import bench as measure
    from onespp.denoise.bench.kernels import scaling as measure_sizes
    from onespp.denoise.report.bench_table import print_bench, print_scaling

    if scaling:
        if methods:
            raise InputError("--scaling takes no --method: it measures kernels of ours")
        with progress() as report:
            sizes = measure_sizes(repeats, report)
        show_or_print(sizes.json_text(), json_to, lambda: print_scaling(sizes))
        return
    others = built(name for name in method_names(methods) if name not in KERNELS)
    with progress() as report:
        result = measure(height, width, repeats, report, others)
    show_or_print(result.json_text(), json_to, lambda: print_bench(result))


bench.add_command(bench_render)
bench.add_command(bench_reference)
