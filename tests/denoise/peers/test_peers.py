"""Denoisers of others: fed what ours are fed, refused in one sentence where they are missing."""

from __future__ import annotations

import subprocess
import sys
from typing import Any, cast

import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, PEERS, build, parameters
from onespp.denoise.peers import oidn
from onespp.denoise.peers.oidn_split import OidnSplit, split
from onespp.denoise.peers.temporal_oidn_split import TemporalOidnSplit
from onespp.render.errors import InputError
from onespp.render.frame import Frame
from onespp.render.host import backend
from tests.support.frames import make_frame, noisy, with_images

H, W = 40, 48

needs_oidn = pytest.mark.skipif(not oidn.AVAILABLE, reason="mitsuba-oidn is not installed")
each = pytest.mark.parametrize("name", ["oidn-fast", "oidn-split", "temporal-oidn",
                                          "temporal-oidn-split"])


def run(name, *frames, **settings):
    method = build(name, settings)
    state = method.init(frames[0].height, frames[0].width)
    for frame in frames:
        image, state = method(frame, state)
    return image


def without(frame, *channels):
    images = {k: v for k, v in frame.images.items() if k not in channels}
    return Frame(frame.index, images, frame.camera_from_world, frame.screen_from_world,
                 frame.world_from_object)


def test_peers_have_names_of_their_own_and_build_without_what_they_need(monkeypatch):
    monkeypatch.setattr(oidn, "AVAILABLE", False)
    assert not {*METHODS} & {*PEERS}
    for name in PEERS:
        assert parameters(build(name))
        assert PEERS[name].about.endswith(".")
    assert {parameters(build(f"oidn-{q}"))["quality"] for q in oidn.QUALITIES} == {*oidn.QUALITIES}


def test_without_the_package_a_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(oidn, "AVAILABLE", False)
    assert not PEERS["oidn-high"].available()
    with pytest.raises(InputError, match=r"pip install mitsuba-oidn"):
        build("oidn-high").init(4, 4)


def test_without_cuda_optix_says_so_in_one_line(monkeypatch):
    monkeypatch.setattr(backend, "choose", lambda device="auto": "llvm")
    for name in ("optix", "optix-temporal"):
        assert not PEERS[name].available()
        with pytest.raises(InputError, match="needs a CUDA device") as error:
            build(name).init(4, 4)
        assert "\n" not in str(error.value)


def test_no_peer_brings_in_mitsuba_before_it_is_used():
    code = ("import sys, onespp.denoise.catalog; "
            "sys.exit('mitsuba' in sys.modules or 'mitsuba_oidn' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("settings", "words"), [
    ({"quality": "best"}, "quality is 'best': use high, balanced, fast"),
    ({"auxiliary": "some"}, "auxiliary is 'some': use clean, noisy"),
    ({"radius": "3"}, "has no parameter 'radius': it has quality")])
def test_bad_settings_are_explained(settings, words):
    with pytest.raises(InputError, match=words):
        build("oidn-high", settings)


def test_words_are_parameters_like_numbers():
    method = build("oidn-high", {"quality": "fast", "auxiliary": "noisy"})
    assert parameters(method)["quality"] == "fast"
    assert parameters(method)["auxiliary"] == "noisy"


@needs_oidn
@each
def test_noise_goes_and_the_picture_stays(name):
    clean = make_frame(H, W, wall_end=1e9)
    result = run(name, *(noisy(clean, seed=i) for i in range(3)))
    assert result.shape == (H, W, 3)
    assert result.dtype == np.float32
    before = np.mean((noisy(clean, seed=2)["color"] - clean["color"])**2)
    assert np.mean((result - clean["color"])**2) < 0.2 * before


@needs_oidn
def test_qualities_and_modes_are_not_the_same():
    frame = noisy(make_frame(H, W))
    images = [run("oidn-high", frame), run("oidn-fast", frame),
              run("oidn-fast", frame, auxiliary="noisy"),
              run("oidn-fast", without(frame, "albedo"))]
    for i, a in enumerate(images):
        for b in images[:i]:
            assert np.abs(a - b).max() > 1e-4


