"""The figures of `onespp bench` as a table on the terminal."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.table import Table

from .bench import Bench

PLAIN_WIDTH = 100
HEADINGS = ("kernel", "ms", "/OIDN", "call ms", "/OIDN", "first ms", "max error", "memory",
            "arithmetic")


def print_bench(result: Bench, console: Console | None = None) -> None:
    """Table and caption. In a pipe or a log, plain and 100 columns wide."""
    console = console or Console(width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    grid = Table(title=f"{result.width}x{result.height}, {result.device}, {result.threads} threads",
                 title_justify="left", title_style="bold")
    for heading in HEADINGS:
        grid.add_column(heading, justify="left" if heading == "kernel" else "right",
                        no_wrap=heading == "kernel")
    for name, row in result.kernels.items():
        grid.add_row(name, f"{row.ms:.1f}", _share(row.share_of_oidn_fast), f"{row.call_ms:.1f}",
                     _share(row.call_share_of_oidn_fast), f"{row.first_ms:.0f}",
                     f"{row.max_error:.0e}", f"{row.share_of_bandwidth:.0%}",
                     f"{row.share_of_arithmetic:.0%}")
    console.print(grid)
    console.print(caption(result), style="dim", highlight=False)


def caption(result: Bench) -> str:
    """What the numbers stand on."""
    yardstick = ("Open Image Denoise is not installed (pip install pyoidn)"
                 if result.oidn_fast_ms is None else f"OIDN fast {result.oidn_fast_ms:.0f} ms")
    return (f"Medians of {result.repeats}, taking turns. ms: arrays to arrays; call: images to "
            f"images; first: compilation included. {yardstick}. Memory and arithmetic: share of "
            f"this machine's, measured just now: "
            f"{result.bandwidth_gb_s:.0f} GB/s, {result.arithmetic_gflop_s:.0f} GFLOP/s.")


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
