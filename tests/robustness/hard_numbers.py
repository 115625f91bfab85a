"""Hard numbers: cases for every kernel, and how far each kernel is from float64 on them.

`python -m tests.robustness.hard_numbers` prints the table; `test_hard_numbers.py` bounds it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

import onespp  # noqa: F401 - finds LLVM before anything imports Dr.Jit
from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.inputs.surface import GUIDES
from onespp.denoise.methods.temporal import Temporal
from onespp.denoise.oracles import filters as oracles
from onespp.render.frame import Frame
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.hard import HARD
from tests.support.frames import make_frame, noisy, translation, turn, with_images

RADIUS, LEVELS = 3, 3
LARGEST = 1e18    # radiance beyond it is a bad pixel
FARTHEST = 1e15   # depth beyond it is background
LEAST = 1.2e-38   # a float32 below it is denormal and counts as 0


# Cases. Each turns a good frame into a hard one. `rng` is the same in every frame of a case.

def _some(rng: np.random.Generator, frame: Frame, share: float = 0.04) -> np.ndarray:
    """(h, w) mask of a few pixels, one at least."""
    mask = rng.random((frame.height, frame.width)) < share
    mask[frame.height // 2, frame.width // 2] = True
    return mask


def _color(value: float | tuple[float, ...]) -> Callable:
    def change(frame: Frame, rng: np.random.Generator) -> Frame:
        return with_images(frame, color=np.where(_some(rng, frame)[..., None], value,
                                                 frame["color"]))
    return change


def _all_colors(function: Callable) -> Callable:
    return lambda frame, rng: with_images(frame, color=function(frame["color"], rng))


def _guide(channel: str, function: Callable, share: float = 0.04) -> Callable:
    def change(frame: Frame, rng: np.random.Generator) -> Frame:
        image = np.array(frame[channel])
        mask = _some(rng, frame, share)
        image[mask] = function(image[mask])
        return with_images(frame, **{channel: image})
    return change


CASES: dict[str, Callable[[Frame, np.random.Generator], Frame]] = {
    "plain": lambda frame, rng: frame,
    "NaN radiance": _color(np.nan),
    "+inf radiance": _color(np.inf),
    "-inf radiance": _color(-np.inf),
    "one NaN channel": _color((0.5, 0.5, np.nan)),
    "1e30 radiance": _color(1e30),
    "65504 radiance": _color(65504.0),
    "negative radiance": _color(-0.75),
    "all denormal": _all_colors(lambda c, rng: c * np.float32(1e-40)),
    "all 1e-15": _all_colors(lambda c, rng: c * np.float32(1e-15)),
    "all 65504": _all_colors(lambda c, rng: np.full_like(c, 65504.0)),
    "all far apart": _all_colors(lambda c, rng: np.repeat(
        0.2 + 0.01 * rng.permutation(c[..., 0].size).reshape(*c.shape[:2], 1), 3, axis=2)),
    "1e4 +- 1e-3": _all_colors(lambda c, rng: 1e4 + rng.choice([-1e-3, 1e-3], c.shape)),
    "zero normals": _guide("normal", lambda n: 0 * n),
    "normals of length 0.5": _guide("normal", lambda n: 0.5 * n, 1.0),
    "normals of length 3": _guide("normal", lambda n: 3 * n),
    "NaN normals": _guide("normal", lambda n: n + np.nan),
    "NaN positions": _guide("position", lambda p: p + np.nan),
    "inf positions": _guide("position", lambda p: p + np.inf, 1.0),
    "depth 0": _guide("depth", lambda z: 0 * z),
    "depth NaN": _guide("depth", lambda z: z + np.nan),
    "depth inf": _guide("depth", lambda z: z + np.inf),
    "depth negative": _guide("depth", lambda z: -z),
    "ID too large": _guide("id", lambda i: i + 1000),
    "ID -7": _guide("id", lambda i: 0 * i - 7),
}
SIZES = ((1, 1), (1, 7), (7, 1), (3, 5), (2, 2), (13, 17))
UNDERFLOW = {"sigma_color": 1e-12, "sigma_luminance": 1e-12}  # with "all far apart"


def frames_of(case: str, height: int = 13, width: int = 17) -> list[Frame]:
    """Three frames in motion, the last two of them hard."""
    frames = [noisy(make_frame(height, width, index=i, board=translation(0.11 * i, 0, 0),
                               camera=translation(0.05 * i, 0, 0.04 * i) @ turn(0.004 * i)),
                    seed=i) for i in range(3)]
    return [CASES[case](frame, np.random.default_rng(9)) if i else frame
            for i, frame in enumerate(frames)]


# What a frame means, by the contract in denoise/surface.py, in float64.

def as_meant(frame: Frame) -> Frame:
    """The frame with everything bad replaced by what it counts as."""
    n = np.asarray(frame["normal"], np.float64)
    z = np.asarray(frame["depth"], np.float64)
    with np.errstate(invalid="ignore"):
        length2 = (n**2).sum(-1)
        exists = ((frame["id"] >= 0) & (z > 0) & (z < FARTHEST) & (length2 > 0.01)
                  & (length2 < 100))
        n = np.where(exists[..., None], n / np.sqrt(length2)[..., None], 0)
    z = np.where(exists, z, 0)
    world_from_camera = np.linalg.inv(frame.camera_from_world)
    b = np.linalg.inv((frame.screen_from_world @ world_from_camera)[[0, 1, 3], :3])
    y, x = np.mgrid[:frame.height, :frame.width] + 0.5
    local = z[..., None] * (np.stack([x, y, np.ones_like(x)], -1) @ b.T)
    position = local @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]
    images = {"color": filled(frame), "normal": n, "depth": z, "position": position,
              "id": np.where(exists, frame["id"], -1)}
    return Frame(frame.index, images, frame.camera_from_world, frame.screen_from_world,
                 frame.world_from_object)


def bad_pixels(frame: Frame) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.logical_not((np.abs(frame["color"]) <= LARGEST).all(-1))


def filled(frame: Frame) -> np.ndarray:
    """Colour, each bad pixel's by the mean of the good ones of its object in the least window."""
    color, bad = frame["color"].astype(np.float64), bad_pixels(frame)
    result = np.where(bad[..., None], 0, color)
    for y, x in np.argwhere(bad):
        for r in range(1, 9):
            window = (slice(max(y - r, 0), y + r + 1), slice(max(x - r, 0), x + r + 1))
            good = ~bad[window] & (frame["id"][window] == frame["id"][y, x])
            if good.any():
                result[y, x] = color[window][good].mean(0)
                break
    return result


