"""Clips of a data set: turned ones are true, and they follow from (seed, epoch, index) alone."""

from __future__ import annotations

import multiprocessing
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest

from onespp import Clips, Frame, InputError
from onespp.clips import store
from onespp.clips.motion import Matrices
from onespp.clips.view import Turn
from onespp.denoise.geometry.correspondence import NOWHERE, carry, previous_pixel
from onespp.render.files.sequence import FrameSequence
from tests.support.clip_digests import digest, digests
from tests.support.frames import make_frame, translation

CHANNELS = ("color", "albedo", "normal", "position", "depth", "id", "motion", "visibility")
every_turn = pytest.mark.parametrize("i", range(8))


def clip_with(monkeypatch, clips: Clips, turn: Turn, index: int = 0) -> dict[str, Any]:
    """The clip as if chance had chosen that turn."""
    monkeypatch.setattr(Turn, "number", classmethod(lambda cls, i: turn))
    return clips[index]


def frame_of(clip: dict[str, Any], i: int) -> Frame:
    images = {name: clip[name][i] for name in ("albedo", "normal", "depth", "id")}
    return Frame(i, images, clip["camera_from_world"][i], clip["screen_from_world"][i],
                 clip["world_from_object"][i])


def clips_of(data, **options) -> Clips:
    options = {"frames": 3, "crop": 12, "channels": CHANNELS, "exposure": 0.0, **options}
    return Clips(data.folder, **options)


@every_turn
def test_motion_agrees_with_the_matrices(monkeypatch, made, i):
    """Positions of the cut and turned clip, moved back with their objects, are seen where motion
    says; and they are seen in their own pixels now."""
    clip = clip_with(monkeypatch, clips_of(made, crop=(14, 11)), Turn.number(i))
    moving = 0.0
    for t in range(3):
        there = clip["id"][t] >= 0
        ids = clip["id"][t][there]
        world = np.concatenate([clip["position"][t][there], np.ones((len(ids), 1))], axis=1)
        y, x = np.nonzero(there)
        centre = np.stack([x, y], axis=1) + 0.5
        assert np.abs(projected(clip, t, world) - centre).max() < 2e-3
        if t == 0:
            continue
        now, before = (clip["world_from_object"][k][ids] for k in (t, t - 1))
        was = np.einsum("nij,njk,nk->ni", before, np.linalg.inv(now), world)
        seen = projected(clip, t - 1, was)
        assert np.abs(seen - centre - clip["motion"][t][there]).max() < 4e-3
        moving = max(moving, np.abs(clip["motion"][t][there]).max())
    assert moving > 0.5


def projected(clip: dict[str, Any], t: int, points: np.ndarray) -> np.ndarray:
    on_screen = points @ clip["screen_from_world"][t].T
    return on_screen[:, :2] / on_screen[:, 3:]


@every_turn
def test_a_turned_clip_reprojects_as_well_as_the_unturned_one(monkeypatch, made, i):
    turn, sources, errors = Turn.number(i), [], []
    for chosen in (Turn(), turn):
        clip = clip_with(monkeypatch, clips_of(made), chosen)
        frames = [frame_of(clip, t) for t in range(3)]
        source = previous_pixel(frames[1], frames[2])
        found = source != NOWHERE
        error = np.abs(carry(frames[1]["albedo"], source) - frames[2]["albedo"]).mean(axis=-1)
        sources.append(found)
        errors.append(error[found].mean())
    assert sources[0].mean() > 0.6
    agree = turn.image(sources[0], 0) == sources[1]  # but for surfaces on the edge of a pixel
    assert agree.mean() > 0.97
    assert errors[1] == pytest.approx(errors[0], rel=0.05, abs=1e-3)


@every_turn
def test_normals_turn_with_the_camera_s_axes_and_cameras_stay_rigid(monkeypatch, made, i):
    turn = Turn.number(i)
    plain, turned = (clip_with(monkeypatch, clips_of(made), t) for t in (Turn(), turn))
    for t in range(3):
        a, b = (clip["normal"][t] @ clip["camera_from_world"][t][:3, :3].T
                for clip in (plain, turned))
        expected = turn.image(a, 0) @ turn.camera[:3, :3].T
        assert np.abs(expected - b).max() < 1e-5
        assert np.linalg.det(turned["camera_from_world"][t][:3, :3]) == pytest.approx(1)
    assert np.array_equal(turn.image(plain["color"], 1), turned["color"])
    assert np.abs(plain["camera_from_world"][0] - turned["camera_from_world"][0]).max() < 1e-12
    assert (i == 0) == np.allclose(turn.image(plain["normal"], 1), turned["normal"])


def test_crops_follow_the_mean_motion(monkeypatch, made):
    """A camera goes by a wall; what is in the crop stays in it."""
    frames = [make_frame(16, 24, index=i, camera=translation(0.9 * i, 0, 0), wall_end=1e6,
                         board=translation(0, 50, 0)) for i in range(3)]
    monkeypatch.setattr(store.Store, "images", lambda self, n, k, i, names: {
        name: frames[i]["color"] if name == "reference" else frames[i][name] for name in names})
    monkeypatch.setattr(store.Store, "matrices", lambda self, n, i: Matrices(
        frames[i].camera_from_world, frames[i].screen_from_world, frames[i].world_from_object))
    options = {"channels": ("color", "motion"), "augment": False}
    whole = clips_of(made, crop=None, **options)[0]["motion"]
    assert abs(whole[1, ..., 0]).mean() > 2
    followed = clips_of(made, crop=(16, 8), **options)[0]
    assert abs(followed["motion"][1:, ..., 0].mean(axis=(1, 2))).max() < 0.6
    shown = followed["color"]
    assert abs(shown[0] - shown[2]).mean() < 0.3 * abs(shown[0] - shown[0].mean()).mean()


