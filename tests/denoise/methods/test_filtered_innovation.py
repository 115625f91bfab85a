"""The filtered innovation against float64, its signals, and how it follows a change of light."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from onespp.denoise.inputs.color import read_color
from onespp.denoise.inputs.light_change import LightChange, change_of_lights, sample_light
from onespp.denoise.inputs.signals import USED, read_signals
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.methods import base as lanes
from onespp.denoise.methods.filtered_innovation import method as innovation
from onespp.denoise.methods.filtered_innovation.method import FilteredInnovation
from onespp.denoise.oracles import filtered_innovation as innovation_oracle
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, with_images
from tests.support.recordings import compiled, taking_turns

from .test_svgf import moving


def run(method, frames):
    image, state = method(frames[0], method.init(frames[0].height, frames[0].width))
    for frame in frames[1:]:
        image, state = method(frame, state)
    return image, state


def with_shadow_rays(frame, seed=0, light=(1.0, -3.0, 1.0)):
    """The frame with shadow rays to two lights of a size, of which the board (object 1) stops two
    in five, and paths of which half meet something close."""
    rng = np.random.default_rng(seed)
    there = frame["id"] >= 0
    lights = rng.choice([-1, 0], there.shape)
    points = light + rng.normal(0, 0.3, (*there.shape, 3)) * (2 + lights[..., None])
    toward = np.where(there[..., None], points - frame["position"], 0)
    stopped = there & (rng.random(there.shape) < 0.4)
    distance = np.linalg.norm(toward, axis=-1) * rng.uniform(0.3, 0.6, there.shape)
    hit = np.where(there, np.maximum(rng.uniform(-0.2, 0.2, there.shape), 0), 0)
    return with_images(frame, light=toward, light_id=lights,
                       blocker_distance=np.where(stopped, distance, 0),
                       blocker_id=np.where(stopped, 1, -1),
                       hit_distance=hit,
                       hit_id=np.where(hit > 0, rng.choice([-1, 0, 1], there.shape), -1))


def with_neighbour(frame):
    """The frame with the right part of its wall as an object of its own, number 2."""
    right = (frame["id"] == 0) & (frame["position"][..., 0] > 0.5)
    return replace(with_images(frame, id=np.where(right, 2, frame["id"])),
                   world_from_object=np.concatenate([frame.world_from_object,
                                                     frame.world_from_object[:1]]))


def with_lobes(frame):
    """The frame with a roughness from 0 at its top to 1 at its bottom, and no diffuse lobe on one
    side of it."""
    height, width = frame["id"].shape
    rows, columns = np.mgrid[:height, :width]
    rough = np.maximum(0.25 * (rows * 5 // height), 0.02 * (columns % 3))
    bare = (columns > width // 2)[..., None]
    return with_images(frame, roughness=np.where(frame["id"] >= 0, rough, 1),
                       albedo=np.where(bare, 1, frame["albedo"]))


def with_layers(frame):
    """The frame with a wall of tiles, of two objects, that a pane before its left half shows."""
    height, width = frame["id"].shape
    normal, point = np.array([0.1, -0.3, -0.9]), np.array([0, 0, 9])
    normal /= np.linalg.norm(normal)
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    y, x = np.mgrid[:height, :width] + 0.5
    on_screen = np.stack([x, y, 0 * x + 1, 0 * x + 1], -1) @ np.linalg.inv(
        frame.screen_from_world).T
    ray = on_screen[..., :3] / on_screen[..., 3:] - eye
    t = normal @ (point - eye) / (ray @ normal)
    there = (x < width / 2) & (t > 0)
    depth = np.where(there, t * (on_screen @ frame.screen_from_world[3]) / on_screen[..., 3], 0)
    place = np.where(there[..., None], eye + t[..., None] * ray, 0)
    tiles = np.floor(place[..., :2]).sum(-1).astype(int) % 2
    is_pane = (x < width / 2) & (y > height / 5)
    return with_images(
        frame, roughness=np.where(is_pane, 0, frame["roughness"]),
        layer_share=np.where(is_pane, 0.1 + 0.1 * y / height, 0),
        layer_albedo=np.where(is_pane & there, 0.02 + 0.1 * tiles, 0)[..., None] * [1, 0.8, 0.3],
        layer_normal=np.where(there[..., None], normal, 0), layer_depth=depth,
        layer_id=np.where(there, 2 * tiles, -1))


def with_leaves(frame, seed=0):
    """The frame with leaves smaller than a pixel, of two objects, in the place of a part of its
    wall, of which a third is not lit."""
    rng = np.random.default_rng(seed)
    shape = frame["id"].shape
    leaves = ((frame["id"] == 0) & (np.arange(shape[1]) > shape[1] // 3))[..., None]
    eye = np.linalg.inv(frame.camera_from_world)[:3, 3]
    nearer = np.where(leaves[..., 0], rng.uniform(0.97, 1.03, shape), 1)
    position = eye + (frame["position"] - eye) * nearer[..., None]
    normal = rng.normal(size=(*shape, 3)) - 1.5 * (position - eye) / np.maximum(np.linalg.norm(
        position - eye, axis=-1, keepdims=True), 1e-9)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lit = ~leaves | (rng.random((*shape, 1)) < 2 / 3)
    of_other = leaves[..., 0] & (rng.random(shape) < 0.5)
    return with_images(frame, depth=frame["depth"] * nearer, position=position,
                       id=np.where(of_other, 1, frame["id"]),
                       unshadowed=frame["unshadowed"] * lit, direct=frame["direct"] * lit,
                       normal=np.where(leaves, normal, frame["normal"]))


def split(height, width, count=3, lobes=True, layers=False, still=False, lamp=None):
    """Moving frames, or still ones, with all channels that the method uses, but for those of
    layers unless asked for, a lamp, and three objects; moving ones with a part that is black.
    lamp: its colour, or else another one in every frame."""
    frames = []
    for i, frame in enumerate(moving(height, width, 1) * count if still else
                              moving(height, width, count)):
        rng = np.random.default_rng(100 + i)
        there = frame["id"][..., None] >= 0
        albedo = frame["albedo"].copy()
        if not still:
            albedo[:height // 3, :width // 4] = 0
        color = [1.0, 0.8, 0.6] * rng.uniform(0.5, 1, (1, 1, 3))
        unshadowed = np.where(there, albedo * (color if lamp is None else lamp), 0)
        visibility = (rng.random((height, width)) < 0.6) * rng.gamma(4, 0.3, (height, width))
        direct = unshadowed * visibility[..., None] * rng.uniform(0.9, 1.1, (1, 1, 3))
        if still:  # (noise of its own)
            frame = with_images(frame, indirect=frame["indirect"] * rng.gamma(
                4, 0.25, (height, width, 1)))
        specular = 0.3 * frame["indirect"] * rng.random((height, width, 1))
        color = frame["emission"] + direct + frame["indirect"]
        frame = with_images(frame, albedo=albedo, unshadowed=unshadowed, color=color,
                            visibility=visibility, direct=direct, specular=specular)
        frame = with_lobes(frame) if lobes else frame
        frame = with_layers(frame) if layers else frame
        frames.append(with_neighbour(with_shadow_rays(frame, i)))
    return frames


def test_of_leaves_it_is_the_formula_in_float64():
    frames = [with_leaves(frame, i) for i, frame in enumerate(split(19, 26))]
    method = FilteredInnovation()
    image, _ = run(method, frames)
    expected = innovation_oracle.run(frames, method)
    np.testing.assert_allclose(image, expected, rtol=1e-3, atol=5e-5)


def test_what_faces_away_has_the_colour_of_its_frame_and_mixes_with_nothing():
    """The formula, and not that of what faces the camera."""
    frames = []
    for i, frame in enumerate(split(19, 26)):
        turned = np.random.default_rng(i).random((19, 26, 1)) < 0.04
        frames.append(with_images(
            frame, normal=np.where(turned, -frame["normal"], frame["normal"])))
    away = turned[..., 0] & (frames[-1]["id"] >= 0)
    assert 5 < away.sum() < 0.05 * away.size
    method = FilteredInnovation()
    image, _ = run(method, frames)
    expected = innovation_oracle.run(frames, method)
    np.testing.assert_allclose(image, expected, rtol=1e-3, atol=5e-5)
    difference = np.abs(run(method, split(19, 26))[0] - image).max(-1)
    assert np.median(difference[away]) > 0.1


def test_normals_that_point_inward_everywhere_are_as_good_as_others():
    frames = split(19, 26)
    inward = [with_images(frame, normal=-frame["normal"]) for frame in frames]
    images = [run(FilteredInnovation(), each)[0] for each in (frames, inward)]
    np.testing.assert_allclose(*images, rtol=1e-4, atol=1e-5)


def test_pixels_without_unshadowed_light_take_no_visibility_from_their_neighbours():
    frame = split(12, 16, 1, lobes=False)[0]
    rows, columns = np.mgrid[:12, :16]
    lit = ((rows + columns) % 2 == 0)[..., None] * frame["unshadowed"]
    full = with_images(frame, unshadowed=lit, direct=lit, visibility=np.ones((12, 16)),
                       indirect=0 * lit, specular=0 * lit, color=frame["emission"] + lit,
                       blocker_distance=np.zeros((12, 16)))  # as all is visible
    images = [run(FilteredInnovation(), [with_images(full, visibility=visibility)])[0]
              for visibility in (full["visibility"], np.where(lit.any(-1), 1, 0))]
    np.testing.assert_array_equal(*images)
    np.testing.assert_allclose(images[1], full["color"], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("height", "width", "levels"), [(640, 640, (4, 3)), (640, 641, (5, 4))])
def test_a_large_image_has_a_level_more(height, width, levels):
    stencil = Stencil(height, width, 1)
    frame = split(4, 5, 1)[0]
    light = read_signals(frame, read_color(frame, Stencil(4, 5, 1)), Stencil(4, 5, 1), True, True)
    layout = FilteredInnovation()._layout(light, False, stencil)
    assert (layout.output_levels, layout.sharp_output_levels) == levels
    layout = FilteredInnovation(innovation_levels=4)._layout(light, False, stencil)
    assert layout.output_levels == 4


@pytest.mark.parametrize("shadows", [True, False])
@pytest.mark.parametrize(("height", "width", "levels", "sharp_levels"), [
    (19, 26, 4, 2), (7, 5, 4, 2), (1, 9, 4, 2), (9, 70, 7, 6), (12, 9, 6, 3)])
def test_it_is_the_formula_in_float64(height, width, levels, sharp_levels, shadows):
    frames = split(height, width, lobes=shadows, layers=shadows and height > 9)
    method = FilteredInnovation(
        innovation_levels=levels, output_levels=3, sharp_innovation_levels=sharp_levels,
        sharp_output_levels=2, follow_shadows=shadows)
    image, _ = run(method, frames)
    expected = innovation_oracle.run(frames, method)
    np.testing.assert_allclose(image, expected, rtol=1e-3, atol=5e-5)


@pytest.mark.parametrize("still", [True, False])
def test_it_is_the_formula_where_lights_are_as_they_were(still):
    frames = split(19, 26, 4, lobes=False, still=still, lamp=[0.7, 0.6, 0.5])
    assert all(change_of_lights(sample_light(one), one, other).rests
               for one, other in pairwise(frames))
    method = FilteredInnovation(noise_threshold=0.5)  # so that some changes are believed
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, innovation_oracle.run(frames, method), rtol=1e-3, atol=5e-5)


def test_a_lamp_that_dims_takes_its_history_along(monkeypatch):
    """In noise that hides such a change from its innovation, and in three colours."""
    frames = split(32, 40, 8, lobes=False, still=True, lamp=[0.7, 0.6, 0.5])
    factor = np.array([0.3, 0.6, 1.5])

    def shown(i, frame):
        noise = np.random.default_rng(i).gamma(0.1, 10, (32, 40, 1))
        now = factor if i == 7 else np.ones(3)
        light = np.where((frame["id"] >= 0)[..., None], 0.05 * now, 0)
        direct = now * frame["unshadowed"]
        images = {"indirect": light * noise, "direct": direct, "specular": 0 * direct}
        return with_images(
            frame, unshadowed=direct, visibility=np.ones((32, 40)),
            blocker_distance=np.zeros((32, 40)),
            color=frame["emission"] + direct + images["indirect"], **images), light

    shown_, lights = zip(*(shown(i, frame) for i, frame in enumerate(frames)))
    last, errors = shown_[-1], []
    for told in (True, False):
        if not told:
            monkeypatch.setattr(innovation, "change_of_lights", lambda *_: LightChange())
        image, _ = run(FilteredInnovation(), shown_)
        image = image - last["emission"] - last["direct"] - lights[-1]
        errors.append(np.sqrt(np.square(image[last["id"] >= 0]).mean(0)) / (0.05 * factor))
    assert (errors[0] < 0.95 * errors[1]).all()
    assert errors[0][0] < 0.5 * errors[1][0]


def test_metal_takes_no_diffuse_light_from_its_surroundings():
    """The wall's right half has no diffuse lobe, and all of the light goes off."""
    frames = split(24, 32, 5, still=True, lamp=[0.7, 0.6, 0.5])
    off = ("direct", "indirect", "unshadowed", "specular")
    frames[-1] = with_images(frames[-1], color=frames[-1]["emission"],
                             **{name: 0 * frames[-1][name] for name in off})
    image, _ = run(FilteredInnovation(), frames)
    bare = (frames[-1]["albedo"] >= 1).all(-1) & (frames[-1]["roughness"] < 1)
    assert bare.sum() > 100
    np.testing.assert_allclose(image[bare], frames[-1]["emission"][bare], rtol=1e-3, atol=0.02)


