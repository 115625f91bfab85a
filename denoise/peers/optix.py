"""NVIDIA's OptiX denoiser, through Mitsuba, on a machine with a CUDA device.

It gets HDR colour, and albedo and normal where a frame has an albedo; the temporal form also where
each pixel was in the frame before, and its own last result. Not measured by us: no figure of ours
stands on it. Its weights come with the driver; where they are missing (as in many containers) the
library ends the process, so they are looked for before.

The one part of `denoise/` that needs Mitsuba, which it imports when used.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from onespp.denoise.geometry.correspondence import NOWHERE, previous_pixel
from onespp.denoise.inputs.repair import repair
from onespp.denoise.inputs.surface import GUIDES
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host import backend
from onespp.render.host.turns import turn

WEIGHTS = Path("/usr/share/nvidia/nvoptix.bin")
"""Where the driver for Linux keeps the network."""


def has_weights() -> bool:
    return sys.platform != "linux" or WEIGHTS.exists()


@dataclass(frozen=True)
class Optix:
    """NVIDIA's OptiX denoiser (needs a CUDA device).

    Attributes:
        temporal: also reuse the last result, along the motion.
    """

    needs: ClassVar[tuple[str, ...]] = ("color", *GUIDES, "albedo")

    temporal: bool = False

    def init(self, height: int, width: int) -> OptixState:
        """InputError where there is no CUDA device or no network in its driver, or an empty size.
        """
        if backend.choose() != "cuda":
            raise InputError("the OptiX denoiser needs a CUDA device, and kernels run on the "
                             "CPU: `onespp doctor` says why")
        if not has_weights():
            raise InputError(f"the OptiX denoiser needs its network, {WEIGHTS}, which NVIDIA's "
                             "driver brings: install all of the driver here")
        if height < 1 or width < 1:
            raise InputError(f"an image of {width}x{height} pixels is empty")
        import mitsuba as mi

        mi.set_variant("cuda_ad_rgb")
        return OptixState(mi, mi.OptixDenoiser(
            mi.ScalarVector2u(width, height), albedo=True, normals=True, temporal=self.temporal))

    @turn()
    def __call__(self, frame: Frame, state: OptixState | None) -> tuple[np.ndarray, OptixState]:
        state = state or self.init(frame.height, frame.width)
        mi = state.mitsuba
        color = mi.TensorXf(repair(np.asarray(frame["color"], np.float32), frame["id"]))
        albedo, normal = (mi.TensorXf(np.nan_to_num(frame[name])) for name in ("albedo", "normal"))
        to_sensor = mi.Transform4f(frame.camera_from_world)
        if not self.temporal:
            result = state.denoiser(color, albedo=albedo, normals=normal, to_sensor=to_sensor)
            return np.array(result), state
        flow = mi.TensorXf(_flow(state.previous, frame))
        result = state.denoiser(
            color, albedo=albedo, normals=normal, to_sensor=to_sensor, flow=flow,
            previous_denoised=color if state.result is None else state.result)
        return np.array(result), OptixState(mi, state.denoiser, frame, result)


@dataclass(frozen=True)
class OptixState:
    """Mitsuba's module and denoiser; the frame before and its result."""

    mitsuba: Any
    denoiser: Any
    previous: Frame | None = None
    result: Any = None


def _flow(previous: Frame | None, frame: Frame) -> np.ndarray:
    """(h, w, 2) float32 pixels from where each surface was to where it is, (x, y); 0: unknown."""
    h, w = frame.height, frame.width
    if previous is None:
        return np.zeros((h, w, 2), np.float32)
    source = previous_pixel(previous, frame)
    y, x = np.mgrid[:h, :w]
    flow = np.stack([x - source % w, y - source // w], axis=-1)
    return np.where((source == NOWHERE)[..., None], 0, flow).astype(np.float32)