# The methods in float64: what each of METHODS is by the formulas of denoise/oracles/.

def _with_color(frame: Frame, color: np.ndarray) -> Frame:
    return Frame(frame.index, {**frame.images, "color": color}, frame.camera_from_world,
                 frame.screen_from_world, frame.world_from_object)


def _accumulated(spatial: Callable[..., np.ndarray]) -> Callable:
    def run(frames: list[Frame], **sigmas: float) -> np.ndarray:
        previous, history = frames[0], spatial(frames[0], **sigmas)
        for frame in frames[1:]:
            color = spatial(frame, **sigmas)
            inside = np.where(frame["id"] < len(frame.world_from_object), frame["id"], -1)
            seen = Frame(frame.index, {**frame.images, "id": inside}, frame.camera_from_world,
                         frame.screen_from_world, frame.world_from_object)
            old = oracles.reproject_bilinear(previous, seen, history)
            previous, history = frame, oracles.accumulate(color, old)
        return history
    return run


def _last(spatial: Callable[..., np.ndarray]) -> Callable:
    return lambda frames, **sigmas: spatial(frames[-1], **sigmas)


def _gaussian(frame: Frame, **sigmas: float) -> np.ndarray:
    return oracles.gaussian(frame, RADIUS, **sigmas)


def _bilateral_color(frame: Frame, **sigmas: float) -> np.ndarray:
    return oracles.bilateral_color(frame, RADIUS, **sigmas)


def _bilateral(frame: Frame, **sigmas: float) -> np.ndarray:
    return oracles.bilateral(frame, RADIUS, **sigmas)


def _separable(frame: Frame, **sigmas: float) -> np.ndarray:
    return oracles.bilateral_separable(frame, RADIUS, **sigmas)


def _atrous(frame: Frame, **sigmas: float) -> np.ndarray:
    return oracles.atrous(frame, LEVELS, **sigmas)


EXACT: dict[str, Callable] = {
    "gaussian": _last(_gaussian),
    "gaussian-separable": _last(_gaussian),
    "bilateral-color": _last(_bilateral_color),
    "bilateral": _last(_bilateral),
    "bilateral-separable": _last(_separable),
    "atrous": _last(_atrous),
    "temporal": _accumulated(lambda frame, **sigmas: frame["color"]),
    "assignment": _accumulated(_bilateral),
    "assignment-atrous": _accumulated(_atrous),
}


def small(name: str, **settings: object) -> dict[str, str]:
    """Settings by which a method is quick and does not divide by albedo, and others if it has them.
    """
    known = parameters(METHODS[name]())
    levels = settings.get("levels", LEVELS)
    wanted = {"radius": RADIUS, "levels": levels, "output_levels": levels,
              "sharp_output_levels": levels, "block_size": 8, "demodulate": False, **settings}
    return {k: str(v) for k, v in wanted.items() if k in known}