@pytest.mark.parametrize("apart", [0.0, 0.05])
def test_it_is_the_formula_where_shadows_stand_still_and_a_slit_is_black(apart):
    """Still ones, and of some things that move by a part of a pixel; three pixels in a row met
    something."""
    frames = split(19, 26, 4, still=True)
    black = np.zeros((19, 26), bool)
    black[9, 15:18] = black[4, 20] = True
    for i, frame in enumerate(frames):
        dark = np.where(black[..., None], 0, 1)
        images = {name: dark * frame[name] for name in ("color", "emission", "direct", "indirect",
                                                        "specular")}
        blockers = 1 + (np.random.default_rng(i).random((19, 26)) < 0.9)
        frame = with_images(
            frame, **images, hit_distance=np.where(black, 0.01, frame["hit_distance"]),
            blocker_id=np.where(frame["blocker_id"] < 0, -1, blockers))
        moved = frame.world_from_object.copy()
        moved[:2, 0, 3] += [0.6 * apart * i, apart * i]
        frames[i] = replace(frame, world_from_object=moved)
    method = FilteredInnovation(noise_threshold=0.5)  # so that some changes are believed
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, innovation_oracle.run(frames, method), rtol=1e-3, atol=5e-5)
    around = image[8:11:2, 15:18].mean()
    assert image[9, 16].mean() < 0.15 * around
    assert image[4, 20].mean() > 0.2 * image[4, [19, 21]].mean()


