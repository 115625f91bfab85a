import json

import numpy as np
import pytest

from onespp.denoise.catalog import build, channels_read, parameters
from onespp.denoise.methods.outliers import FEWEST, RemoveOutliers, energy_kept
from onespp.denoise.oracles.filters import pairs, plane_weight_distance, read
from onespp.render.errors import InputError
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from tests.support.frames import make_frame, noisy, translation, with_images
from tests.support.recordings import compiled


def clean(stage, *frames):
    state = stage.init(frames[0].height, frames[0].width)
    for frame in frames:
        frame, state = stage(frame, state)
    return frame, state


def oracle(frame, color, width, radius, plane=0.02):
    """The clamp in float64, one tap at a time."""
    shape = frame["id"].shape
    pixels = read(frame, c=color, id=frame["id"])
    count, sums, squares = np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3))
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            where, p, q = pairs(pixels, shape, dy, dx)
            if where is None or dy == dx == 0:
                continue
            alike = (p.id == q.id) & (plane_weight_distance(p, q) < plane)
            count[where] += alike
            sums[where] += np.where(alike[..., None], q.c, 0)
            squares[where] += np.where(alike[..., None], q.c**2, 0)
    n = np.maximum(count, 1)[..., None]
    mean, sigma = sums / n, np.sqrt(np.maximum(squares / n - (sums / n)**2, 0))
    clamped = np.clip(color, mean - width * sigma, mean + width * sigma)
    return np.where(count[..., None] >= FEWEST, clamped, color)


def with_firefly(value=100.0):
    frame = with_images(make_frame(11, 13, wall_end=1e9, board=translation(100, 0, 0)),
                        color=np.full((11, 13, 3), 0.5))
    color = np.array(frame["color"])
    color[5, 6] = value
    return with_images(frame, color=color)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 9), (13, 17)])
@pytest.mark.parametrize("options", [{}, {"outlier_width": 1.0}, {"outlier_radius": 3},
                                     {"outlier_plane": 0.002}])
def test_agrees_with_the_formula_in_float64(height, width, options):
    frame = noisy(make_frame(height, width), sigma=1.5)
    result, _ = clean(RemoveOutliers(**options), frame)
    stage = RemoveOutliers(**options)
    expected = oracle(frame, frame["color"].astype(np.float64), stage.outlier_width,
                      stage.outlier_radius, stage.outlier_plane)
    np.testing.assert_allclose(result["color"], expected, rtol=1e-4, atol=1e-5)
    if min(height, width) > 1:
        assert (result["color"] != frame["color"]).any()


def test_a_firefly_becomes_its_surroundings_and_its_energy_is_counted():
    frame = with_firefly()
    result, state = clean(RemoveOutliers(), frame)
    np.testing.assert_allclose(result["color"][5, 6], 0.5, rtol=1e-5)
    kept = state.after / state.before
    assert kept == pytest.approx(result["color"].mean() / frame["color"].mean(), rel=1e-5)
    assert kept < 0.5


def test_a_small_bright_object_is_no_outlier():
    """It has few pixels of its own around it, and those of the wall do not count."""
    frame = make_frame(21, 21, wall_end=1e9)
    color = np.where(frame["id"][..., None] == 1, 50.0, 0.1) * np.ones(3)
    result, _ = clean(RemoveOutliers(), with_images(frame, color=color))
    np.testing.assert_allclose(result["color"], color, rtol=1e-5)


def test_another_object_on_the_same_plane_does_not_count():
    frame = make_frame(11, 13, wall_end=1e9, board=translation(100, 0, 0))
    id_ = np.zeros((11, 13))
    id_[4:7, 5:8] = 1
    color = np.where(id_[..., None] == 1, 50.0, 0.1) * np.ones(3)
    result, _ = clean(RemoveOutliers(outlier_width=0.5), with_images(frame, id=id_, color=color))
    np.testing.assert_allclose(result["color"], color, rtol=1e-5)


def test_a_texture_is_no_outlier():
    frame = make_frame(12, 12, wall_end=1e9)
    albedo = np.full((12, 12, 3), 0.02)
    albedo[6, 6] = 0.9
    result, _ = clean(RemoveOutliers(), with_images(frame, albedo=albedo, color=3 * albedo))
    np.testing.assert_allclose(result["color"], 3 * albedo, rtol=1e-5)


def parts_of(frame, seed=0):
    """The frame with light in parts, a firefly in each."""
    rng = np.random.default_rng(seed)
    parts = {n: rng.random((frame.height, frame.width, 3)) for n in ("direct", "specular", "other")}
    for i, image in enumerate(parts.values()):
        image[4, 3 + i] = 200.0
    indirect = parts["specular"] + parts["other"]
    emission = rng.random((frame.height, frame.width, 3))
    return with_images(frame, emission=emission, direct=parts["direct"], indirect=indirect,
                       specular=parts["specular"], color=emission + parts["direct"] + indirect)


