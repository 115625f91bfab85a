"""Hard scenes: each shows what it says it does, renders, and gives no method a broken image."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.geometry.correspondence import previous_pixel
from onespp.denoise.studies.hard_scenes import INPUT, Row, judge, markdown, misses, run_alone
from onespp.render.channels import REPLAY
from onespp.render.job import RenderJob, render_sequence
from onespp.render.tracer.camera_rays import camera_matrices
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.catalog import load
from onespp.scenes.description import Mesh, Rectangle, SceneError, Sphere
from onespp.scenes.hard import HARD
from onespp.scenes.hard.parts import EVENT
from tests.support.frames import with_images

from .hard_numbers import pixel_errors

HEIGHT, WIDTH, FRAMES = 16, 24, (3, 4, 5, 6, 9)
BENT = {"glass-ball", "window"}
BEHIND = {"mirror", "moving-mirror", "thin-glass", "foliage"}
REPLAYED = {"cut", "switched-on", "mirror", "shrinks", "sky"}
each_scene = pytest.mark.parametrize("name", HARD)


@cache
def rendered(name):
    """Frames `FRAMES` of a hard scene, small, and the mean of 64 samples of the last one.

    Only the scenes `REPLAYED` have samples of the frame before shaded again.
    """
    renderer = Renderer(HARD[name].make(), HEIGHT, WIDTH, direct="resampled", sampler="zsobol")
    channels = renderer.channels + (REPLAY if name in REPLAYED else ())
    frames = [renderer.frame(i, channels=channels) for i in FRAMES]
    if name not in REPLAYED:
        nothing = np.full((HEIGHT, WIDTH, 2), -1.0)
        frames = [with_images(f, **dict.fromkeys(REPLAY, nothing)) for f in frames]
    return frames, renderer.sample_sum(FRAMES[-1], 0, 0, 64) / 64


def places(scene, frame):
    return {"camera": scene.camera.world_from_camera_at(frame),
            **{s.name: s.world_from_object_at(frame) for s in scene.shapes}}


def state(scene, frame):
    """All that decides a frame's pixels, as one array of numbers."""
    emission = [s.emission_at(frame) or (0, 0, 0) for s in scene.shapes]
    return np.concatenate([np.ravel(m) for m in places(scene, frame).values()] + [
        np.ravel(emission)])


@each_scene
def test_a_hard_scene_is_small_has_its_name_and_is_a_function_of_the_frame(name):
    scene = load(f"hard/{name}")
    assert scene.name == f"hard/{name}"
    assert scene.width * scene.height <= 96 * 64
    assert scene.frames <= 12
    forward = [state(scene, i) for i in range(scene.frames)]
    again = load(f"hard/{name}")
    for i in reversed(range(scene.frames)):
        np.testing.assert_array_equal(state(again, i), forward[i])


@each_scene
def test_what_happens_at_once_happens_at_its_event(name):
    """The step at the event is the longest, and no other scene takes such a step."""
    scene, event = HARD[name].make(), HARD[name].event
    steps = [np.abs(state(scene, i + 1) - state(scene, i)).max() for i in range(scene.frames - 1)]
    if event is None:
        assert max(steps) <= 4 * np.median(steps)
    else:
        assert event == EVENT
        assert steps[event - 1] > 1
        assert steps[event - 1] > 4 * max(steps[:event - 1] + steps[event:])