def test_a_shadow_that_stands_still_gains_by_its_history():
    """A contact shadow of half-stopped rays, beside the same of a board that is never at rest."""
    frames = split(32, 40, 10, lobes=False, still=True)

    def shown(i, frame, moves):
        rng = np.random.default_rng(i)
        there = frame["id"] >= 0
        visibility = np.where(rng.random(there.shape) < 0.5, 1.0, 0.0)
        direct = frame["unshadowed"] * visibility[..., None]
        board = frame.world_from_object.copy()
        board[1, 0, 3] += 0.03 * moves * (i % 2)
        return replace(with_images(
            frame, visibility=visibility, direct=direct, color=frame["emission"] + direct,
            indirect=0 * direct, specular=0 * direct, id=np.where(there, 0, -1),
            blocker_distance=np.where(there & (visibility == 0), 0.2, 0),
            blocker_id=np.where(there, 1, -1)), world_from_object=board)

    errors = []
    for moves in (0.0, 1.0):
        image, _ = run(FilteredInnovation(), [shown(i, f, moves) for i, f in enumerate(frames)])
        truth = frames[-1]["emission"] + 0.5 * frames[-1]["unshadowed"]
        errors.append(np.sqrt(np.square(image - truth)[:, 12:26].mean()))
    assert errors[0] < 0.88 * errors[1]


