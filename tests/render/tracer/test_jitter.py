"""Frames whose rays are moved within the pixel, and matrices that say so."""

import numpy as np
import pytest

from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.tracer.camera_rays import PERIOD, camera_matrices, halton
from onespp.render.tracer.renderer import Renderer
from onespp.scenes.box import box
from tests.support.recordings import compiled

HEIGHT, WIDTH = 24, 32


@pytest.fixture(scope="module")
def renderers():
    return {jitter: Renderer(box(), HEIGHT, WIDTH, "resampled", "zsobol", jitter)
            for jitter in ("none", "halton")}


def test_offsets_fill_the_pixel_evenly():
    offsets = np.array([halton(i) for i in range(PERIOD)])
    assert (abs(offsets) <= 0.5).all()
    assert len(np.unique(offsets, axis=0)) == PERIOD
    np.testing.assert_allclose(offsets.mean(0), 0, atol=0.05)
    quarters = np.histogram2d(*offsets.T, bins=2, range=[[-0.5, 0.5]] * 2)[0]
    assert quarters.min() >= PERIOD // 4 - 1
    np.testing.assert_allclose([halton(0), halton(1), halton(PERIOD)],
                               [(0, 1 / 3 - 0.5), (-0.25, 2 / 3 - 0.5), (0, 1 / 3 - 0.5)])


@pytest.mark.parametrize("index", [0, 3, 20])
def test_what_a_pixel_shows_projects_to_its_centre_by_the_frames_matrices(renderers, index):
    frame = renderers["halton"].frame(index, 0, ("position", "id"))
    hit = frame["id"] >= 0
    world = np.concatenate([frame["position"], np.ones((HEIGHT, WIDTH, 1))], -1)
    clip = world.astype(np.float64) @ frame.screen_from_world.T
    row, column = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    screen = clip[..., :2] / clip[..., 3:]
    np.testing.assert_allclose(screen[hit], np.stack([column, row], -1)[hit], atol=1e-4)
    plain = camera_matrices(box().camera, index, HEIGHT, WIDTH).screen_from_world
    clip = world @ plain.T
    offset = (clip[..., :2] / clip[..., 3:] - np.stack([column, row], -1))[hit]
    np.testing.assert_allclose(offset, np.broadcast_to(halton(index), offset.shape), atol=1e-4)


def test_a_reference_does_not_know_of_jitter(renderers):
    for antialias in (False, True):
        plain, jittered = (renderers[j].sample_sum(2, 0, 0, 2, antialias)
                           for j in ("none", "halton"))
        np.testing.assert_array_equal(plain, jittered)
    frames = [renderers[j].frame(2, 0, ("albedo",))["albedo"] for j in ("none", "halton")]
    assert np.abs(frames[0] - frames[1]).max() > 0.1


def test_samples_of_the_last_frame_land_where_its_matrices_say(renderers):
    """As many as without jitter are seen again: a wrong place would lie behind an edge."""
    seen = [(renderers[j].frame(4, 0, ("replay",))["replay"][..., 0] >= 0).mean()
            for j in ("none", "halton")]
    assert seen[1] > 0.9 * seen[0] > 0.05


def test_another_frame_compiles_nothing(renderers):
    for index in (0, 1):
        renderers["halton"].frame(index, 0)
    assert compiled(lambda: renderers["halton"].frame(5, 0)) == 0


def test_an_unknown_jitter_is_refused():
    with pytest.raises(InputError, match="unknown --jitter 'blue': use none or halton"):
        Renderer(box(), 4, 4, jitter="blue")


def test_a_sequence_says_so_and_is_not_continued_otherwise(call, tmp_path):
    options = ("render", "box", "--frames", "0:1", "--size", "16x12", "--out", tmp_path / "a")
    assert call(*options, "--jitter", "halton")[0] == 0
    assert FrameSequence.open(tmp_path / "a").manifest.jitter == "halton"
    code, _, err = call(*options)
    assert code == 2
    assert "jitter" in err
