"""Intel Open Image Denoise, a trained network, as a method beside ours.

It gets HDR colour, and albedo and normal where a frame has an albedo (it takes no normal without
one). Emission, where a frame has it, is no noise: it is taken out before and put back after, which
is worth 4 dB on the box, whose lamp would bleed. Bad pixels of the colour are repaired as for
every method (`surface.repair`); guides that are not finite count as albedo 1 and normal 0. It runs
where kernels run (`backend.choose`), on the CPU in Dr.Jit's own threads. Images are copied into
buffers of that device, and the network is set up once, so that a call is the copies and the filter.

`pip install mitsuba-oidn` brings it; `AVAILABLE` says whether it is there.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from onespp.denoise.inputs.repair import repair
from onespp.denoise.methods.parameters import check_choice
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host import backend
from onespp.render.host.turns import turn

AVAILABLE = importlib.util.find_spec("mitsuba_oidn") is not None

QUALITIES = ("high", "balanced", "fast")
AUXILIARY = ("clean", "noisy")


@dataclass(frozen=True)
class Oidn:
    """Intel Open Image Denoise on every frame by itself.

    Attributes:
        quality: of the network [high, balanced or fast].
        auxiliary: whether the network may trust albedo and normal (ours have no noise), or
            filters them as it does the colour [clean or noisy].
        emission_apart: take emission out before and add it after, where frames have it.
    """

    needs: ClassVar[tuple[str, ...]] = ("color", "normal", "id")

    quality: str = "high"
    auxiliary: str = "clean"
    emission_apart: bool = True

    def __post_init__(self) -> None:
        check_choice(self, "quality", QUALITIES)
        check_choice(self, "auxiliary", AUXILIARY)

    def init(self, height: int, width: int) -> OidnState:
        """Buffers and networks for frames of one size.

        Raises:
            InputError: mitsuba-oidn is missing or does not load, or the size is empty.
        """
        if not AVAILABLE:
            raise InputError("Open Image Denoise is not installed: "
                             "run `pip install mitsuba-oidn`")
        if height < 1 or width < 1:
            raise InputError(f"an image of {width}x{height} pixels is empty")
        return OidnState(height, width, self)

    @turn()
    def __call__(self, frame: Frame, state: OidnState | None) -> tuple[np.ndarray, OidnState]:
        """(h, w, 3) float32; InputError if a channel is missing or the size is another."""
        state = state or self.init(frame.height, frame.width)
        if (frame.height, frame.width) != (state.height, state.width):
            raise InputError(f"frame {frame.index} is {frame.width}x{frame.height}, the denoiser's "
                             f"state was made for {state.width}x{state.height}: make a new one")
        emission = emission_of(frame) if self.emission_apart else np.zeros(1, np.float32)
        color = repair(np.asarray(frame["color"], np.float32), frame["id"]) - emission
        normal = _finite(frame["normal"], 0.0).clip(-1, 1)
        if "albedo" not in frame:
            return state.run(False, color=color) + emission, state
        albedo = _finite(frame["albedo"], 1.0).clip(0, 1)
        return state.run(True, color=color, albedo=albedo, normal=normal) + emission, state


class OidnState:
    """A device, a buffer for each image, and the filters made so far; freed with the object."""

    def __init__(self, height: int, width: int, settings: Oidn) -> None:
        kind = {"llvm": "CPU", "cuda": "CUDA", "metal": "Metal"}[backend.choose()]
        try:
            import mitsuba_oidn as oidn
        except (ImportError, OSError) as error:
            raise InputError(f"Open Image Denoise does not load ({error}): "
                             "run `pip install --force-reinstall mitsuba-oidn`") from error
        self.height, self.width, self._oidn, self._settings = height, width, oidn, settings
        with _failures():
            self._device = oidn.Device(getattr(oidn.DeviceType, kind))
            self._buffers = {name: self._device.new_buffer(height * width * 12, oidn.Storage.Device)
                             for name in ("color", "albedo", "normal", "output")}
        self._filters: dict[bool, Any] = {}

    def run(self, guided: bool, **images: np.ndarray) -> np.ndarray:
        """Copy the images in, run the filter, copy the result out."""
        result = np.empty((self.height, self.width, 3), np.float32)
        with _failures():
            for name, image in images.items():
                self._buffers[name].write(np.ascontiguousarray(image, np.float32))
            if guided not in self._filters:
                self._filters[guided] = self._filter(["output", *images])
            self._filters[guided].execute()
            self._buffers["output"].read(result)
        return result

    def _filter(self, names: list[str]) -> Any:
        made = self._device.new_filter("RT")
        for name in names:
            made.set_image(name, self._buffers[name], format=self._oidn.Format.Float3,
                           width=self.width, height=self.height)
        made.hdr = True
        made.clean_aux = self._settings.auxiliary == "clean" and "albedo" in names
        made.quality = self._oidn.Quality[self._settings.quality.capitalize()]
        return made


@contextmanager
def _failures() -> Iterator[None]:
    """Its errors, as of memory or a driver, in a sentence of ours."""
    try:
        yield
    except RuntimeError as error:
        raise InputError(f"Open Image Denoise failed ({error})") from error


def emission_of(frame: Frame) -> np.ndarray:
    """(h, w, 3) emission, or 0 where the frame has none or it is not finite."""
    return _finite(frame["emission"], 0.0) if "emission" in frame else np.zeros(1, np.float32)


def _finite(image: np.ndarray, otherwise: float) -> np.ndarray:
    return np.where(np.isfinite(image), image, np.float32(otherwise))