def test_the_scenes_of_objects_show_what_they_are_called():
    def ball(name, frame):
        scene = HARD[name].make()
        in_camera = np.linalg.inv(scene.camera.world_from_camera_at(frame)) @ places(
            scene, frame)["ball"]
        screen = scene.camera.screen_from_camera(scene.height, scene.width) @ in_camera[:, 3]
        return in_camera, screen[0] / screen[3]

    (there, _), (gone, _) = ball("shrinks", 4), ball("shrinks", 5)
    assert np.linalg.det(there) > 0
    assert np.linalg.det(gone) == 0
    assert np.linalg.det(ball("mirrored", EVENT - 1)[0]) > 0
    assert np.linalg.det(ball("mirrored", EVENT)[0]) < 0
    assert ball("behind", 0)[0][2, 3] > 0
    assert ball("behind", 9)[0][2, 3] < 0
    assert ball("enters", 0)[1] < 0 < ball("enters", 9)[1] < 96
    assert ball("leaves", 9)[1] < 0 < ball("leaves", 0)[1] < 96
    assert np.linalg.norm(HARD["far"].make().camera.world_from_camera_at(0)[:3, 3]) > 1e6


@each_scene
def test_a_hard_scene_renders_to_finite_images_and_a_finite_reference(name):
    frames, reference = rendered(name)
    for frame in frames:
        for channel, image in frame.images.items():
            assert np.isfinite(image).all(), (channel, frame.index)
    assert np.isfinite(reference).all()
    assert reference.min() >= 0
    assert reference.mean() > 0.01


def test_a_sky_of_many_colours_leaves_even_ground_its_own():
    renderer = Renderer(HARD["colored-sky"].make(), 64, 96, direct="resampled", sampler="zsobol")
    frame, method = renderer.frame(0, channels=renderer.channels), build("onespp")
    image, _ = method(frame, method.init(64, 96))
    ground = np.isclose(frame["albedo"], 0.5).all(-1)
    np.testing.assert_allclose(image[ground].mean(0), frame["color"][ground].mean(0), rtol=0.02)


@each_scene
def test_every_pixel_lies_on_the_object_whose_id_it_has(name):
    """With a normal that faces the camera. What is scaled to nothing is not there. (Images are
    objects. Behind mirrors and panes rays begin a little off them; glass that bends puts what it
    shows elsewhere.)"""
    slack = 10 if name in BEHIND else 1
    scene, (frames, _) = HARD[name].make(), rendered(name)
    for frame in frames:
        matrices = camera_matrices(scene.camera, frame.index, HEIGHT, WIDTH)
        np.testing.assert_array_equal(frame.screen_from_world, matrices.screen_from_world)
        seen = 0
        for i, place in enumerate(frame.world_from_object):
            shape = scene.shapes[i % len(scene.shapes)]
            if i < len(scene.shapes):
                np.testing.assert_array_equal(place, shape.world_from_object_at(frame.index))
            rows, columns = np.nonzero(frame["id"] == i)
            if np.linalg.det(place) == 0:
                assert not rows.size, shape.name
                continue
            u = np.stack([columns + 0.5, rows + 0.5, np.ones(rows.size), 1 / np.maximum(
                frame["depth"][rows, columns], 1e-30)])
            homogeneous = np.linalg.inv(frame.screen_from_world @ place) @ u[[0, 1, 3, 2]]
            local = homogeneous[:3] / homogeneous[3]
            seen += rows.size
            toward_camera = np.linalg.inv(frame.camera_from_world)[:3, 3] - (
                place @ np.vstack([local, np.ones(rows.size)]))[:3].T
            assert (np.sum(toward_camera * frame["normal"][rows, columns], -1) > 0).all()
            on_it = on_surface(shape.geometry, local, slack)
            assert name in BENT or on_it.all(), (shape.name, frame.index)
        assert seen == (frame["id"] >= 0).sum()
        assert (frame["depth"][frame["id"] >= 0] > 0).all()


def on_surface(geometry, local, slack=1):
    """Whether points (3, n) of an object's own space lie on it; meshes: in its bounding box."""
    match geometry:
        case Sphere():
            return abs(np.linalg.norm(local, axis=0) - 1) < 2e-4 * slack
        case Rectangle():
            return (abs(local[:2]) < 1 + 1e-3 * slack).all(0) & (abs(local[2]) < 1e-3 * slack)
        case Mesh():
            low, high = geometry.vertices.min(0)[:, None], geometry.vertices.max(0)[:, None]
            return ((local > low - 1e-3 * slack) & (local < high + 1e-3 * slack)).all(0)


