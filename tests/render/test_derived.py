"""Channels that follow from others, and files in half precision."""

from __future__ import annotations

import numpy as np
import pytest

from onespp.denoise.catalog import METHODS, build, channels_read
from onespp.render.channels import CHANNELS, OFFERED, REPLAY, TRAINING
from onespp.render.derived import DERIVED, available
from onespp.render.errors import InputError
from onespp.render.files.sequence import FrameSequence
from onespp.render.job import RenderJob, render_sequence
from onespp.scenes import catalog


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The same two frames of a glossy scene: as they are, with what training needs, and halved."""
    scene, base = catalog.load("hard/glossy-floor"), tmp_path_factory.mktemp("derived")

    def made(name, **options):
        return render_sequence(RenderJob(scene, (2, 3), 24, 36, **options), base / name)

    return {"all": made("all"), "training": made("training", training=True),
            "half": made("half", training=True, half=True)}


def test_what_follows_from_other_channels_is_as_if_it_had_been_stored(folders):
    whole, less = folders["all"], folders["training"]
    assert not {"color", "position"} & set(less.manifest.channels)
    for i in whole.frames:
        a, b = whole.read_frame(i), less.read_frame(i)
        assert set(b.images) == {*less.manifest.channels, *DERIVED}
        for name in b.images:
            scale = np.abs(a[name]).max()
            error = np.abs(a[name].astype(np.float64) - b[name]).max()
            assert error <= (3e-6 * scale if name == "position" else 0), name


def test_half_precision_rounds_all_but_what_reprojection_compares(folders):
    exact, half = (folders[name].read_frame(3) for name in ("training", "half"))
    rounded = 0
    for name in folders["half"].manifest.channels:
        if name == "depth" or CHANNELS[name].is_id:
            np.testing.assert_array_equal(exact[name], half[name], err_msg=name)
        else:
            error = np.abs(exact[name] - half[name])
            assert (error <= 2.0**-11 * np.abs(exact[name]) + 2.0**-25).all(), name
            rounded += int(error.any())
    assert rounded >= 6


def test_half_precision_saves_half_of_the_bytes(folders):
    exact, half = (sum(path.stat().st_size for path in folders[name].folder.glob("frames/*.exr"))
                   for name in ("training", "half"))
    assert half < 0.7 * exact


def test_training_has_what_methods_read_and_nothing_that_follows():
    read = {c for name in METHODS for c in channels_read(build(name), OFFERED)}
    read -= set(REPLAY)  # which `asvgf` alone reads
    assert {c for c in available(TRAINING) if c != "position"} == read
    assert not set(TRAINING) & set(DERIVED)


def test_every_method_makes_the_same_image_of_what_training_needs(folders):
    for name in ("atrous", "svgf", "onespp"):
        a, b = (build(name) for _ in range(2))
        states = a.init(24, 36), b.init(24, 36)
        images = [method(folders[kind].read_frame(2), state)[0]
                  for method, state, kind in zip((a, b), states, ("all", "training"))]
        np.testing.assert_array_equal(*images, err_msg=name)


def test_a_folder_of_one_precision_is_not_continued_in_another(folders):
    with pytest.raises(InputError, match="half"):
        render_sequence(RenderJob(catalog.load("hard/glossy-floor"), (2, 3), 24, 36,
                                  training=True), folders["half"].folder)
    assert FrameSequence.open(folders["half"].folder).manifest.half
