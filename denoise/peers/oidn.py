"""Intel Open Image Denoise, a trained network, as a method beside ours.

It gets HDR colour, and albedo and normal where a frame has an albedo (it takes no normal without
one). Emission, where a frame has it, is no noise: it is taken out before and put back after, which
is worth 4 dB on the box, whose lamp would bleed. Bad pixels of the colour are repaired as for
every method (`surface.repair`); guides that are not finite count as albedo 1 and normal 0. Images
lie in buffers that it reads in place, and the network is set up in `init`, so that a call is one
copy of the inputs and the filter.

`pip install pyoidn` brings it; `AVAILABLE` says whether it is there.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from onespp.denoise.inputs.repair import repair
from onespp.denoise.methods.parameters import check_choice
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host.turns import turn

AVAILABLE = importlib.util.find_spec("pyoidn") is not None

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
            InputError: pyoidn is not installed, its library doesn't load, or the size is empty.
        """
        if not AVAILABLE:
            raise InputError("Open Image Denoise is not installed: "
                             "run `pip install pyoidn`")
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
    """A device, its buffers, and the filters made so far; freed with the object."""

    def __init__(self, height: int, width: int, settings: Oidn) -> None:
        import drjit as dr

        try:
            import pyoidn
            self._oidn = pyoidn
            self._device = pyoidn.Device()
        except (ImportError, OSError) as error:
            raise InputError(f"Open Image Denoise does not load ({error}): "
                             "run `pip install --force-reinstall pyoidn`") from error
        self.height, self.width, self._settings = height, width, settings
        self._device.set_int("numThreads", dr.thread_count())
        self._device.set_bool("setAffinity", False)  # it would pin threads that others share
        self._device.commit()
        self._images = {name: np.zeros((height, width, 3), np.float32)
                        for name in ("color", "albedo", "normal", "output")}
        self._filters: dict[bool, Any] = {}
        self._check()

    def run(self, guided: bool, **images: np.ndarray) -> np.ndarray:
        """Copy the images in, run the filter, copy the result out."""
        for name, image in images.items():
            self._images[name][:] = image
        if guided not in self._filters:
            self._filters[guided] = self._filter(["output", *images])
        self._filters[guided].execute()
        self._check()
        return self._images["output"].copy()

    def _filter(self, names: list[str]) -> Any:
        oidn = self._oidn
        made = oidn.Filter(self._device, oidn.OIDN_FILTER_TYPE_RT)
        for name in names:
            made.set_image(name, self._images[name], oidn.OIDN_FORMAT_FLOAT3)
        made.set_bool("hdr", True)
        made.set_bool("cleanAux", self._settings.auxiliary == "clean" and "albedo" in names)
        made.set_quality(getattr(oidn, f"OIDN_QUALITY_{self._settings.quality.upper()}"))
        made.commit()
        self._check()
        return made

    def _check(self) -> None:
        if error := self._device.get_error():
            raise InputError(f"Open Image Denoise failed ({error})")

    def __del__(self) -> None:
        for made in getattr(self, "_filters", {}).values():
            made.release()
        if hasattr(self, "_device"):
            self._device.release()


def emission_of(frame: Frame) -> np.ndarray:
    """(h, w, 3) emission, or 0 where the frame has none or it is not finite."""
    return _finite(frame["emission"], 0.0) if "emission" in frame else np.zeros(1, np.float32)


def _finite(image: np.ndarray, otherwise: float) -> np.ndarray:
    return np.where(np.isfinite(image), image, np.float32(otherwise))