def run(name: str, frames: list[Frame], **settings: object) -> np.ndarray:
    method = build(name, small(name, **settings))
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def error(result: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """(h, w) relative error: over the exact value, or a thousandth of the usual one if larger."""
    usual = 1e-3 * np.median(np.abs(exact)) + LEAST
    return (np.abs(result - exact) / np.maximum(np.abs(exact), usual)).max(-1)


def errors_of(name: str, case: str, size: tuple[int, int] = (13, 17),
              **sigmas: float) -> np.ndarray:
    """(h, w) error of a method on a case; with sigmas, only on its hard frames."""
    frames = frames_of(case, *size)[1 if sigmas else 0:]
    known = parameters(METHODS[name]())
    sigmas = {k: v for k, v in sigmas.items() if k in known}
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        exact = EXACT[name]([as_meant(frame) for frame in frames], **sigmas)
    return error(run(name, frames, **sigmas), exact)


# Reprojection: where the kernels' float32 finds a surface in the frame before, against float64.

def pixel_errors(previous: Frame, frame: Frame) -> np.ndarray:
    """Pixels between the two, of every pixel whose surface was amid four pixels of its object.

    The frame before is painted with its own pixel coordinates; what history brings is the place.
    """
    exact = previous_place(previous, frame)
    height, width = frame.height, frame.width
    y, x = np.mgrid[:height, :width] + 0.5
    mark = np.random.default_rng(0).uniform(-0.01, 0.01, (height, width))  # widens the clamp
    forward = np.broadcast_to((0, 0, 1), (height, width, 3))  # so that no normal is refused
    painted = with_images(previous, color=np.stack([x, y, np.full_like(x, 1000)], -1),
                          normal=forward)
    asking = with_images(frame, color=np.stack([x, y, mark], -1), normal=forward)
    method = Temporal(alpha=1e-6, color_box=1e6, min_cosine=-1, plane_tolerance=1e6)
    _, state = method(painted, method.init(height, width))
    found, _ = method(asking, state)
    corner = np.nan_to_num(exact, nan=-9) - 0.5
    sure = found[..., 2] > 900
    near = (-1e-3, 1e-3, 1 - 1e-3, 1 + 1e-3)  # either side, where a place is all but a pixel's
    for dy in near:
        for dx in near:
            tx, ty = np.moveaxis(np.floor(corner + np.array([dx, dy])).astype(int), -1, 0)
            on = (tx >= 0) & (tx < width) & (ty >= 0) & (ty < height)
            sure &= on & (previous["id"][np.where(on, ty, 0), np.where(on, tx, 0)] == frame["id"])
    return np.linalg.norm(found[..., :2] - exact, axis=-1)[sure]


def previous_place(previous: Frame, frame: Frame) -> np.ndarray:
    """(h, w, 2) screen position in the previous frame of each pixel's surface, float64."""
    y, x = np.mgrid[:frame.height, :frame.width] + 0.5
    depth = frame["depth"].astype(np.float64)
    clip = np.stack([x * depth, y * depth, np.ones_like(x), depth], -1)
    place = np.full((*depth.shape, 2), np.nan)
    for i, (was, now) in enumerate(zip(previous.world_from_object, frame.world_from_object)):
        here = frame["id"] == i
        if here.any() and np.linalg.det(now) != 0:
            # As one product of small numbers, so that float64 is exact far from the origin too.
            camera_from_object = frame.camera_from_world @ now
            camera_from_clip = np.linalg.inv(
                frame.screen_from_world @ np.linalg.inv(frame.camera_from_world))
            back = (previous.screen_from_world @ was @ np.linalg.inv(camera_from_object)
                    @ camera_from_clip)
            old = clip[here] @ back.T
            with np.errstate(divide="ignore", invalid="ignore"):
                place[here] = old[:, :2] / old[:, 3:]
    return place


def reprojection_table(height: int = 64, width: int = 96) -> None:
    """Renders the guides of every hard scene and prints their pixel errors."""
    print("| float32 reprojection, pixels | 99.9th percentile | maximum | pixels |")
    print("| --- | --- | --- | --- |")
    everything = []
    for name, hard in HARD.items():
        renderer = Renderer(hard.make(), height, width)
        frames = [renderer.frame(i, channels=("color", *GUIDES)) for i in range(10)]
        errors = np.concatenate([pixel_errors(a, b) for a, b in pairwise(frames)])
        everything.append(errors)
        print(_row(name, errors), flush=True)
    print(_row("all", np.concatenate(everything)))


def _row(name: str, errors: np.ndarray) -> str:
    return f"| {name} | {np.percentile(errors, 99.9):.1e} | {errors.max():.1e} | {errors.size} |"


def main() -> None:
    print(f"| largest relative error | {' | '.join(EXACT)} |")
    print("| --- |" + " --- |" * len(EXACT))
    rows = [(case, case, (13, 17), {}) for case in CASES]
    rows += [(f"{w}x{h}", "plain", (h, w), {}) for h, w in SIZES]
    rows += [("all weights underflow", "all far apart", (13, 17), UNDERFLOW)]
    for label, case, size, sigmas in rows:
        cells = [f"{errors_of(name, case, size, **sigmas).max():.1e}" for name in EXACT]
        print(f"| {label} | {' | '.join(cells)} |", flush=True)
    print()
    reprojection_table()


if __name__ == "__main__":
    main()