def test_a_signal_follows_by_no_less_than_the_weight_of_the_current_frame():
    """With gains below 1/n, and no change that is certain, a decides what is taken of S[e]."""
    frames = split(19, 26)
    method = FilteredInnovation(
        min_gain=0.05, sharp_min_gain=0.05, noise_threshold=1e6, innovation_levels=4,
        output_levels=3, sharp_innovation_levels=2, sharp_output_levels=2)
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, innovation_oracle.run(frames, method), rtol=1e-3, atol=5e-5)


def test_it_is_the_formula_where_light_falls_on_a_texture_and_debts_are_paid(monkeypatch):
    """Stripes are in the light here, as where albedo is not known; what comes by way of surfaces
    is dark in the last frame."""
    frames = split(19, 26, 4)
    for i, frame in enumerate(frames):
        light = np.where(np.arange(26) // 3 % 2, 1, 0.02)[:, None]
        images = {name: light * frame[name] for name in ("direct", "indirect", "unshadowed")}
        left = 1 if i < 3 else 0.1
        images["indirect"] = left * images["indirect"]
        specular, emission = left * light * frame["specular"], np.zeros((19, 26, 3))
        frames[i] = with_images(frame, **images, specular=specular, emission=emission,
                                color=images["direct"] + images["indirect"])
    method = FilteredInnovation(innovation_levels=4, output_levels=3,
                                sharp_innovation_levels=2, sharp_output_levels=2, light_change=0,
                                glossy_change=0, visibility_change=0)
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, innovation_oracle.run(frames, method), rtol=1e-3, atol=5e-5)
    assert image.min() == 0
    monkeypatch.setattr(lanes, "repay", lambda image, id_: image)
    signed, _ = run(method, frames)
    assert (signed < -1e-3).sum() > 50
    assert image.sum() == pytest.approx(signed.sum(), rel=1e-5)


