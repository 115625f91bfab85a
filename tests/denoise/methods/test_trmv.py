"""TRMV: its formulas in float64, what it is without its motions, and where these lead."""

from dataclasses import replace

import numpy as np
import pytest

from onespp.denoise.bench.probe_frames import probe
from onespp.denoise.history.reprojection import locate, motion_between
from onespp.denoise.inputs.surface import read_surface
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods.reliable_motion.mirror_images import image_place, read_reflection
from onespp.denoise.methods.reliable_motion.trmv import Trmv
from onespp.denoise.methods.svgf import Svgf
from onespp.denoise.oracles.trmv import trmv
from onespp.render.channels import FRAME, GLOSS
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.hard import HARD
from onespp.scenes.materials import metal
from tests.support.frames import make_frame, translation, with_images
from tests.support.recordings import taking_turns

MOTIONS = ("shadow_motion", "glossy_motion", "dual_motion")
QUICK = [probe(28, 40, i) for i in (0, 6, 12)]  # the square moves by three pixels


def run(method, frames):
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def only(*motions):
    return {name: name in motions for name in MOTIONS}


@pytest.mark.parametrize("motions", [(name,) for name in MOTIONS] + [MOTIONS])
def test_each_motion_is_the_formula_in_float64_and_changes_something(motions):
    image = run(Trmv(**only(*motions)), QUICK)
    np.testing.assert_allclose(image, trmv(QUICK, **only(*motions)), atol=5e-5)
    assert np.abs(image - run(Svgf(), QUICK)).max() > 1e-3


def test_without_its_motions_it_is_svgf():
    np.testing.assert_array_equal(run(Trmv(**only()), QUICK), run(Svgf(), QUICK))


def test_what_a_board_uncovers_takes_history_from_beside_where_the_board_was():
    """The wall is painted with its columns, before and now; the board moves six pixels."""
    frames = [with_images(make_frame(24, 48, index=i, board=translation(0.625 * i, 0, 0),
                                     wall_end=1e9), color=color)
              for i, color in enumerate([np.arange(48.0)[None, :, None] * np.ones((24, 1, 3)),
                                          np.full((24, 48, 3), 1e3)])]
    settings = {"levels": 1, "demodulate": False, "split": False, "alpha": 1e-6}
    method = Trmv(**settings, **only("dual_motion"), feedback=False, fallback=False)
    _, state = method(frames[0], method.init(24, 48))
    _, state = method(frames[1], state)
    stencil = state.stencil
    history = stencil.image(stencil.unpack(state.records, np.arange(stencil.lanes), 16, 8)[4:6])
    uncovered = (frames[0]["id"] == 1) & (frames[1]["id"] == 0)
    x = np.argwhere(uncovered)[:, 1]
    red = history[uncovered][:, 1]
    beside = (history[uncovered][:, 0] == 2)
    assert uncovered.sum() > 40
    assert beside.mean() > 0.7
    np.testing.assert_allclose(red[beside], (0.5 * (x - 6) + 500)[beside], atol=2e-2)


def test_a_mirror_image_is_looked_for_where_it_was_seen():
    """A ball rolls by before a polished metal: where a pixel shows it now, the pixel at the image's
    place showed it before, and the pixel itself often did not."""
    scene = HARD["mirror"].make()
    scene = replace(scene, shapes=tuple(
        replace(shape, material=metal(roughness=1e-4)) if shape.name == "mirror" else shape
        for shape in scene.shapes))
    renderer = Renderer(scene, 48, 64)
    frames = [renderer.frame(i, channels=(*FRAME, *GLOSS)) for i in (4, 6)]
    stencil = Stencil(48, 64, 1)
    surface = read_surface(frames[1], stencil)
    motion = motion_between(frames[0], frames[1], stencil)
    place = locate(stencil, surface.sample, motion, stencil.Float(1))
    reflection = read_reflection(frames[1], frames[0], surface.position, stencil)
    image, there = image_place(stencil, surface.sample, reflection, place)
    at = stencil.image([image.x, image.y, stencil.Float(there)])
    mirrors = (frames[1]["roughness"] < 1e-3) & (at[..., 2] > 0)
    moving = frames[1].world_from_object != frames[0].world_from_object
    shows = mirrors & np.isin(frames[1]["hit_id"], np.flatnonzero(moving.any((1, 2))))
    x, y = (at[shows][:, i].astype(int) for i in (0, 1))
    now, before = frames[1]["hit_id"][shows], frames[0]["hit_id"]
    assert shows.sum() > 20
    assert (before[y, x] == now).mean() > 0.8
    assert (before[shows] == now).mean() < 0.65


def test_five_frames_one_recording_and_threads_change_nothing():
    method, frames = Trmv(), [probe(9, 12, i) for i in range(5)]
    state = method.init(9, 12)
    for frame in frames:
        _, state = method(frame, state)
    assert state.passes is not None
    assert (state.passes.accumulate.recordings, state.tabulate.recordings) == (1, 1)
    one, two = taking_turns(lambda: run(method, QUICK))
    np.testing.assert_array_equal(one, two)


def test_signals_that_come_and_go_begin_a_history_anew():
    """A frame without reflections has two signals, and records of another size."""
    bare = with_images(QUICK[1])
    images = {k: v for k, v in bare.images.items() if k != "hit_id"}
    bare = type(bare)(bare.index, images, bare.camera_from_world, bare.screen_from_world,
                      bare.world_from_object)
    image = run(Trmv(), [QUICK[0], bare])
    np.testing.assert_array_equal(image, run(Trmv(), [bare]))
