"""Agreement with an independent C++ solution of the assignment on its own `box` frames."""


import numpy as np
import OpenEXR
import pytest

from onespp.denoise.catalog import build
from onespp.render.frame import Frame
from tests.support.places import GAMES202

DATA = GAMES202

pytestmark = pytest.mark.skipif(not DATA.is_dir(),
                                reason="the assignment's frames are not in ../shared/data")

# The solution pulls surfaces into background pixels, and reprojects to the nearest pixel.
AS_THE_SOLUTION = {"isolate_background": "false"}


def read_exr(path, names):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        planes = [channels[name].pixels for name in names]
    return planes[0] if len(planes) == 1 else np.stack(planes, -1)


def read_frame(index):
    matrix_file = (DATA / f"input/matrix_{index}.mat").read_bytes()
    matrices = np.frombuffer(matrix_file, "<f4", offset=4).reshape(-1, 4, 4).astype(np.float64)
    images = {name: read_exr(DATA / f"input/{file}_{index}.exr", "RGB") for name, file in (
        ("color", "beauty"), ("normal", "normal"), ("position", "position"))}
    images["depth"] = read_exr(DATA / f"input/depth_{index}.exr", "Y")
    images["id"] = read_exr(DATA / f"input/ID_{index}.exr", "Y").astype(np.int32)
    return Frame(index, images, matrices[-2], matrices[-1], matrices[:-2])


def share_within(image, expected, where, tolerance=1e-3):
    return (np.abs(image - expected).max(-1) < tolerance)[where].mean()


@pytest.mark.parametrize("settings", [{}, AS_THE_SOLUTION])
def test_bilateral_filter_equals_the_solution(settings):
    frame = read_frame(0)
    method = build("bilateral", settings)
    result, _ = method(frame, method.init(frame.height, frame.width))
    expected = read_exr(DATA / "spec-output/filter_0.exr", "RGB")
    where = frame["id"] >= (-1 if settings else 0)
    assert np.abs(result - expected)[where].max() < 1e-4


def test_full_method_equals_the_solution():
    method = build("assignment", {"nearest": "true", **AS_THE_SOLUTION})
    state = method.init(512, 512)
    for index in range(4):
        frame = read_frame(index)
        result, state = method(frame, state)
        if index:
            expected = read_exr(DATA / f"spec-output/full_{index}.exr", "RGB")
            assert share_within(result, expected, frame["id"] >= 0) > 0.9999
