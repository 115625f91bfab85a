"""How fast the kernels are on this machine: against a trained network, and against its limits.

`ms` is a kernel's own time: what it is given and what it returns are arrays on the device. What
a method reads beside colour and surfaces (signals, shadow rays, samples shaded again) it loads
itself: that is in its `ms`.
`call_ms` is the method's whole call, from a frame of NumPy images to a NumPy image. All take turns,
so that what else the machine does meets all alike, and each number is a median. The yardstick is
Open Image Denoise's fast quality, as a method too, with albedo and normal.

The shares of bandwidth and of arithmetic set the least that a kernel can do, counted by hand from
the code below, against what `machine_limits.py` measured; the greater says what bounds it. Methods
of many kernels have no count.
`speed_up` is the kernel's time with one thread over `ms`. `peak_mb` is what a state and a call need
at their highest, without the frame and the image; `bytes_a_pixel` the same over the pixels.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import drjit as dr
import numpy as np

from onespp.denoise.catalog import Method, build
from onespp.denoise.inputs.color import read_color
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.methods.asvgf import AsvgfState
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import filtered_innovation as innovation_oracle
from onespp.denoise.oracles import filters as oracles
from onespp.denoise.oracles import svgf as svgf_oracles
from onespp.denoise.oracles.bmfr import bmfr
from onespp.denoise.oracles.taa import taa
from onespp.denoise.oracles.trmv import trmv
from onespp.denoise.peers.oidn import AVAILABLE, Oidn
from onespp.render.frame import Frame
from onespp.render.host import backend
from onespp.render.host.timed import timed
from onespp.render.progress import Progress, silent

from . import machine_limits as limits
from .probe_frames import probe

WARM_UP, FRAMES = 3, 4
CROP = (40, 56)  # height, width of the frames for the error
_GAUSSIAN_TAP, _COLOR_TAP = 9, 30  # operations, an FMA being two
_BILATERAL_TAP, _ATROUS_TAP = 63, 42


@dataclass(frozen=True)
class Kernel:
    """A row of the table.

    Attributes:
        expected: float64 result of the second of two frames.
        operations, bytes: a pixel, at the least; an array read or written is four bytes, once
            for every launch that needs it. None: not counted.
        textured: its `ms` and error are of frames with all channels, not of colour and surfaces
            alone.
    """

    expected: Callable[[Frame, Frame], np.ndarray]
    operations: int | None = None
    bytes: int | None = None
    textured: bool = False


def _accumulated(previous: Frame, frame: Frame, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    return oracles.accumulate(new, oracles.reproject_bilinear(previous, frame, old))


def _innovations(*frames: Frame) -> list[np.ndarray]:
    """Our filter's image of each frame."""
    return [innovation_oracle.run(list(frames[:n + 1]), FilteredInnovation())
            for n in range(len(frames))]


_ATROUS = (5 * (24 * _ATROUS_TAP + 17) + 48 * 12, 4 * (5 * 27 + 38))
_TEMPORAL = (660, 4 * 51)

_BILATERAL = (33 * 33 * _BILATERAL_TAP, 4 * 33 * 29)


def _both(a: tuple[int, int], b: tuple[int, int]) -> tuple[int, int]:
    return a[0] + b[0], a[1] + b[1]


KERNELS = {
    "gaussian": Kernel(lambda _, frame: oracles.gaussian(frame),
                       25 * 25 * _GAUSSIAN_TAP, 4 * 25 * 12),
    "gaussian-separable": Kernel(lambda _, frame: oracles.gaussian(frame),
                                 2 * 25 * _GAUSSIAN_TAP, 4 * 2 * 14),
    "bilateral-color": Kernel(lambda _, frame: oracles.bilateral_color(frame),
                              33 * 33 * _COLOR_TAP, 4 * 33 * 14),
    "bilateral": Kernel(lambda _, frame: oracles.bilateral(frame), *_BILATERAL),
    "bilateral-separable": Kernel(lambda _, frame: oracles.bilateral_separable(frame),
                                  2 * 33 * _BILATERAL_TAP, 4 * 2 * 31),
    "atrous": Kernel(lambda _, frame: oracles.atrous(frame), *_ATROUS),
    "temporal": Kernel(lambda previous, frame: _accumulated(
        previous, frame, previous["color"], frame["color"]), *_TEMPORAL),
    "taa": Kernel(lambda *frames: taa(frames)),
    "assignment": Kernel(lambda previous, frame: _accumulated(
        previous, frame, oracles.bilateral(previous), oracles.bilateral(frame)),
        *_both(_BILATERAL, _TEMPORAL)),
    "assignment-atrous": Kernel(lambda previous, frame: _accumulated(
        previous, frame, oracles.atrous(previous), oracles.atrous(frame)),
        *_both(_ATROUS, _TEMPORAL)),
    "svgf": Kernel(lambda *frames: svgf_oracles.svgf(list(frames)), textured=True),
    "trmv": Kernel(lambda *frames: trmv(frames), textured=True),
    "asvgf": Kernel(lambda *frames: svgf_oracles.asvgf(list(frames)), textured=True),
    "bmfr": Kernel(lambda *frames: bmfr(frames), textured=True),
    "onespp": Kernel(lambda *frames: innovation_oracle.run(list(frames), FilteredInnovation()),
                     textured=True),
    "onespp-taa": Kernel(lambda *frames: taa(frames, _innovations(*frames)), textured=True),
}