def dimmed(frames, factor):
    """The frames, the last of them with all its light weaker but for the lamp's own."""
    last = frames[-1]
    images = {name: factor * last[name]
              for name in ("direct", "indirect", "unshadowed", "specular")}
    color = last["emission"] + images["direct"] + images["indirect"]
    return [*frames[:-1], with_images(last, color=color, **images)]


def test_it_is_the_formula_where_light_goes_off(monkeypatch):
    frames = dimmed(split(19, 26, 4), 0.02)
    method = FilteredInnovation(innovation_levels=4, output_levels=3,
                                sharp_innovation_levels=2, sharp_output_levels=2)
    image, _ = run(method, frames)
    np.testing.assert_allclose(image, innovation_oracle.run(frames, method), rtol=1e-3, atol=1e-5)
    monkeypatch.setattr(innovation, "change_of_lights", lambda *_: LightChange())
    kept, _ = run(replace(method, light_change=0, glossy_change=0), frames)
    assert np.abs(image - kept).max() > 0.01


@pytest.mark.parametrize(("channel", "after"), [
    ("indirect", 0.02), ("indirect", 0.3), ("indirect", 5.0), ("specular", 0.02)])
def test_the_frame_after_a_lamp_changes_is_as_good_as_without_history(channel, after):
    """A wall in soft light; the noise is of the kind that few bright paths make."""
    wall = make_frame(48, 64, wall_end=1e9)
    slope = 0.5 + np.linspace(0, 1, 64)[:, None]

    def lit(level, seed):
        noise = np.random.default_rng(seed).gamma(0.5, 2, (48, 64, 1))
        light, dark = np.full((48, 64, 3), level) * slope, np.zeros((48, 64, 3))
        images = {"direct": dark, "specular": dark, "emission": dark, "albedo": dark + 0.5,
                  "unshadowed": dark, "visibility": dark[..., 0] + 1}
        images.update({"indirect": light * noise, channel: light * noise})
        return with_images(wall, color=images["indirect"], **images), light

    frames = [lit(1.0, i)[0] for i in range(8)]
    last, truth = lit(after, 99)
    errors = [np.square(run(FilteredInnovation(), shown)[0] - truth).mean()
              for shown in ([*frames, last], [last])]
    assert errors[0] < 10**0.1 * errors[1]
    lag = FilteredInnovation(light_change=0, glossy_change=0)
    late = np.square(run(lag, [*frames, last])[0] - truth).mean()
    assert after > 1 or late > 10**0.1 * errors[1]