def test_equal_seeds_give_equal_clips_in_one_and_in_four_processes(made):
    clips, indices = clips_of(made, frames=1), range(3)
    here = digests(clips, indices)
    with ProcessPoolExecutor(4, multiprocessing.get_context("spawn")) as pool:
        there = list(pool.map(digests, [clips] * 4, [range(i, i + 1) for i in (0, 1, 2, 0)]))
    assert [one for part in there for one in part] == [*here, here[0]]
    clips.set_epoch(1)
    assert digests(clips, indices) != here
    assert digests(clips_of(made, frames=1, seed=1), indices) != here


def test_exposure_scales_all_light_and_nothing_else(made):
    plain, scaled = clips_of(made)[0], clips_of(made, exposure=3.0)[0]
    factor = scaled["reference"].sum() / plain["reference"].sum()
    assert abs(np.log2(factor)) > 0.05
    for name in ("color", "reference"):
        assert np.allclose(scaled[name], factor * plain[name], rtol=1e-4)
    for name in set(CHANNELS) - {"color"}:
        assert np.array_equal(scaled[name], plain[name]), name


def test_halves_of_the_reference_and_several_renders(made):
    one = clips_of(made)[0]
    both = clips_of(made, halves=True, seeds=2)[0]
    assert "reference" not in both
    assert np.allclose(both["halves"].mean(axis=0), one["reference"], atol=1e-6)
    assert not np.allclose(both["halves"][0], both["halves"][1])
    assert both["color"].shape == (2, 3, 12, 12, 3)
    assert sorted(both["seed"]) == [0, 1]
    assert not np.array_equal(both["color"][0], both["color"][1])
    assert both["depth"].shape == (3, 12, 12)
    again = clips_of(made, augment=False, seeds=2)[0], clips_of(made, augment=False)[0]
    assert np.array_equal(again[0]["color"][0], again[1]["color"])


def test_a_cache_gives_the_same_clips_without_decoding(monkeypatch, made, tmp_path):
    options = {"halves": True, "seeds": 2}
    plain = digest(clips_of(made, **options)[0])
    cached = clips_of(made, cache=tmp_path / "cache", **options)
    assert digest(cached[0]) == plain

    def decoded(*arguments):
        raise AssertionError("an image was decoded again")

    monkeypatch.setattr(store, "_decoded", decoded)
    assert digest(cached[0]) == plain


def test_what_methods_made_is_read_as_the_noisy_frames_are(made, tmp_path):
    """Cut, turned and made brighter like them; anew, though there is a cache."""
    folder = tmp_path / "set"
    shutil.copytree(made.folder, folder)
    options = {"frames": 3, "crop": 12, "channels": ("color", "denoised/half"),
               "cache": tmp_path / "cache"}
    with pytest.raises(InputError, match="seed0 has no result 'half' of all frames: run"):
        Clips(folder, **options)
    for factor in (0.5, 0.25):
        for path in folder.glob("train/*/seed*"):
            sequence = FrameSequence.open(path)
            for i in sequence.frames:
                sequence.write_result("half", i, factor * sequence.read_frame(i)["color"])
        clip = Clips(folder, **options)[0]
        np.testing.assert_allclose(clip["denoised/half"], factor * clip["color"], rtol=1e-6)


def test_readers_load_no_renderer(made):
    code = ("import sys, onespp\n"
            f"clips = onespp.Clips({str(made.folder)!r}, frames=2, crop=8)\n"
            "assert len(clips) == 1 and clips[0]['color'].shape == (2, 8, 8, 3)\n"
            "heavy = {'drjit', 'mitsuba', 'click', 'matplotlib', 'PIL', 'rich'} & {*sys.modules}\n"
            "maps = open('/proc/self/maps').read() if sys.platform == 'linux' else ''\n"
            "sys.exit(f'{heavy}' if heavy or 'libLLVM' in maps else 0)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("options", "words"), [
    ({"frames": 4}, "sequences have 3: use 1 to 3"), ({"crop": 20}, "frames have 16 of 24"),
    ({"crop": 0}, "crop is 0"), ({"split": "test"}, "no sequences of the split 'test'"),
    ({"split": "tset"}, "split is 'tset': use train, validation, test"),
    ({"seeds": 3}, "sequences have 2"), ({"channels": ["colour"]}, "lacks the channel 'colour'")])
def test_what_the_data_set_does_not_have_is_refused(made, options, words):
    with pytest.raises(InputError, match=words):
        clips_of(made, **options)
    with pytest.raises(IndexError):
        _ = clips_of(made)[1]


def test_pytorch_reads_it(made):
    torch = pytest.importorskip("torch")
    loader = torch.utils.data.DataLoader(clips_of(made, frames=1), batch_size=2, shuffle=True)
    batch = next(iter(loader))
    assert tuple(batch["color"].shape) == (2, 1, 12, 12, 3)