@dataclass(frozen=True)
class Row:
    """Milliseconds, shares and memory of one kernel.

    None where there is no yardstick, no count, or no second thread; of a method without kernels of
    ours, all but the calls.
    """

    ms: float | None
    call_ms: float
    first_ms: float
    share_of_oidn_fast: float | None
    call_share_of_oidn_fast: float | None
    max_error: float | None
    share_of_bandwidth: float | None
    share_of_arithmetic: float | None
    speed_up: float | None
    peak_mb: float | None
    bytes_a_pixel: float | None


@dataclass(frozen=True)
class Bench:
    """All that `onespp bench` says."""

    kernels: dict[str, Row]
    width: int
    height: int
    repeats: int
    oidn_fast_ms: float | None
    bandwidth_gb_s: float
    arithmetic_gflop_s: float
    device: str
    threads: int
    processor: str

    def json_text(self) -> str:
        return json.dumps(asdict(self), indent=2) + "\n"


def bench(height: int, width: int, repeats: int, progress: Progress = silent,
          others: Mapping[str, Method] | None = None) -> Bench:
    """Measure every kernel, in rounds.

    Args:
        others: methods whose calls alone are timed, by name.
    """
    total, what = repeats + 2, f"bench {width}x{height}"
    runs = {name: _Run(name, height, width) for name in KERNELS}
    calls = {name: _Calls(method, height, width) for name, method in (others or {}).items()}
    network = _Network(height, width) if AVAILABLE else None
    progress(1, total, what)
    for i in range(repeats):
        for run in (network, *runs.values(), *calls.values()):
            if run:
                run.measure(i % FRAMES)
        measure_one_thread(runs.values(), i % FRAMES)
        progress(2 + i, total, what)
    oidn = median(network.ms) if network else None
    bandwidth, arithmetic = limits.memory_bandwidth(), limits.arithmetic()
    rows = {}
    for name, run in runs.items():
        kernel, ms, call = KERNELS[name], median(run.ms), median(run.call_ms)
        per_ms = height * width / ms * 1e-6  # times operations or bytes a pixel: giga a second
        rows[name] = Row(ms, call, run.first_ms, oidn and ms / oidn, oidn and call / oidn,
                         max_error(name), kernel.bytes and kernel.bytes * per_ms / bandwidth,
                         kernel.operations and kernel.operations * per_ms / arithmetic,
                         median(run.one_thread_ms) / ms if run.one_thread_ms else None,
                         run.peak_mb, run.peak_mb * 2**20 / (height * width))
    for name, run in calls.items():
        call = median(run.call_ms)
        rows[name] = Row(None, call, run.first_ms, None, oidn and call / oidn, *[None] * 6)
    progress(total, total, what)
    return Bench(rows, width, height, repeats, oidn, bandwidth, arithmetic, backend.choose(),
                 dr.thread_count(), platform.processor() or platform.machine())


SIZES = ((256, 256), (512, 512), (720, 1280), (1080, 1920))


@dataclass(frozen=True)
class Scaling:
    """Kernels at several sizes ("WxH"): milliseconds of each, and of Open Image Denoise."""

    sizes: list[str]
    repeats: int
    ms: dict[str, list[float]]

    def json_text(self) -> str:
        return json.dumps(asdict(self), indent=2) + "\n"