def test_a_shadow_that_is_there_at_once_is_seen_at_once():
    """A contact shadow, so sharp that a pixel's neighbours hardly count."""
    frames = split(32, 40, 6)

    def shown(frame, is_dark):
        there = frame["id"] >= 0
        fields = {"visibility": np.where(is_dark, 0.0, 1.0) * np.ones(there.shape),
                  "blocker_distance": np.where(there, 1e-3, 0), "indirect": 0 * frame["direct"],
                  "specular": 0 * frame["direct"]}
        direct = frame["unshadowed"] * fields["visibility"][..., None]
        return with_images(frame, direct=direct, color=frame["emission"] + direct, **fields)

    dark = (np.arange(40) > 12) & (np.arange(40) < 26)
    frames = [shown(f, dark & (i == 5)) for i, f in enumerate(frames)]
    image, _ = run(FilteredInnovation(), frames)
    expected = frames[-1]["color"]
    assert np.abs(image - expected)[:, 15:24].max() < 0.02
    late, _ = run(FilteredInnovation(visibility_change=0), frames)
    assert np.abs(late - expected)[:, 15:24].max() > 0.05


def test_light_by_balls_is_filtered_as_a_texture():
    """What the method makes of the rest, and of that light over albedo as of plain frames."""
    rng = np.random.default_rng(8)
    frames, rest, light, albedo = split(24, 32, lobes=False), [], [], []
    for i, frame in enumerate(frames):
        seen = (frame["id"] >= 0)[..., None]
        sent = (seen * rng.gamma(0.5, 1.0, (24, 32, 1)) * [0.3, 0.2, 0.1]).astype(np.float32)
        frame = with_images(frame, albedo=np.maximum(frame["albedo"], np.float32(0.1)))
        rest.append(frame)
        frames[i] = with_images(frame, caustic=sent, indirect=frame["indirect"] + sent,
                                color=frame["color"] + sent)
        albedo.append(np.where(frame["albedo"] > 0, frame["albedo"], 1))
        plain = ("normal", "position", "depth", "id")
        light.append(replace(frame, images={"color": sent / albedo[-1],
                                            **{name: frame[name] for name in plain}}))
    image, _ = run(FilteredInnovation(), frames)
    of_pattern = FilteredInnovation(innovation_levels=2, sharp_innovation_levels=2, output_levels=2,
                                    sharp_output_levels=2)
    expected = run(FilteredInnovation(), rest)[0] + albedo[-1] * run(of_pattern, light)[0]
    np.testing.assert_allclose(image, expected, rtol=2e-4, atol=2e-5)
    assert np.abs(image - run(FilteredInnovation(), [
        replace(f, images={k: v for k, v in f.images.items() if k != "caustic"})
        for f in frames])[0]).max() > 0.01


def test_the_signals_add_up_to_the_colour():
    (frame,) = split(9, 14, 1)
    stencil = Stencil(9, 14, 1)
    for names in ((), ("specular",), ("unshadowed",), ("specular", "visibility"),
                  ("direct", "specular"), ("albedo",), ("albedo", "emission")):
        images = {k: v for k, v in frame.images.items() if k not in names}
        some = with_images(type(frame)(frame.index, images, frame.camera_from_world,
                                       frame.screen_from_world, frame.world_from_object))
        for gloss in (True, False):
            signals = read_signals(some, read_color(some, stencil), stencil, True, gloss)
            expected = frame["color"]
            if "emission" in names:
                expected = expected - frame["emission"]
            np.testing.assert_allclose(stencil.image(signals.color(signals.listed)), expected,
                                       rtol=1e-4, atol=1e-5)