def test_a_scene_far_away_tiny_or_huge_looks_as_it_does_at_the_origin():
    plain, reference = rendered("huge")
    for name in ("far", "tiny"):
        frames, other = rendered(name)
        for a, b in zip(plain, frames):
            same = a["id"] == b["id"]
            assert same.mean() > 0.99
            np.testing.assert_allclose(b["normal"][same], a["normal"][same], atol=2e-3)
            np.testing.assert_allclose(b["unshadowed"][same], a["unshadowed"][same], rtol=0.02,
                                       atol=1e-3)
        np.testing.assert_allclose(other.mean(), reference.mean(), rtol=0.005)
    sizes = [rendered(name)[0][0]["depth"].max() for name in ("tiny", "far", "huge")]
    np.testing.assert_allclose(np.divide(sizes, sizes[1]), [1e-4, 1, 1e4], rtol=1e-4)
    hits = [Renderer(HARD[name].make(), HEIGHT, WIDTH).frame(
        3, channels=("hit_distance",))["hit_distance"].mean() for name in ("tiny", "far", "huge")]
    np.testing.assert_allclose(np.divide(hits, hits[1]), [1e-4, 1, 1e4], rtol=0.05)
    for ray in ("light", "blocker_distance"):
        means = [np.abs(rendered(name)[0][0][ray]).mean() for name in ("tiny", "far", "huge")]
        np.testing.assert_allclose(np.divide(means, means[1]), [1e-4, 1, 1e4], rtol=0.05)


def test_an_environment_map_is_seen_where_nothing_is_and_lights_the_rest():
    (frame, *_), _ = rendered("sky")
    nothing = frame["id"] < 0
    assert 0.3 < nothing.mean() < 1
    assert np.ptp(frame["color"][nothing], axis=0).max() > 0.05
    assert frame["color"][~nothing].mean() > 0.02
    assert (frame["direct"][nothing] == 0).all()


def test_an_environment_that_is_no_image_is_refused():
    scene = HARD["sky"].make()
    for image, complaint in ((np.ones((4, 8)), r"an image of shape \(4, 8\): use \(h, w, 3\)"),
                             (np.full((4, 8, 3), np.nan), "NaN|not finite|non-finite")):
        with pytest.raises(SceneError, match=f"the environment of scene 'hard/sky'.*({complaint})"):
            replace(scene, environment=image)


def test_what_a_matrix_flattens_is_refused_where_it_has_no_meaning():
    scene = HARD["shrinks"].make()
    flat = np.diag([0.5, 0.5, 0.0, 1.0])
    shapes = tuple(replace(s, world_from_object=flat) if s.name == "ball" else s
                   for s in scene.shapes)
    with pytest.raises(SceneError, match=r"'ball' is a Sphere that its matrix flattens"):
        Renderer(replace(scene, shapes=shapes), 4, 4)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_finite_images_on_every_hard_scene(method):
    small = {"radius": "4", "levels": "3"}
    denoiser = build(method, {k: small[k] for k in parameters(METHODS[method]()) if k in small})
    start = denoiser.init(HEIGHT, WIDTH)
    for name in HARD:
        frames, _ = rendered(name)
        state = start
        for frame in frames:
            image, state = denoiser(frame, state)
            assert np.isfinite(image).all(), (name, frame.index)
            assert np.abs(image).max() <= 2 * max(f["color"].max() for f in frames), name


@pytest.mark.parametrize("method", METHODS)
def test_a_state_before_any_frame_serves_again_as_one(method):
    """What `run_alone`, the yardstick of history, relies on."""
    frames, _ = rendered("uncovers")
    denoiser = METHODS[method]()
    alone = run_alone(denoiser, frames, denoiser.init(HEIGHT, WIDTH))
    expected, _ = METHODS[method]()(frames[-1], denoiser.init(HEIGHT, WIDTH))
    np.testing.assert_array_equal(alone[-1], expected)


