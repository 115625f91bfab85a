"""Laws that every denoising method keeps, checked over the one table of methods."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, build, parameters
from onespp.denoise.inputs import repair as repair_module
from onespp.denoise.inputs.repair import repair
from onespp.render.channels import CHANNELS
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from tests.support.frames import make_frame, noisy, translation, with_images

from .test_filtered_innovation import split

# Small windows keep these quick; the formulas are tested with the defaults elsewhere.
SMALL = {"gaussian": {"radius": "4"}, "gaussian-separable": {"radius": "4"},
         "bilateral-color": {"radius": "4"},
         "bilateral": {"radius": "4"}, "bilateral-separable": {"radius": "4"},
         "assignment": {"radius": "4"}, "atrous": {"levels": "3"},
         "assignment-atrous": {"levels": "3"}, "temporal": {}, "svgf": {"levels": "3"},
         "asvgf": {"levels": "3"}, "trmv": {"levels": "3"},
         "bmfr": {"block_size": "8"},
         "rae-quarter": {}, "unet-half": {},
         "taa": {},
         "onespp": {"innovation_levels": "3", "output_levels": "3", "sharp_output_levels": "2"}}
SMALL["onespp-taa"] = SMALL["onespp"]

# Colours alone do not tell objects apart: the first three leak, and are there to show it. So does
# a fit whose features tell objects apart only as far as a sum of them can, and a network, however
# well it is trained: nothing in it compares IDs.
# Anti-aliasing is to make a pixel of an edge the mean of both sides.
LEAKING = {"gaussian", "gaussian-separable", "bilateral-color", "bmfr", "rae-quarter", "unet-half",
           "taa", "onespp-taa"}

# A network's weights do not add up to one, so that it keeps what is already clean only as far as it
# has learned to. What else holds of it, the window's extremes see to.
LEARNED = {"rae-quarter", "unet-half"}

each_method = pytest.mark.parametrize("name", METHODS)
SIZES = [(1, 1), (1, 7), (7, 1), (3, 5), (13, 17), (23, 2)]


def run(name, *frames, **settings):
    method = build(name, {**SMALL[name], **settings})
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def plain(name):
    """Settings that keep a method from dividing by albedo."""
    return {"demodulate": "false"} if "demodulate" in parameters(METHODS[name]()) else {}


def local_extremes(color, reach):
    height, width, _ = color.shape
    low, high = np.empty_like(color), np.empty_like(color)
    for y in range(height):
        for x in range(width):
            window = color[max(y - reach, 0):y + reach + 1, max(x - reach, 0):x + reach + 1]
            low[y, x], high[y, x] = window.min((0, 1)), window.max((0, 1))
    return low, high


def test_the_small_settings_cover_the_table():
    assert set(SMALL) == set(METHODS)


@each_method
@pytest.mark.parametrize(("height", "width"), SIZES)
def test_a_constant_image_stays_constant_at_any_size(name, height, width):
    frames = [with_images(make_frame(height, width, index=i, camera=translation(0.02 * i, 0, 0)),
                          color=np.full((height, width, 3), [0.7, 0.2, 3.0])) for i in range(3)]
    result = run(name, *frames, **plain(name))
    assert result.shape == (height, width, 3)
    assert result.dtype == np.float32
    np.testing.assert_allclose(result, frames[0]["color"], rtol=2e-6)


@each_method
def test_every_result_lies_between_the_extremes_around_it(name):
    frames = [noisy(make_frame(17, 21, index=i), seed=i) for i in range(3)]
    # History may bring any earlier frame's.
    reach = 40 if name.startswith(("assignment", "svgf", "trmv", "asvgf")) else 14
    joined = np.stack([f["color"] for f in frames])
    low, high = local_extremes(joined.min(0), reach)[0], local_extremes(joined.max(0), reach)[1]
    result = run(name, *frames, **plain(name))
    assert (result >= low - 1e-5).all()
    assert (result <= high + 1e-5).all()


@pytest.mark.parametrize("name", [name for name in METHODS if name not in LEAKING])
def test_nothing_leaks_across_the_edge_of_an_object(name):
    """Wall, board and background have one colour each; the board moves."""
    def painted(i):
        frame = make_frame(24, 32, index=i, board=translation(0.15 * i, 0, 0), wall_end=1.5)
        colors = np.array([[0.5, 0.5, 0.0], [0.1, 0.5, 0.1], [0.9, 0.5, 0.6]])
        return with_images(frame, color=colors[frame["id"] + 1])

    frames = [painted(i) for i in range(4)]
    assert len(np.unique(frames[0]["id"])) == 3
    # So wide a tolerance of colour that geometry alone holds the colours apart.
    wide = {"sigma_color": "100", "sigma_luminance": "1e6", "color_box": "100"}
    known = parameters(METHODS[name]())
    result = run(name, *frames, **{k: v for k, v in wide.items() if k in known}, **plain(name))
    np.testing.assert_allclose(result, frames[-1]["color"], atol=2e-3)


@each_method
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_pixel_stays_one_pixel_and_takes_its_neighbours_colour(name, bad):
    flat = with_images(make_frame(15, 15), color=np.full((15, 15, 3), 0.4))
    color = np.array(flat["color"])
    color[7, 7, 1] = bad
    color[0, 0] = bad
    frames = [flat, with_images(flat, color=color), flat]
    np.testing.assert_allclose(run(name, *frames, **plain(name)), 0.4, rtol=1e-5)
    if name not in LEARNED:  # 0.4 over an albedo that is not constant is a picture to be learned
        np.testing.assert_allclose(run(name, *frames[:2]), 0.4, rtol=1e-5)


@each_method
def test_an_image_of_bad_pixels_alone_gives_zeros(name):
    frame = with_images(make_frame(5, 6), color=np.full((5, 6, 3), np.nan))
    assert (run(name, frame, frame) == 0).all()


@each_method
@pytest.mark.parametrize("channel", ["normal", "depth", "position", "albedo"])
@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_broken_guides_give_finite_output(name, channel, value):
    frame = noisy(make_frame(12, 14))
    image = np.array(frame[channel])
    image[3:6, 4:9] = value
    some = with_images(frame, **{channel: image})
    everywhere = with_images(frame, **{channel: np.full_like(image, value)})
    for broken in (some, everywhere):
        result = run(name, frame, broken, broken)
        assert np.isfinite(result).all()
        assert result.max() <= 10 * frame["color"].max()


@each_method
@pytest.mark.parametrize("gone", [0, 1])
def test_an_object_that_vanishes_and_comes_back_leaves_images_finite(name, gone):
    """Shrunk to a point, as is usual; with glossy light and shadow rays, and background in view."""
    frames = split(16, 20, 4)
    for i in (1, 2):
        matrices, is_gone = frames[i].world_from_object.copy(), frames[i]["id"] == gone
        matrices[gone, :3, :3] = 0
        images = {channel: np.where(is_gone if image.ndim == 2 else is_gone[..., None],
                                    CHANNELS[channel].background, image)
                  for channel, image in frames[i].images.items()}
        frames[i] = replace(with_images(frames[i], **images), world_from_object=matrices)
        assert (images["id"] < 0).any()
    for some in (frames[:2], frames[:3], frames, frames[1:]):
        assert np.isfinite(run(name, *some)).all()


@each_method
def test_nothing_but_background_comes_out_as_it_is_near_itself(name):
    frame = make_frame(9, 10)
    empty = with_images(frame, id=np.full((9, 10), -1), normal=np.zeros((9, 10, 3)),
                        depth=np.zeros((9, 10)), color=np.full((9, 10, 3), 0.3))
    np.testing.assert_allclose(run(name, empty, empty, **plain(name)), 0.3, rtol=1e-5)


# Not LEARNED: this noise is much less than that of one sample, and its texture is in the light: not
# what a network is trained on. (It made the error 1.9 times as large after 437 steps.)
@pytest.mark.parametrize("name", [name for name in METHODS if name not in LEARNED])
def test_a_still_scene_has_less_noise_in_its_result(name):
    """Spatial filters less in space; those with a history also from frame to frame."""
    clean = make_frame(32, 40, wall_end=1e9)
    frames = [noisy(clean, seed=i) for i in range(6)]
    result = run(name, *frames)
    before = np.mean((frames[-1]["color"] - clean["color"])**2)
    assert np.mean((result - clean["color"])**2) < 0.7 * before


@pytest.mark.parametrize("name", ["temporal", "assignment", "assignment-atrous", "svgf",
                                  "trmv", "asvgf", "bmfr"])
def test_history_makes_a_still_scene_flicker_less(name):
    clean = make_frame(24, 24, wall_end=1e9)
    method = build(name, SMALL[name])
    state, images = method.init(24, 24), []
    for i in range(12):
        image, state = method(noisy(clean, seed=i), state)
        images.append(image)
    first = [build(name, SMALL[name]) for _ in range(2)]
    alone = [m(noisy(clean, seed=i), m.init(24, 24))[0] for i, m in enumerate(first)]
    assert np.std(images[-1] - images[-2]) < 0.7 * np.std(alone[0] - alone[1])


@each_method
@pytest.mark.parametrize("unit", [1e-4, 1e4])
def test_the_unit_of_length_does_not_matter(name, unit):
    """Camera and objects stand at the origin here: only depth and position have a length."""
    frames = [noisy(make_frame(15, 18, index=i), seed=i) for i in range(2)]
    scaled = [with_images(f, depth=unit * f["depth"], position=unit * f["position"])
              for f in frames]
    np.testing.assert_allclose(run(name, *scaled), run(name, *frames), atol=1e-4)


@each_method
def test_a_missing_channel_is_named(name):
    frame = make_frame(6, 6)
    for channel in METHODS[name].needs:
        images = {k: v for k, v in frame.images.items() if k != channel}
        poor = Frame(0, images, frame.camera_from_world, frame.screen_from_world,
                     frame.world_from_object)
        with pytest.raises(InputError, match=f"lacks the channel '{channel}'"):
            run(name, poor)


@each_method
def test_what_it_says_it_needs_is_enough(name):
    frame = noisy(make_frame(6, 7))
    images = {k: frame[k] for k in METHODS[name].needs}
    result = run(name, Frame(0, images, frame.camera_from_world, frame.screen_from_world,
                             frame.world_from_object))
    assert np.isfinite(result).all()


@each_method
def test_images_of_the_wrong_shape_and_size_are_refused(name):
    frame = make_frame(6, 7)
    with pytest.raises(InputError, match="shape"):
        with_images(frame, color=np.zeros((6, 7)))
    method = build(name, SMALL[name])
    with pytest.raises(InputError, match=r"7x6.*7x8"):
        method(frame, method.init(8, 7))
    with pytest.raises(InputError, match="empty"):
        method.init(0, 7)


@each_method
def test_a_call_with_something_else_than_a_frame_and_its_state_is_refused(name):
    frame, method = make_frame(6, 7), build(name, SMALL[name])
    for state in ((), object()):
        with pytest.raises(InputError, match=r"a state that is not its own.*init\(height, width\)"):
            method(frame, state)
    things: tuple[Any, ...] = (None, frame["color"])
    for thing in things:
        with pytest.raises(InputError, match=f"called with a {type(thing).__name__}: give it a Fr"):
            method(thing, method.init(6, 7))


def test_a_state_that_reaches_less_far_than_the_filter_is_refused():
    state = build("bilateral", {"radius": "2"}).init(6, 7)
    with pytest.raises(InputError, match="not its own"):
        build("bilateral", {"radius": "5"})(make_frame(6, 7), state)


@each_method
@pytest.mark.parametrize("size", [("16", 20), (16.0, 20.0), (None, 5)])
def test_a_size_that_is_no_whole_number_is_refused(name, size):
    with pytest.raises(InputError, match="use whole numbers"):
        build(name, SMALL[name]).init(*size)


@each_method
def test_an_error_and_other_methods_in_between_change_no_result(name):
    frames = [noisy(make_frame(9, 11, index=i), seed=i) for i in range(3)]
    expected = run(name, *frames)
    method, other = build(name, SMALL[name]), build("svgf", SMALL["svgf"])
    state, others = method.init(9, 11), other.init(9, 11)
    for frame in frames:
        with pytest.raises(InputError, match="is 5x4"):
            method(make_frame(4, 5), state)
        _, others = other(frame, others)
        image, state = method(frame, state)
    np.testing.assert_array_equal(image, expected)


@each_method
def test_a_camera_that_does_not_project_is_refused(name):
    frame = make_frame(6, 7)
    nothing, objects = np.zeros((4, 4)), frame.world_from_object
    flat = Frame(0, frame.images, frame.camera_from_world, nothing, objects)
    with pytest.raises(InputError, match="screen_from_world is singular"):
        run(name, flat)
    nowhere = Frame(0, frame.images, nothing, frame.screen_from_world, objects)
    with pytest.raises(InputError, match="camera_from_world of frame 0 is singular"):
        run(name, nowhere)


@each_method
def test_the_same_input_gives_the_same_bytes(name):
    frames = [noisy(make_frame(13, 17, index=i), seed=i) for i in range(3)]
    np.testing.assert_array_equal(run(name, *frames), run(name, *frames))


def test_defaults_are_those_of_the_assignment():
    assert parameters(METHODS["assignment"]()) == {
        "radius": 16, "sigma_coord": 32.0, "sigma_color": 0.6, "sigma_normal": 0.1,
        "sigma_plane": 0.1, "demodulate": False, "isolate_background": True, "alpha": 0.2,
        "color_box": 1.0, "clamp_radius": 3, "nearest": False, "min_cosine": 0.9,
        "plane_tolerance": 0.02}


def test_parameters_are_read_from_text_at_any_depth():
    method = build("assignment", {"sigma_color": "8", "radius": "5", "nearest": "yes"})
    expected = {"sigma_color": 8.0, "radius": 5, "nearest": True}
    assert {k: parameters(method)[k] for k in expected} == expected
    assert type(parameters(method)["radius"]) is int


@pytest.mark.parametrize(("name", "settings", "words"), [
    ("median", {}, "unknown method 'median': use gaussian, gau"),
    ("bilateral", {"sigma": "1"}, "no parameter 'sigma': it has radius, sigma_coord"),
    ("assignment", {"radius": "2.5"}, "radius is '2.5': use a whole number"),
    ("temporal", {"nearest": "maybe"}, "nearest is 'maybe': use true or false"),
    ("temporal", {"alpha": "x"}, "alpha is 'x': use a number"),
    ("temporal", {"alpha": "7"}, "alpha is 7")])
def test_bad_settings_are_explained(name, settings, words):
    with pytest.raises(InputError, match=words.replace("'", ".")):
        build(name, settings)


def test_repair_takes_the_mean_of_the_same_object_around():
    color, id_ = np.ones((9, 12, 3), np.float32), np.zeros((9, 12), np.int32)
    color[:, 6:], id_[:, 6:] = 5.0, 1
    bad = color.copy()
    bad[4, 5, 0], bad[0, 0], bad[8, 6:9] = np.nan, np.inf, 1e30
    np.testing.assert_array_equal(repair(bad, id_), color)
    assert repair(color, id_) is color
    alone = id_.copy()
    alone[4, 5] = 7
    assert (repair(bad, alone)[4, 5] == 0).all()


def test_a_bad_pixel_is_looked_at_until_a_good_one_is_found_and_no_longer(monkeypatch):
    """One pixel in 4x4 is good: the next one is 1 to 3 pixels off, 3 only at the far edges."""
    asked, sums = [], repair_module._sums_around

    def counting(color, good, id_, y, x, radius):
        asked.append((radius, len(y)))
        return sums(color, good, id_, y, x, radius)

    monkeypatch.setattr(repair_module, "_sums_around", counting)
    color, id_ = np.full((256, 256, 3), np.nan, np.float32), np.zeros((256, 256), np.int32)
    color[::4, ::4] = 0.25
    np.testing.assert_array_equal(repair(color, id_), 0.25)
    near = 256 - 64 - 1  # rows at most 1 pixel from a good one
    assert asked == [(1, 256**2 - 64**2), (2, 256**2 - near**2), (3, 256**2 - 255**2),
                     *((radius, 0) for radius in range(4, 9))]