def test_it_follows_a_change_of_light_at_once_where_plain_accumulation_lags():
    """A wall that turns three times as bright: the next frame's mean is the new one."""
    wall = make_frame(32, 32, wall_end=1e9)

    def lit(level, seed):
        noise = np.random.default_rng(seed).normal(0, 0.3, (32, 32, 1))
        return with_images(wall, color=np.full((32, 32, 3), level) + noise * level)

    frames = [lit(1.0, i) for i in range(12)] + [lit(3.0, 99)]
    method = FilteredInnovation(demodulate=False)
    before, state = run(method, frames[:-1])
    after, _ = method(frames[-1], state)
    assert before[8:-8, 8:-8].mean() == pytest.approx(1, rel=0.02)
    assert after[8:-8, 8:-8].mean() == pytest.approx(3, rel=0.03)


def test_history_lowers_the_error_of_a_still_scene_below_that_of_single_frames():
    truth = make_frame(32, 40)
    frames = [noisy(truth, seed=i) for i in range(10)]
    method = FilteredInnovation(demodulate=False)
    error = [np.square(image - truth["color"]).mean() for image in
             (run(method, frames[-1:])[0], run(method, frames)[0])]
    assert error[1] < 0.7 * error[0]


def test_energy_is_kept():
    frames = split(33, 41, 4, lobes=False, lamp=[0.7, 0.6, 0.5])  # narrow lobes lose some
    image, _ = run(FilteredInnovation(), frames)
    assert image.mean() == pytest.approx(frames[-1]["color"].mean(), rel=0.01)


def test_a_coloured_sky_leaves_grey_ground_grey():
    """One ray in sixteen finds a bright warm patch, the others what is blue: what one visibility
    for all colours leaves of that is rare and warm, or cold; there is hardly any other light."""
    frame, random = make_frame(48, 64, wall_end=100.0), np.random.default_rng(5)
    blue, warm = np.array([0.15, 0.25, 0.5]), np.array([4.5, 2.2, 0.7])
    found = random.random((48, 64, 1)) < 1 / 16
    direct = np.where(found, warm, blue)
    unshadowed = np.full((48, 64, 3), (15 * blue + warm) / 16)
    indirect = np.where(random.random((48, 64, 1)) < 0.03, 0.1, 0) * np.ones(3)
    frame = with_images(
        frame, color=direct + indirect, direct=direct, indirect=indirect, unshadowed=unshadowed,
        visibility=innovation_oracle.lum(direct) / innovation_oracle.lum(unshadowed),
        emission=np.zeros((48, 64, 3)), specular=np.zeros((48, 64, 3)))
    image, _ = run(FilteredInnovation(), [frame])
    np.testing.assert_allclose(image.mean((0, 1)), frame["color"].mean((0, 1)), rtol=0.05)


def test_visibility_above_its_cap_is_not_lost():
    (frame,) = split(24, 24, 1)
    visibility = frame["visibility"].copy()
    visibility[5, 5] = 50
    burst = with_images(frame, visibility=visibility,
                        direct=frame["unshadowed"] * visibility[..., None],
                        color=frame["emission"] + frame["indirect"]
                        + frame["unshadowed"] * visibility[..., None])
    stencil = Stencil(24, 24, 1)
    signals = read_signals(burst, read_color(burst, stencil), stencil, True, True)
    assert stencil.image([signals.listed[-1].luminance]).max() <= 2
    np.testing.assert_allclose(stencil.image(signals.color(signals.listed)), burst["color"],
                               rtol=1e-4, atol=1e-5)


