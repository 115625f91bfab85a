"""Temporal gradients: a few samples of the last frame, shaded again where their surfaces are now.

In each 3x3 stratum of the last frame one pixel is picked. The surface point that it saw is moved
with its object, and the camera of this frame looks at it with the random numbers that the pixel
had in the last frame. What then differs from the last frame's radiance is a change of shading, not
noise: in a scene in which nothing changes it is exactly 0.

The last frame is the one numbered one less, whether or not a sequence has it. Both radiances are
traced here, that frame's too, so that any frame can be rendered alone: two paths for every nine
pixels, beside the one path a pixel of the frame.

Source: Schied et al. 2018, "Gradient estimation for real-time adaptive temporal filtering"
(A-SVGF). Differs: the paper shades the old sample in place of one of this frame's; here it is one
more, so that the frame's own samples stay independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np

from onespp.render.host.aligned import owned
from onespp.render.mitsuba.variant import mi

from .camera_rays import camera_matrices
from .path import trace
from .sampler import FRAME_STREAM, GRADIENT_STREAM, keys_from_seed
from .view import Now, View

STRATUM = 3          # pixels, side
NO_SAMPLE = -1.0     # luminance where there is none
TOLERANCE = 1e-3     # of the distance: what lies nearer hides the point


@dataclass
class _Shaded:
    """Luminance of direct and indirect light, and whether the camera sees the point."""

    direct: mi.Float
    indirect: mi.Float
    seen: mi.Bool


def replay(view: View, index: int, previous: int | None,
           seed: int) -> dict[str, np.ndarray]:
    """The channels `replay` and `replay_before` of a frame, (h, w, 2) each.

    Args:
        previous: the frame before it, None for the first, which has no samples.
    """
    size = view.height, view.width
    now, before = (np.full((*size, 2), NO_SAMPLE, np.float32) for _ in range(2))
    if previous is not None:
        row, column, shaded_now, shaded_before = _shade_both(view, index, previous, seed)
        now[row, column], before[row, column] = shaded_now, shaded_before
    return {"replay": now, "replay_before": before}


def _shade_both(view: View, index: int, previous: int,
                seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Row and column in this frame, luminances (n, 2) now and before, of the samples seen."""
    stage, _ = view.stage, view.lights  # to find those moves the stage
    stage.set_frame(previous)
    pixel = owned(mi.UInt32, _picks(view.height, view.width, seed, previous))
    rays = view.rays()
    ray, _ = rays.at(*view.centres(pixel))
    with dr.suspend_grad():
        si = stage.mi_scene.ray_intersect(ray)
        point, id_ = mi.Point3f(si.p), stage.object_id(
            dr.reinterpret_array(mi.UInt32, si.shape), si.prim_index)
    dr.eval(point, id_)
    old_places = stage.world_from_object()
    keys = keys_from_seed(seed, FRAME_STREAM, previous)
    old = _Shaded(*view.replayed(_shade, view.now(keys), pixel, point, id_))
    stage.set_frame(index)
    point = _moved(point, id_, stage.stage_from_stage(old_places))
    new = _Shaded(*view.replayed(_shade, view.now(keys), pixel, point, id_))

    camera = camera_matrices(view.scene.camera, index, view.height, view.width,
                             view.jitter_at(index))
    at = np.nan_to_num(point.numpy().astype(np.float64).T)
    world = stage.origin + stage.unit * at
    screen = world @ camera.screen_from_world[:, :3].T + camera.screen_from_world[:, 3]
    seen = old.seen.numpy() & new.seen.numpy() & (screen[:, 3] > 0)
    column, row = np.floor(screen[:, :2] / np.where(seen, screen[:, 3], np.inf)[:, None]).T
    seen &= (column >= 0) & (row >= 0) & (column < view.width) & (row < view.height)
    row, column = (a[seen].astype(np.int64) for a in (row, column))
    now, before = (np.stack([s.direct.numpy(), s.indirect.numpy()], -1)[seen] for s in (new, old))
    return row, column, now, before


def _picks(height: int, width: int, seed: int, frame: int) -> np.ndarray:
    """Index of one pixel in each stratum, uint32."""
    rng = np.random.default_rng((seed, GRADIENT_STREAM, frame))
    y, x = np.mgrid[:height:STRATUM, :width:STRATUM]
    y += rng.integers(np.minimum(STRATUM, height - y))
    x += rng.integers(np.minimum(STRATUM, width - x))
    return (y * width + x).astype(np.uint32).ravel()


def _moved(point: mi.Point3f, id_: mi.Int32, matrices: np.ndarray) -> mi.Point3f:
    """Points moved with their objects; exactly what they were if those stand still."""
    table = owned(mi.Float, matrices[:, :3].astype(np.float32))
    start = mi.UInt32(dr.maximum(id_, 0)) * 12
    rows = [[dr.gather(mi.Float, table, start + 4 * r + c) for c in range(4)] for r in range(3)]
    moved = mi.Point3f(*(dr.fma(a, point.x, dr.fma(b, point.y, dr.fma(c, point.z, d)))
                         for a, b, c, d in rows))
    dr.eval(moved)
    return moved


def _shade(view: View, now: Now, pixel: mi.UInt32, point: mi.Point3f,
           id_: mi.Int32) -> tuple[mi.Float, mi.Float, mi.Bool]:
    """What the camera of the posed frame sees at points: as `_Shaded`."""
    stage, scene = view.stage, view.stage.mi_scene
    with dr.suspend_grad():
        origin = now.rays.origin
        toward = point - origin
        distance = dr.norm(toward)
        ray = mi.Ray3f(origin, toward / distance)
        pi = scene.ray_intersect_preliminary(ray, coherent=True)
        met = stage.object_id(dr.reinterpret_array(mi.UInt32, pi.shape), pi.prim_index)
        seen = (id_ >= 0) & (met == id_) & (dr.abs(pi.t - distance) < TOLERANCE * distance)
        sampler = view.new_sampler(now.keys, pixel)
        radiance = trace(scene, ray, pi, sampler, view.scene.max_depth,
                         view.candidates, now.lights, panes=now.panes, mirrors=now.mirrors,
                         balls=now.balls)
        shaded = mi.luminance(radiance.direct), mi.luminance(radiance.indirect), seen
    dr.eval(shaded)
    return shaded
