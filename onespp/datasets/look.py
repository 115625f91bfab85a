"""A cheap look at a drawn scene: is there something to see, and is it lit?

Three frames at a few samples a pixel, by the kernel that renders references, and what is seen in
them, by a small one. A draw that fails is drawn again, with another attempt.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from onespp.denoise.metrics.luminance import luminance
from onespp.render.channels import asked_channels
from onespp.render.errors import InputError
from onespp.render.job import RenderJob
from onespp.scenes.description import Mesh, Scene
from onespp.scenes.drawn.choices import FILES
from onespp.scenes.drawn.draw import Drawn, draw, family_of

from .files import drawn_of_file, mesh_of
from .plan import Plan

MOST_ATTEMPTS = 20
DARKEST, BRIGHTEST = 0.1, 0.93  # mean of displayed values, of 1
_NEAR, _MOST_NEAR = 0.6, 0.3  # metres, and the share of pixels that may be nearer
_FEWEST_THINGS = 0.02  # the share of pixels that show things
_MOST_LAMP = 0.06  # the share of pixels that may show lamps
_MARGIN = 0.15  # metres between the camera and what surrounds a thing
_BLOCK = 8
_SAMPLES = 4


@dataclass(frozen=True)
class Seen:
    """A frame: (h, w, 3) noisy radiance, (h, w) object IDs and depths."""

    index: int
    color: np.ndarray
    id: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True)
class Usable:
    """A draw that was taken, the job that renders it, and why earlier ones were not."""

    drawn: Drawn
    job: RenderJob
    rejected: list[str]


def usable(plan: Plan, number: int) -> Usable:
    """The first draw of a sequence that shows something.

    Raises:
        InputError: none of `MOST_ATTEMPTS` does.
    """
    rejected: list[str] = []
    for attempt in range(MOST_ATTEMPTS):
        request = plan.request(number, attempt)
        drawn = (drawn_of_file(plan, request) if family_of(request) == FILES
                 else draw(request, partial(mesh_of, plan)))
        job = _job(plan, number, drawn.scene)
        why = inside(drawn, job.frames) or unlike_a_picture(drawn, _seen(job))
        if why is None:
            return Usable(drawn, job, rejected)
        rejected.append(why)
    raise InputError(f"none of {MOST_ATTEMPTS} draws of sequence {number} of '{plan.name}' shows "
                     f"something ({rejected[-1]}): change what the plan draws from")


def _job(plan: Plan, number: int, scene: Scene) -> RenderJob:
    names, added = asked_channels(plan.channels)
    return RenderJob(scene, range(plan.frames), plan.height, plan.width, plan.noise_seed(number, 0),
                     plan.reference_spp, plan.antialias, names, added=added,
                     training=plan.channels == "training", half=plan.half,
                     reference_error=plan.reference_error, dated=False)


def _seen(job: RenderJob) -> Iterator[Seen]:
    """The first frame, one in the middle and the last."""
    last = len(job.frames) - 1
    for i in sorted({0, last // 2, last}):
        guides = job.renderer.frame(i, job.seed, ("id", "depth"))
        color = job.renderer.sample_sum(i, job.seed, 0, _SAMPLES, job.antialias) / _SAMPLES
        yield Seen(i, color, guides["id"], guides["depth"])


def inside(drawn: Drawn, frames: Sequence[int]) -> str | None:
    """Why the camera stands in a thing, in a word, or None; without rendering."""
    things = [shape for shape in drawn.scene.shapes if shape.name in drawn.things]
    for frame in frames:
        eye = drawn.scene.camera.world_from_camera_at(frame)[:3, 3]
        for thing in things:
            matrix = thing.world_from_object_at(frame)
            points = (thing.geometry.vertices if isinstance(thing.geometry, Mesh)
                      else np.vstack([np.eye(3), -np.eye(3)]))
            middle = points.mean(axis=0)
            # The longest of a scaled thing's half diagonals is not shorter than its radius.
            radius = (np.linalg.norm(points - middle, axis=1).max()
                      * np.linalg.norm(matrix[:3, :3], 2))
            away = np.linalg.norm(matrix[:3, :3] @ middle + matrix[:3, 3] - eye)
            if away < radius + _MARGIN:
                return f"the camera is in {thing.name}"
    return None


def unlike_a_picture(drawn: Drawn, frames: Iterable[Seen]) -> str | None:
    """Why there is nothing to see in one of the frames, in a word, or None."""
    names = drawn.scene.object_names
    things = [i for i, name in enumerate(names) if name in drawn.things]
    lamps = [names.index(lamp["name"]) for lamp in drawn.record["lamps"]]
    for frame in frames:
        if drawn.record["family"] == FILES:  # in its own light, of its own size
            if not luminance(frame.color).mean() > 0:
                return f"frame {frame.index} of {drawn.record['file']} is black"
            if np.mean(frame.depth > 0) < _FEWEST_THINGS:
                return f"frame {frame.index} of {drawn.record['file']} shows nothing"
            continue
        light, depth = displayed(frame.color), frame.depth
        if not light >= DARKEST:  # NaN, too
            return f"frame {frame.index} is dark"
        if light > BRIGHTEST:
            return f"frame {frame.index} is blown"
        if np.mean((depth > 0) & (depth < _NEAR)) > _MOST_NEAR:
            return f"something is in front of frame {frame.index}"
        shown = np.where(frame.id < 0, -1, frame.id % len(names))  # an image is of what it shows
        if np.mean(np.isin(shown, things)) < _FEWEST_THINGS:
            return f"frame {frame.index} shows no things"
        if np.mean(np.isin(shown, lamps)) > _MOST_LAMP:
            return f"a lamp is in front of frame {frame.index}"
    return None


def displayed(color: np.ndarray) -> float:
    """Mean of the displayed values of noisy radiance, (h, w, 3), gamma 2.2, of 8x8 pixels each:
    of single ones it would be the lower, the noisier they are."""
    shown = luminance(color.astype(np.float64))
    side = min(_BLOCK, *shown.shape)
    h, w = (size // side for size in shown.shape)
    blocks = shown[:h * side, :w * side].reshape(h, side, w, side).mean(axis=(1, 3))
    return float(np.mean(np.clip(blocks, 0, 1) ** (1 / 2.2)))