def test_parts_are_cleaned_apart_and_still_add_up():
    frame = parts_of(make_frame(11, 13, wall_end=1e9, board=translation(100, 0, 0)))
    result, _ = clean(RemoveOutliers(), frame)
    total = result["emission"] + result["direct"] + result["indirect"]
    np.testing.assert_allclose(result["color"], total, rtol=1e-4, atol=1e-4)
    for name in ("direct", "indirect", "specular"):
        assert result[name].max() < 10
    assert (result["indirect"] >= result["specular"] - 1e-5).all()
    np.testing.assert_array_equal(result["emission"], frame["emission"])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_pixel_does_not_spread(bad):
    frame = parts_of(make_frame(11, 13, wall_end=1e9))
    images = {}
    for name in ("color", "direct", "indirect", "specular"):
        images[name] = np.array(frame[name])
        images[name][8, 9] = bad
    result, state = clean(RemoveOutliers(), with_images(frame, **images))
    for name in images:
        assert np.isfinite(result[name]).all()
    assert np.isfinite(state.after / state.before)


def test_a_wide_enough_clamp_changes_nothing():
    frame = noisy(make_frame(11, 13))
    result, state = clean(RemoveOutliers(outlier_width=1e4), frame)
    np.testing.assert_allclose(result["color"], frame["color"], rtol=1e-5)
    assert state.after / state.before == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", ["atrous", "svgf", "temporal"])
def test_any_method_can_follow_it(name):
    method = build(name, {"outlier_radius": "3"}, outliers=2.5)
    assert parameters(method) == {**parameters(build(name)), "outlier_width": 2.5,
                                  "outlier_radius": 3, "outlier_plane": 0.02}
    frame = with_firefly(1e4)
    image, state = method(frame, method.init(11, 13))
    np.testing.assert_allclose(image, 0.5, rtol=1e-4)
    plain = build(name)
    before, plain_state = plain(frame, plain.init(11, 13))
    assert before.max() > 1
    assert energy_kept(state) == state.energy_kept < 0.1
    assert energy_kept(plain_state) is None


def test_what_the_method_reads_is_read():
    method = build("svgf", outliers=3.0)
    assert {"color", "normal", "depth", "id"} <= set(method.needs)
    there = ("albedo", "emission", "direct", "indirect", "specular", "visibility")
    assert channels_read(method, there) == (*method.needs, *there[:-1])
    assert channels_read(build("atrous"), there)[-2:] == there[:2]


def test_five_frames_one_recording_and_another_width_compiles_nothing():
    frames = [noisy(make_frame(9, 11, index=i), seed=i) for i in range(5)]
    _, state = clean(RemoveOutliers(), *frames)
    assert state.clamp.recordings == 1
    assert compiled(lambda: clean(RemoveOutliers(outlier_width=1.5, outlier_plane=0.1),
                                  *frames)) == 0


@pytest.mark.parametrize("options", [{"outlier_width": 0.0}, {"outlier_radius": 9},
                                     {"outlier_radius": 0}, {"outlier_plane": float("nan")}])
def test_bad_parameters_are_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        RemoveOutliers(**options)


def test_the_command_says_what_it_took(tmp_path, call):
    folder, frames = tmp_path / "wall", [noisy(make_frame(9, 11, index=i), i) for i in range(2)]
    sequence = FrameSequence.create(folder, Manifest(
        scene="wall", frames=(0, 1), width=11, height=9, channels=tuple(frames[0].images),
        objects=("wall", "board")))
    for frame in frames:
        sequence.write_frame(frame)
    code, out, _ = call("denoise", folder, "--method", "atrous", "--outliers", "1")
    run = json.loads((folder / "denoised/atrous+outliers/run.json").read_text())
    assert code == 0
    assert 0 < run["energy_kept"] < 1
    assert f"{1 - run['energy_kept']:.2%} of the energy" in out
    assert run["parameters"]["outlier_width"] == 1.0
    code, _, err = call("denoise", folder, "--method", "atrous", "--outliers", "0")
    assert (code, "outlier_width is 0.0: use a number above 0" in err) == (2, True)


def test_visibility_loses_what_direct_light_loses():
    """Otherwise the outlier stays in it, and its negative goes into the rest of the light."""
    flat = np.full((11, 13, 3), 0.25)
    visibility = np.full((11, 13), 0.5)
    visibility[5, 6] = 60.0
    direct = visibility[..., None] * 2 * flat
    frame = with_images(make_frame(11, 13, wall_end=1e9, board=translation(100, 0, 0)),
                        color=direct, direct=direct, indirect=0 * flat, unshadowed=2 * flat,
                        visibility=visibility)
    result, _ = clean(RemoveOutliers(), frame)
    assert result["visibility"][5, 6] == pytest.approx(0.5, rel=1e-4)
    np.testing.assert_allclose(result["visibility"][..., None] * result["unshadowed"],
                               result["direct"], rtol=1e-4)