def test_a_lamp_and_what_is_around_it_do_not_mix():
    """The lamp reflects nothing; its neighbours, of the same plane, must not take its darkness."""
    wall = make_frame(24, 24, wall_end=1e9)
    there = (wall["id"] == 0)[..., None]
    albedo = np.where(there, [0.5] * 3, 0.5)
    albedo[8:16, :6] = 0
    emission = np.where(albedo == 0, 4.0, 0.0)
    light = np.where(albedo > 0, albedo * 2.0, 0)
    frame = with_images(wall, albedo=albedo, emission=emission, direct=0 * light, indirect=light,
                        color=light + emission)
    image, _ = run(FilteredInnovation(), [frame, frame])
    np.testing.assert_allclose(image, frame["color"], rtol=1e-4)


def test_a_moving_object_and_its_background_keep_histories_of_their_own():
    def painted(i):
        frame = make_frame(24, 32, index=i, board=translation(0.2 * i, 0, 0), wall_end=1e9)
        return with_images(frame, color=np.where((frame["id"] == 1)[..., None], [4.0] * 3, 1.0))

    frames = [painted(i) for i in range(5)]
    image, _ = run(FilteredInnovation(demodulate=False), frames)
    np.testing.assert_allclose(image, frames[-1]["color"], rtol=2e-2)


@pytest.mark.parametrize("layers", [False, True])
def test_five_frames_are_one_recording_and_parameters_compile_nothing(layers):
    frames = split(16, 20, 5, layers=layers)
    run(FilteredInnovation(), frames)
    other = FilteredInnovation(light_alpha=0.1, visibility_sigma=3.0, fade_frames=3.0, penumbra=2.0,
                               plane_pixels=2.0, max_history_length=9.0, plane_tolerance=0.03,
                               light_change=3.0, glossy_change=2.0, visibility_change=1.0)
    assert compiled(lambda: run(other, frames)) == 0
    _, state = run(FilteredInnovation(), frames)
    passes = state.passes
    steps = [passes.look_around, passes.find_innovations, passes.merge, passes.pack,
             *(level.step for level in (passes.spread, *passes.smoothing, *passes.output))]
    assert (state.layered is not None) == layers
    if layers:
        passes = state.layered.passes
        steps += [passes.find_innovations, passes.merge, passes.pack,
                  *(level.step for level in (*passes.smoothing, *passes.output))]
    assert [step.recordings for step in steps] == [1] * len(steps)


def test_glossy_light_is_renewed_by_no_change_where_there_is_no_visibility():
    names = ("visibility", "unshadowed")
    frames = [replace(f, images={k: v for k, v in f.images.items() if k not in names})
              for f in split(16, 20, 3)]
    one, other = (run(FilteredInnovation(change_alpha=share), frames)[0] for share in (0.0, 1.0))
    np.testing.assert_array_equal(one, other)


def test_two_threads_give_what_one_gives():
    frames = split(21, 18)
    one, two = taking_turns(lambda: run(FilteredInnovation(), frames)[0])
    np.testing.assert_array_equal(one, two)


def test_other_channels_halfway_are_refused():
    frames = split(8, 8, 2)
    method = FilteredInnovation()
    _, state = method(frames[0], method.init(8, 8))
    plain = type(frames[1])(1, {k: v for k, v in frames[1].images.items() if k not in USED},
                            frames[1].camera_from_world, frames[1].screen_from_world,
                            frames[1].world_from_object)
    with pytest.raises(InputError, match="other channels"):
        method(plain, state)


@pytest.mark.parametrize("settings", [
    {"output_levels": 0}, {"output_levels": 2.0}, {"sharp_output_levels": 5},
    {"sharp_innovation_levels": 1}, {"light_alpha": 0.0}, {"visibility_sigma": -1.0},
    {"max_history_length": 0.0}, {"min_gain": 0.0}, {"noise_threshold": -1.0}, {"penumbra": 0.0},
    {"fade_frames": 0.0}, {"light_change": -1.0}, {"glossy_change": 1e7},
    {"visibility_change": float("nan")}, {"sharp_min_gain": 0.0}, {"change_alpha": 2.0}])
def test_bad_parameters_are_refused(settings):
    with pytest.raises(InputError, match=next(iter(settings))):
        FilteredInnovation(**settings)
