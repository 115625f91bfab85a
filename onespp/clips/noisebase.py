"""The layout that Noisebase's loader of training samples reads: a sequence a zarr 2 ZipStore.

Its arrays are (frames, channels, h, w, samples), samples being the noisy renders of a frame, which
share all but their colour. Positions and their motion are in the world: `motion` is from where a
surface is to where it was in the frame before, 0 in the first. Where there is no surface the
position is `FAR` away. Pictures are the square in the middle, at `crop_offset` of the whole.

Radiance is RGBE: with a and b the exposure, logarithms, a colour is RGB / 255 exp(a + (b - a)
(E + 1) / 256), E from the brightest of the three, rounded up, RGB rounded by a dither that follows
from (sequence, frame, sample).

Cameras are a place, a target and a direction up, and `proj_mat`: from coordinates x right, y up and
z forward to clip coordinates as in Direct3D, y up, depth 0 at `NEAR` to 1 at infinity.

Source: the format "Sample Training Format v1" of Noisebase (Balint et al. 2023), as documented.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from onespp.datasets.folder import DataSet
from onespp.denoise.geometry.motion import inverses
from onespp.render.files.atomic import replacing, write_text

from .motion import Matrices

FAR, NEAR = 1e4, 0.01
_LONGEST = 24.0  # nepers from the faintest light that is told from black to the brightest
_SAMPLES_A_CHUNK = 4
_Y_UP = np.diag([1.0, -1.0, 1.0, 1.0])


def side_of(data: DataSet) -> int:
    """Pixels of a side of the squares that pictures are cut to."""
    return min(data.plan.height, data.plan.width)


def write_description(data: DataSet, split: str, count: int, path: Path) -> None:
    """The YAML file that Noisebase wants of a data set of `count` sequences."""
    plan = data.plan
    write_text(path, f"""defaults:
  - format: training_sample_v1

name: "{plan.name}, {split}"
src:
  sequences: {count}
  files: {split}/scene{{index:04d}}.zip
  frames_per_sequence: {plan.frames}
  crop: {side_of(data)}
  samples: {plan.seeds}
  rendering_height: {plan.height}
  rendering_width: {plan.width}
samples: {plan.seeds}
""")


def write_sequence(library: Any, data: DataSet, number: int, path: Path) -> None:
    """Write a sequence.

    Args:
        library: zarr, version 3.
    """
    from numcodecs import Blosc  # pyright: ignore[reportMissingImports]  # comes with zarr

    arrays = arrays_of(data, number)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        store = library.storage.ZipStore(str(temporary), mode="w")
        group = library.create_group(store, zarr_format=2)
        for name, array in arrays.items():
            chunk = (1, *array.shape[1:])
            if array.ndim == 5:
                chunk = (*chunk[:-1], min(chunk[-1], _SAMPLES_A_CHUNK))
            group.create_array(name, data=array, chunks=chunk,
                               compressors=Blosc(cname="lz4hc", clevel=9))
        store.close()


def arrays_of(data: DataSet, number: int) -> dict[str, np.ndarray]:
    """The arrays of a sequence by name."""
    renders = [data.sequence(number, k) for k in range(data.plan.seeds)]
    side, frames = side_of(data), []
    top, left = (data.plan.height - side) // 2, (data.plan.width - side) // 2
    cut = slice(top, top + side), slice(left, left + side)
    before: Matrices | None = None
    for i in renders[0].frames:
        guides = renders[0].read_frame(i, ("albedo", "normal", "depth", "id"))
        now = Matrices(*renders[0].read_matrices(i))
        place, motion = _places(before, now, guides["depth"], guides["id"])
        colors = [render.read_frame(i, ("color",))["color"][cut] for render in renders]
        rgbe, exposure = encoded(np.stack(colors, -1).transpose(2, 0, 1, 3), (number, i))
        frame = {"color": rgbe, "exposure": exposure, **_camera(now, *renders[0].size),
                 "crop_offset": np.array((top, left), np.int32)}
        for name, image, kind in (("position", place, np.float32), ("motion", motion, np.float32),
                                  ("normal", guides["normal"], np.float16),
                                  ("diffuse", guides["albedo"], np.float16)):
            planes = image[cut].transpose(2, 0, 1).astype(kind)
            frame[name] = np.repeat(planes[..., None], len(renders), axis=-1)
        if renders[0].has_reference(i):
            frame["reference"] = renders[0].read_reference(i).color[cut].transpose(2, 0, 1)
        frames.append(frame)
        before = now
    return {name: np.stack([frame[name] for frame in frames]) for name in frames[0]}


def encoded(color: np.ndarray, seed: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """RGBE (4, h, w, s) uint8 of radiance (3, h, w, s), and the exposure, (2,) float32."""
    color = np.nan_to_num(np.maximum(color, 0).astype(np.float64))
    brightest = color.max(axis=0)
    if not brightest.any():
        return np.zeros((4, *color.shape[1:]), np.uint8), np.zeros(2, np.float32)
    high = np.log(brightest.max())
    low = max(float(np.log(brightest[brightest > 0].min())), high - _LONGEST) - 1e-6
    exposure = np.array((low, high), np.float32)
    with np.errstate(divide="ignore"):
        level = 256 * (np.log(brightest) - low) / (high - low)
    level = np.clip(np.ceil(level) - 1, 0, 255)
    scale = np.exp(exposure[0] + (exposure[1] - exposure[0]) * (level + 1) / 256)
    dither = np.random.default_rng(seed).random(color.shape)
    mantissas = np.clip(np.floor(255 * color / scale + dither), 0, 255)
    return np.concatenate([mantissas, level[None]]).astype(np.uint8), exposure


def _places(before: Matrices | None, now: Matrices, depth: np.ndarray,
            id: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the world, and from there to where the surface was before; (h, w, 3) float64."""
    s = now.screen_from_world[[0, 1, 3]]
    y, x = np.indices(depth.shape) + 0.5
    u = np.stack([x, y, np.ones_like(x)], axis=-1)
    surface = (id >= 0) & (depth > 0)
    z = np.where(surface, depth.astype(np.float64), FAR)
    place = (u * z[..., None] - s[:, 3]) @ np.linalg.inv(s[:, :3]).T
    motion = np.zeros_like(place)
    if before is None:
        return place, motion
    moved = before.world_from_object @ inverses(now.world_from_object)
    for i in np.unique(id[surface]):
        if not np.array_equal(before.world_from_object[i], now.world_from_object[i]):
            at = surface & (id == i)
            there = place[at] @ moved[i, :3, :3].T + moved[i, :3, 3]
            motion[at] = np.where(np.isfinite(there), there - place[at], 0)
    return place, motion


def _camera(now: Matrices, height: int, width: int) -> dict[str, np.ndarray]:
    """Their camera; its matrices are those of columns."""
    world_from_camera = np.linalg.inv(now.camera_from_world)
    eye = world_from_camera[:3, 3]
    x, y, _, depth = now.screen_from_world @ world_from_camera @ _Y_UP
    clip = np.stack([2 / width * x - depth, depth - 2 / height * y, depth, depth])
    clip[2, 3] -= NEAR
    camera = {"camera_position": eye, "camera_target": eye + world_from_camera[:3, 2],
              "camera_up": -world_from_camera[:3, 1], "proj_mat": clip,
              "view_proj_mat": clip @ _Y_UP @ now.camera_from_world}
    return {name: value.astype(np.float32) for name, value in camera.items()}