@each_scene
def test_correspondence_stands_every_hard_scene(name):
    """Also where an object grows out of nothing, so that its motion has no inverse."""
    frames, _ = rendered(name)
    for previous, frame in pairwise(frames):
        source = previous_pixel(previous, frame)
        found = source >= 0
        np.testing.assert_array_equal(previous["id"].ravel()[source[found]], frame["id"][found])


@each_scene
def test_float32_reprojection_finds_the_place_that_float64_finds(name):
    """At 96x64 the largest error is 1e-4 pixels.

    `python -m tests.robustness.hard_numbers` prints all.
    """
    frames, _ = rendered(name)
    errors = np.concatenate([pixel_errors(a, b) for a, b in pairwise(frames[:4])])
    assert errors.size > 50
    assert np.percentile(errors, 99.9) < 1e-4
    assert errors.max() < 2e-4


def test_rows_say_what_history_costs_and_when_it_is_made_good():
    row = Row("cut", "m", (30, 30, 25, 27, 29.8, 30), (29, 29, 28, 28, 30, 30), 2, 0.95, 0, True)
    assert row.gain == pytest.approx(np.mean([1, 1, -3, -1, -0.2, 0]))
    assert row.worst == -3
    assert row.recovery == 2
    assert row.recovered
    assert misses([row]) == {
        "m: more than 0.3 dB worse than its history-free form": ["cut (-0.4)"],
        "m: energy off by more than 2 % where all is diffuse": ["cut (0.950)"]}
    assert len(misses([replace(row, diffuse=False), replace(row, method=INPUT)])) == 2
    late = replace(row, psnr=(30, 30, 25, 27, 29, 29), bad_pixels=3, energy=1.0)
    assert (late.recovery, late.recovered) == (4, False)
    assert misses([late, replace(late, scene="color")]) == {
        "m: pixels that are not finite": ["cut (3)", "color (3)"],
        "m: more than 0.3 dB worse than its history-free form": ["cut (-0.7)", "color (-0.7)"],
        "m: not recovered from a change when the scene ends": ["cut (4 frames)",
                                                               "color (4 frames)"]}
    assert (replace(row, event=None).recovery, replace(row, psnr=row.alone).recovery) == (None, 0)
    text = markdown([row, late])
    assert "| cut | > 4 |" in markdown([late])
    assert "- m: energy off by more than 2 % where all is diffuse: cut (0.950)" in markdown([row])
    assert markdown([replace(row, psnr=row.alone, energy=1)]).endswith("Nothing is missed.")
    assert text.count("\n| cut |") == 4


@pytest.mark.slow
def test_the_command_renders_judges_and_prints_every_method(call, monkeypatch, tmp_path):
    small = replace(HARD["switched-on"].make(), width=WIDTH, height=HEIGHT, frames=6)
    monkeypatch.setattr("onespp.scenes.hard.HARD", {"switched-on": replace(HARD["switched-on"],
                                                                    make=lambda: small)})
    code, out, _ = call("hard", "switched-on", "--out", tmp_path, "--reference-spp", 16)
    assert code == 0
    for name in (INPUT, *METHODS):
        assert f" {name} " in out.splitlines()[0]
    assert (tmp_path / "switched-on" / "reference" / "0005.exr").exists()


def test_a_hard_scene_that_is_not_there_is_named(call, tmp_path):
    code, _, err = call("hard", "swiched-on", "--out", tmp_path)
    assert code == 2
    assert "did you mean 'hard/switched-on'" in err


def test_judging_needs_references(tmp_path):
    scene = replace(HARD["cut"].make(), width=8, height=8, frames=2)
    sequence = render_sequence(RenderJob(scene, (0, 1), 8, 8), tmp_path)
    with pytest.raises(ValueError, match="lacks frame or reference 0"):
        judge(sequence, "cut", None, True)