@needs_oidn
@pytest.mark.parametrize("guide", ["albedo", "normal"])
def test_an_edge_in_one_guide_alone_reaches_the_network(guide):
    frame = noisy(make_frame(H, W, wall_end=1e9))
    image = np.array(frame[guide])
    image[:, W // 2:] = (0.1, 0.9, 0.1)
    changed = np.abs(run("oidn-fast", with_images(frame, **{guide: image}))
                     - run("oidn-fast", frame)).max(axis=-1)
    assert changed.max() > 0.01


@needs_oidn
def test_a_frame_does_not_depend_on_the_one_before():
    a, b = noisy(make_frame(H, W)), noisy(make_frame(H, W), seed=5)
    bare = without(b, "albedo")
    np.testing.assert_array_equal(run("oidn-fast", a, bare, b), run("oidn-fast", b))


@needs_oidn
@each
def test_a_lamp_keeps_its_edge(name):
    frame = noisy(make_frame(H, W, wall_end=1e9))
    emission = np.zeros((H, W, 3), np.float32)
    emission[10:20, 10:30] = 30.0
    lit = with_images(frame, emission=emission, color=frame["color"] + emission)
    dark = with_images(frame, emission=0 * emission)
    np.testing.assert_allclose(run(name, lit) - emission, run(name, dark), atol=1e-3)
    bled = np.abs(run(name, lit, emission_apart="no") - emission - run(name, dark))
    assert bled.max() > 0.01


@needs_oidn
@each
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_bad_pixels_are_repaired_before_the_network_sees_them(name, bad):
    frame = noisy(make_frame(H, W))
    color, normal, albedo = (np.array(frame[c]) for c in ("color", "normal", "albedo"))
    color[7, 7, 1] = normal[20, 9, 0] = albedo[3, 4] = bad
    emission = np.zeros_like(color)
    emission[5, 5] = bad
    broken = with_images(frame, color=color, normal=normal, albedo=albedo, emission=emission)
    result = run(name, frame, broken)
    assert np.isfinite(result).all()
    changed = np.abs(result - run(name, frame, frame)).max(axis=-1) > 0.2
    assert changed.sum() <= 4  # those with bad guides, if any


@needs_oidn
def test_a_guide_that_is_not_finite_counts_as_white_or_as_no_normal():
    frame = noisy(make_frame(H, W))
    albedo, normal = np.array(frame["albedo"]), np.array(frame["normal"])
    albedo[3:9, 4:9], normal[20:25, 9:14] = np.nan, np.inf
    broken = with_images(frame, albedo=albedo, normal=normal)
    albedo[3:9, 4:9], normal[20:25, 9:14] = 1, 0
    told = with_images(frame, albedo=albedo, normal=normal)
    np.testing.assert_array_equal(run("oidn-fast", broken), run("oidn-fast", told))


@needs_oidn
@each
def test_missing_channels_and_other_sizes_are_named(name):
    frame = make_frame(H, W)
    for channel in ("color", "normal", "id"):
        with pytest.raises(InputError, match=f"lacks the channel '{channel}'"):
            run(name, without(frame, channel))
    method = build(name)
    with pytest.raises(InputError, match=r"48x40.*48x41"):
        method(frame, method.init(H + 1, W))
    with pytest.raises(InputError, match="empty"):
        method.init(0, 7)


def split_frame(visible: np.ndarray, seed: int = 0):
    """A frame with textured unshadowed light of which `visible` arrives, and even other light."""
    frame = make_frame(H, W, wall_end=1e9)
    rng = np.random.default_rng(7)
    unshadowed = rng.uniform(0.2, 2.0, (H, W, 3)).astype(np.float32)
    direct = visible[..., None] * unshadowed
    rest = np.full((H, W, 3), 0.3, np.float32)
    noise = np.random.default_rng(seed).gamma(0.5, 2.0, (H, W, 1)).astype(np.float32)
    return with_images(frame, color=direct + rest * noise, direct=direct, indirect=rest * noise,
                       unshadowed=unshadowed, visibility=visible), direct + rest


@needs_oidn
@pytest.mark.parametrize("name", ["oidn-split", "temporal-oidn-split"])
def test_what_is_in_unshadowed_light_stays_as_fine_as_it_is(name):
    """Visibility is 1: all texture is in U, which no filter may touch; plain OIDN blurs it."""
    frame, truth = split_frame(np.ones((H, W), np.float32))
    error = np.sqrt(np.mean((run(name, frame, frame) - truth) ** 2))
    plain = np.sqrt(np.mean((run("oidn-high", frame) - truth) ** 2))
    assert error < 0.08
    assert error < 0.35 * plain


def test_what_visibility_has_above_1_is_in_the_rest_of_the_light():
    frame, _ = split_frame(np.full((H, W), 1.5, np.float32))
    visibility, rest = split(frame)
    np.testing.assert_array_equal(visibility, 1)
    light = frame["direct"] + frame["indirect"]
    np.testing.assert_allclose(visibility * frame["unshadowed"] + rest, light, rtol=1e-6)


@needs_oidn
@pytest.mark.parametrize("name", ["oidn-split", "temporal-oidn-split"])
def test_half_of_the_shadow_rays_are_half_of_the_light(name):
    rays = (np.random.default_rng(3).random((4, H, W)) < 0.5).astype(np.float32)
    frames = [split_frame(seen, seed)[0] for seed, seen in enumerate(rays)]
    _, truth = split_frame(np.full((H, W), 0.5, np.float32))
    inner = np.s_[4:-4, 4:-4]
    ratio = run(name, *frames)[inner].mean() / truth[inner].mean()
    assert ratio == pytest.approx(1, abs=0.05)


@needs_oidn
def test_light_above_the_cap_of_visibility_and_glossy_light_are_not_lost():
    visible = np.full((H, W), 5.0, np.float32)
    frame, truth = split_frame(visible)
    for name in ("oidn-split", "temporal-oidn-split"):
        assert run(name, frame).mean() == pytest.approx(truth.mean(), rel=0.05)
    frame, truth = split_frame(np.zeros((H, W), np.float32))
    glossy = with_images(frame, specular=0.5 * frame["indirect"])
    assert run("temporal-oidn-split", glossy).mean() == pytest.approx(truth.mean(), rel=0.1)


@needs_oidn
@pytest.mark.parametrize(("name", "plain"), [("oidn-split", "oidn-high"),
                                             ("temporal-oidn-split", "temporal-oidn")])
def test_frames_without_the_split_are_denoised_as_by_the_plain_form(name, plain):
    frames = [noisy(make_frame(H, W), seed=i) for i in range(2)]
    np.testing.assert_array_equal(run(name, *frames), run(plain, *frames))


@needs_oidn
def test_a_shadow_that_moves_leaves_no_trail_in_light_that_stands_still():
    """Each signal is clamped by its own window: history of visibility stays in visibility."""
    still = np.ones((H, W), np.float32)
    moved = still.copy()
    moved[:, :20] = 0
    before, _ = split_frame(still)
    after, truth = split_frame(moved, seed=1)
    error = np.abs(run("temporal-oidn-split", before, after) - truth)[:, 2:17].mean()
    assert error < 0.12


class Network:
    """In the place of Open Image Denoise: keeps the frames it gets, and returns their colour."""

    def __init__(self) -> None:
        self.seen: list[Frame] = []

    def init(self, height: int, width: int) -> None:
        pass

    def __call__(self, frame: Frame, state: None) -> tuple[np.ndarray, None]:
        self.seen.append(frame)
        return np.array(frame["color"]), state


def test_the_network_sees_visibility_on_white_and_the_rest_on_the_surface():
    visible = np.random.default_rng(0).random((H, W)).astype(np.float32)
    frame, _ = split_frame(visible)
    network = Network()
    image, _ = OidnSplit(cast(Any, network))(frame, cast(Any, None))
    shadows, rest = network.seen
    np.testing.assert_array_equal(shadows["color"], np.repeat(visible[..., None], 3, axis=2))
    np.testing.assert_array_equal(shadows["albedo"], 1)
    np.testing.assert_array_equal(rest["albedo"], frame["albedo"])
    for seen in network.seen:
        np.testing.assert_array_equal(seen["normal"], frame["normal"])
        assert "emission" not in seen
    np.testing.assert_allclose(image, frame["color"], rtol=1e-5, atol=1e-6)


def test_the_network_sees_visibility_with_its_history():
    rng = np.random.default_rng(1)
    frames = [split_frame(rng.random((H, W)).astype(np.float32))[0] for _ in range(3)]
    network = Network()
    method = TemporalOidnSplit(split=OidnSplit(cast(Any, network)))
    state = method.init(H, W)
    for frame in frames:
        _, state = method(frame, state)
    first, last = network.seen[0]["color"], network.seen[4]["color"]
    np.testing.assert_allclose(first[..., 0], frames[0]["visibility"], rtol=1e-6)
    assert last.var() < 0.7 * frames[2]["visibility"].var()
