"""The figures of `onespp bench` as a table on the terminal."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from onespp.denoise.bench.kernels import Bench, Scaling

PLAIN_WIDTH = 100
SPEED = ("kernel", "ms", "/OIDN", "call ms", "/OIDN", "first ms", "over 1 thread")
LIMITS = ("kernel", "max error", "of bandwidth", "of arithmetic", "MB", "bytes a pixel")


def print_bench(result: Bench, console: Console | None = None) -> None:
    """Two tables and a caption. In a pipe or a log, plain and 100 columns wide."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    title = f"{result.width}x{result.height}, {result.device}, {result.threads} threads"
    speed, limits = _grid(title, SPEED), _grid(None, LIMITS)
    for name, row in result.kernels.items():
        speed.add_row(name, _number(row.ms, 1), _number(row.share_of_oidn_fast, 3),
                      f"{row.call_ms:.1f}", _number(row.call_share_of_oidn_fast, 3),
                      f"{row.first_ms:.0f}", _number(row.speed_up, 2))
        if row.max_error is not None:
            limits.add_row(name, f"{row.max_error:.0e}", _percent(row.share_of_bandwidth),
                           _percent(row.share_of_arithmetic), _number(row.peak_mb, 0),
                           _number(row.bytes_a_pixel, 0))
    console.print(speed)
    console.print(limits)
    console.print(caption(result), style="dim", highlight=False)


def _grid(title: str | None, headings: Sequence[str]) -> Table:
    grid = Table(title=title, title_justify="left", title_style="bold")
    for heading in headings:
        grid.add_column(heading, justify="left" if heading == "kernel" else "right",
                        no_wrap=heading == "kernel")
    return grid


def caption(result: Bench) -> str:
    """What the numbers stand on."""
    yardstick = ("Open Image Denoise is not installed (pip install mitsuba-oidn)"
                 if result.oidn_fast_ms is None else f"OIDN fast {result.oidn_fast_ms:.0f} ms")
    return (f"Medians of {result.repeats}, taking turns. ms: arrays to arrays; call: images to "
            f"images; first: compilation included. {yardstick}. Bandwidth and arithmetic: share of "
            f"this machine's, measured just now: {result.bandwidth_gb_s:.0f} GB/s, "
            f"{result.arithmetic_gflop_s:.0f} GFLOP/s; -: not counted. MB: a state and a call at "
            "their highest.")


def print_scaling(result: Scaling, console: Console | None = None) -> None:
    """Nanoseconds a pixel of each kernel by size."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    grid = _grid("ns a pixel", ("kernel", *result.sizes))
    for name, ms in result.ms.items():
        pixels = [math.prod(map(int, size.split("x"))) for size in result.sizes]
        grid.add_row(name, *(f"{1e6 * t / n:.1f}" for t, n in zip(ms, pixels, strict=True)))
    console.print(grid)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{share:.0%}"