def scaling(repeats: int, progress: Progress = silent,
            sizes: Sequence[tuple[int, int]] = SIZES) -> Scaling:
    """Measure every kernel at each (height, width), in turns."""
    found: dict[str, list[float]] = {}
    for done, (height, width) in enumerate(sizes, 1):
        runs: dict[str, Any] = {name: _Run(name, height, width) for name in KERNELS}
        if AVAILABLE:
            runs["OIDN fast"] = _Network(height, width)
        for i in range(repeats):
            for run in runs.values():
                run.measure(i % FRAMES)
        for name, run in runs.items():
            found.setdefault(name, []).append(median(run.ms))
        progress(done, len(sizes), "bench")
    return Scaling([f"{width}x{height}" for height, width in sizes], repeats, found)


def max_error(name: str) -> float:
    """Largest difference from the formula in float64, radiance, over a small moving scene."""
    previous, frame = (probe(*CROP, i, KERNELS[name].textured) for i in range(2))
    method = build(name)
    _, state = method(previous, method.init(*CROP))
    image, _ = method(frame, state)
    return float(np.abs(image - KERNELS[name].expected(previous, frame)).max())


def measure_one_thread(runs: Iterable[_Run], i: int) -> None:
    """The kernels' times with one thread, where there are more."""
    threads = dr.thread_count()
    if threads < 2 or backend.choose() != "llvm":
        return
    try:
        dr.set_thread_count(1)
        for run in runs:
            run.one_thread_ms.append(run.measure_kernel(i))
    finally:
        dr.set_thread_count(threads)


class _Calls:
    """A method with its state, and the times of its calls."""

    def __init__(self, method: Any, height: int, width: int) -> None:
        self.method = method
        self.frames = [probe(height, width, i) for i in range(FRAMES)]
        self.state = method.init(height, width)
        self.call_ms: list[float] = []
        self.first_ms = timed(lambda: method(self.frames[0], self.state))[1]
        for i in range(WARM_UP):
            self.measure(i)
        self.call_ms.clear()

    def measure(self, i: int) -> None:
        (_, self.state), ms = timed(lambda: self.method(self.frames[i], self.state))
        self.call_ms.append(ms)


class _Run(_Calls):
    """A method of ours, with the times of its kernel too."""

    def __init__(self, name: str, height: int, width: int) -> None:
        method: Any = build(name)
        self.kernel_frames = [probe(height, width, i, KERNELS[name].textured)
                              for i in range(FRAMES)]
        self.kernel_state = method.init(height, width)
        self.ms: list[float] = []
        self.one_thread_ms: list[float] = []
        super().__init__(method, height, width)
        self.ms.clear()
        self.peak_mb = self._peak(height, width)

    def measure(self, i: int) -> None:
        super().measure(i)
        self.ms.append(self.measure_kernel(i))

    def measure_kernel(self, i: int) -> float:
        """Milliseconds from arrays to arrays."""
        stencil, frame = self.kernel_state.stencil, self.kernel_frames[i]
        color, surface = read_color(frame, stencil), read_surface(frame, stencil)
        dr.eval(color, surface)

        def kernel() -> Any:
            result = self.method.on_lanes(frame, color, surface, self.kernel_state)
            dr.eval(result[0])
            return result

        (_, self.kernel_state), ms = timed(kernel)
        return ms

    def _peak(self, height: int, width: int) -> float:
        """Dr.Jit's arrays at their highest, and the planes, which are not Dr.Jit's."""
        dr.sync_thread()
        dr.flush_malloc_cache()
        dr.detail.malloc_clear_statistics()
        state = self.method.init(height, width)
        kind = state.stencil.backend
        before = dr.detail.malloc_watermark(kind)
        for frame in self.frames[:2]:
            _, state = self.method(frame, state)
            dr.sync_thread()
        arrays = dr.detail.malloc_watermark(kind) - before
        planes = state.stencil.plane_bytes
        if isinstance(state, AsvgfState):
            planes += state.gradients.strata.plane_bytes
        return (arrays + planes) / 2**20


class _Network:
    """Open Image Denoise, and its times."""

    def __init__(self, height: int, width: int) -> None:
        self.method = Oidn(quality="fast")
        self.frames = [probe(height, width, i) for i in range(FRAMES)]
        self.state = self.method.init(height, width)
        self.method(self.frames[0], self.state)
        self.ms: list[float] = []

    def measure(self, i: int) -> None:
        self.ms.append(timed(lambda: self.method(self.frames[i], self.state))[1])
