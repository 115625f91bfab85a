import gc
import subprocess
import sys
import weakref
from typing import NamedTuple

import drjit as dr
import numpy as np
import pytest

from onespp.denoise.history.reprojection import load_table
from onespp.denoise.jit.fastmath import exp2
from onespp.denoise.jit.grid import Stencil
from onespp.denoise.jit.step import Step
from onespp.denoise.jit.structure import build, evaluate, flatten
from onespp.denoise.jit.taps import Taps
from onespp.denoise.methods.assignment import Assignment, AssignmentAtrous
from onespp.denoise.methods.atrous import Atrous
from onespp.denoise.methods.bilateral import Bilateral
from onespp.denoise.methods.temporal import Temporal
from onespp.render.errors import InputError
from tests.support.frames import make_frame, noisy, translation, with_images
from tests.support.recordings import compiled

LAYOUTS = ("views", "gather")


class Point(NamedTuple):
    x: object
    y: object


def stencil_of(height, width, reach, layout="views"):
    return Stencil(height, width, reach, "llvm", layout)


def lanes(stencil, image):
    return [dr.copy(x) for x in stencil.load(np.asarray(image, np.float32))]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("height", "width", "reach"),
                         [(1, 1, 1), (1, 7, 3), (5, 3, 4), (13, 17, 2), (3, 5, 17)])
def test_taps_are_the_shifted_image_with_the_outside_value_around_it(layout, height, width, reach):
    stencil = stencil_of(height, width, reach, layout)
    image = np.random.default_rng(0).random((height, width)).astype(np.float32)
    planes = stencil.planes([-7.0])
    stored = lanes(stencil, image)
    dr.eval(stored)
    planes.store(stored)
    padded = np.pad(image, reach, constant_values=-7)
    window = range(-reach, reach + 1)
    offsets = [(dy, dx) for dy in window for dx in window]
    taps = planes.taps(offsets)
    for t, (dy, dx) in enumerate(offsets):
        expected = padded[reach + dy:reach + dy + height, reach + dx:reach + dx + width]
        np.testing.assert_array_equal(stencil.image(taps.at(t)), expected)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_taps_of_some_planes_over_a_margin(layout):
    stencil = stencil_of(5, 6, 3, layout)
    images = np.random.default_rng(0).random((3, 5, 6)).astype(np.float32)
    planes = stencil.planes([-1.0, -2.0, -3.0])
    stored = [plane for image in images for plane in lanes(stencil, image)]
    dr.eval(stored)
    planes.store(stored)
    taps = planes.taps([(1, 0)], [2, 0], margin=2)
    assert taps.lanes == (5 + 4) * stencil.stride
    for tap, c, outside in zip(taps.at(0), (2, 0), (-3, -1)):
        rows = tap.numpy().reshape(9, stencil.stride)[:, :6]
        np.testing.assert_array_equal(rows, np.pad(images[c], ((1, 3), (0, 0)),
                                                   constant_values=outside))
    with pytest.raises(ValueError, match="reach of 3"):
        planes.taps([(2, 0)], margin=2)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_rows_around_are_views_of_what_a_kernel_gave(layout):
    stencil = stencil_of(4, 5, 2, layout)
    tall = np.random.default_rng(0).random((8, stencil.stride)).astype(np.float32)
    array = stencil.Float(tall.ravel()) + 0
    dr.eval(array)
    taps = stencil.rows_around([array], 2)
    for i in range(5):
        (seen,) = taps.at(i)
        np.testing.assert_array_equal(stencil.image([seen]), tall[i:i + 4, :5])
        assert layout == "gather" or seen.numpy().ctypes.data == (
            array.numpy().ctypes.data + 4 * i * stencil.stride)
    del array, tall
    gc.collect()
    assert np.isfinite(taps.at(4)[0].numpy()).all()  # memory that is still there


@pytest.mark.parametrize("layout", LAYOUTS)
def test_named_taps_in_a_step(layout):
    """Planes filled from a structure come back as another one."""
    stencil = stencil_of(2, 3, 1, layout)
    planes = stencil.planes([-1.0, -2.0, -3.0])
    planes.store([Point(stencil.constant(1), None), (stencil.constant(2), stencil.constant(3))])
    taps = planes.taps([(0, 0), (0, 1)]).named(lambda x, y, z: Point(x, Point(y, z)))
    step = Step(lambda taps: Point(taps.at(0).x, taps.at(1).y.x * 10 + taps.at(1).y.y))
    for _ in range(2):
        here, right = step(taps)
        np.testing.assert_array_equal(stencil.image([here]), 1)
        np.testing.assert_array_equal(stencil.image([right]), [[23, 23, -23]] * 2)
    (some,) = planes.taps([(0, 0)], [2]).named(lambda z: [z]).at(0)
    np.testing.assert_array_equal(stencil.image([some]), 3)


def test_storing_again_is_seen_by_taps_made_before():
    stencil = stencil_of(4, 5, 1)
    planes = stencil.planes([0.0])
    taps = planes.taps([(0, 1)])
    for value in (2.0, 3.0):
        planes.store([stencil.constant(value)])
        assert stencil.image(taps.at(0))[2].tolist() == [value] * 4 + [0.0]


def test_no_tap_of_a_filter_starts_at_a_cache_line():
    """Such taps are loaded by another instruction, and another kernel: see `_allocate`."""
    for width, reach in ((5, 3), (512, 32), (720, 16)):
        stencil = stencil_of(3, width, reach)
        offsets = [(dy, dx) for dy in (-reach, 0, 1) for dx in (-reach, -3, -2, 0, 1, 3, reach)]
        taps = stencil.planes([0.0] * 3).taps(offsets)
        starts = {view.numpy().ctypes.data % 64 for t in range(len(taps)) for view in taps.at(t)}
        assert 0 not in starts
        assert stencil.stride // 16 % 2 == 1  # rows far apart share no set of the cache


def test_a_tap_beyond_the_reach_is_refused():
    with pytest.raises(ValueError, match="reach of 2"):
        stencil_of(4, 5, 2).planes([0.0]).taps([(0, 3)])


@pytest.mark.parametrize("components", [1, 3])
def test_an_image_goes_to_lanes_and_back(components):
    stencil = stencil_of(7, 11, 3)
    image = np.random.default_rng(0).random((7, 11, 3)[:2 + (components > 1)]).astype(np.float32)
    np.testing.assert_array_equal(stencil.image(stencil.load(image)), image)


def test_exp2_is_exact_to_8e_5_and_finite_for_any_input():
    stencil = stencil_of(1, 1, 1)
    x = np.linspace(-45, 0, 100_001).astype(np.float32)
    result = exp2(stencil.Float(x)).numpy()
    assert np.abs(result / np.exp2(x.astype(np.float64)) - 1).max() < 8e-5
    x = np.linspace(-200, -45, 10_001).astype(np.float32)
    assert np.abs(exp2(stencil.Float(x)).numpy() - np.exp2(x.astype(np.float64))).max() < 1e-17
    low = exp2(stencil.Float([-63.0, -127.0, -1e30, float("-inf"), float("nan")])).numpy()
    np.testing.assert_array_equal(low, 0)


def methods_on(layout, height, width):
    small = Bilateral(radius=3)
    for method in (small, Atrous(levels=3), Temporal()):
        yield method, method.init_on(stencil_of(height, width, method.reach, layout))


def test_gathers_and_views_give_the_same():
    frames = [noisy(make_frame(13, 17, index=i, camera=translation(0.1 * i, 0, 0)), seed=i)
              for i in range(3)]
    results = {}
    for layout in LAYOUTS:
        for method, state in methods_on(layout, 13, 17):
            for frame in frames:
                image, state = method(frame, state)
            results.setdefault(type(method), []).append(image)
    for views, gathers in results.values():
        np.testing.assert_allclose(gathers, views, atol=1e-6)


def add(taps: Taps, arrays: list) -> list:
    return [taps.at(0)[0] + taps.at(1)[0] * 2 + arrays[0] * 4 + arrays[1] * 8]


def test_a_step_replays_with_other_memory():
    stencil = stencil_of(3, 5, 1)
    planes = stencil.planes([0.0])
    planes.store([stencil.constant(1)])
    step = Step(add)
    taps = planes.taps([(0, 0), (1, 0)])
    for value in (1.0, 2.0, 3.0):
        result = step(taps, [stencil.constant(value), stencil.constant(10 * value)])
        assert stencil.image(result)[0].tolist() == [3 + 84 * value] * 5
    assert step.recordings == 1


def test_a_step_holds_no_arguments_between_calls_and_goes_when_it_is_dropped():
    stencil = stencil_of(5, 7, 1)
    step = Step(lambda arrays: [arrays[0] + 1])
    step([stencil.constant(1)])
    assert not any(isinstance(value, Step) for value in vars(step).values())
    assert step._call.taps == []
    gc.disable()  # without the help of the cycle collector
    try:
        there = weakref.ref(step)
        del step
        assert there() is None
    finally:
        gc.enable()


def test_dr_jit_walks_the_arguments_of_a_step_once():
    """It walks what the recorded function's closure holds as well, at every call."""
    stencil = stencil_of(5, 7, 1)
    step = Step(lambda arrays: [arrays[0] + 1])
    frozen, inputs = step._frozen.frozen, []
    step._frozen.frozen = lambda given: inputs.append(given) or frozen(given)
    array = stencil.constant(1)
    step([array])
    assert "nonlocals" in inputs[0]
    assert array is inputs[0]["args"][0][0]

    def holds(value):
        return (value is array or (isinstance(value, (list, tuple)) and any(map(holds, value)))
                or (isinstance(value, dict) and any(map(holds, value.values()))))

    assert not holds(inputs[0]["nonlocals"])
    assert not holds(inputs[0]["globals"])


class Pair(NamedTuple):
    first: Point
    second: Point | None
    rest: list


class Sums(NamedTuple):
    total: object
    parts: list
    nothing: object = None


def add_named(pair: Pair, taps: Taps, factor) -> Sums:
    total = pair.first.x + pair.first.y * 2 + sum(pair.rest, taps.at(0)[0]) * factor
    if pair.second is not None:
        total += pair.second.y
    return Sums(total, [pair.first, (pair.first.y * factor,)])


def test_a_step_takes_and_gives_nested_named_structures():
    stencil = stencil_of(3, 5, 1)
    planes = stencil.planes([0.0])
    taps = planes.taps([(0, 0)])
    step = Step(add_named)
    for i in (1.0, 2.0, 3.0):
        x, y, z = (stencil.constant(10.0**power * i) for power in range(3))
        planes.store([stencil.constant(7 * i)])
        sums = step(Pair(Point(x, y), Point(z, z), [x, x]), taps, stencil.opaque(i))
        assert isinstance(sums, Sums)
        assert stencil.image([sums.total])[0].tolist() == [i + 20 * i + 9 * i * i + 100 * i] * 5
        point, (scaled,) = sums.parts
        assert isinstance(point, Point)
        assert sums.nothing is None
        assert stencil.image([point.x, point.y, scaled])[0, 0].tolist() == [i, 10 * i, 10 * i * i]
    assert step.recordings == 1


def test_a_step_records_again_where_something_begins_to_be_absent():
    stencil = stencil_of(3, 5, 1)
    taps = stencil.planes([1.0]).taps([(0, 0)])
    step = Step(add_named)
    one = stencil.constant(1)
    with_none, with_point = (Pair(Point(one, one), second, [one])
                             for second in (None, Point(one, stencil.constant(50))))
    for pair, expected in [(with_none, 5), (with_point, 55)] * 2:
        assert stencil.image([step(pair, taps, one).total])[0, 0] == expected
    assert step.recordings == 2


class Swapped(NamedTuple):
    y: object
    x: object


def test_structures_of_other_classes_are_not_taken_for_one_another():
    """Their arrays are the same list."""
    stencil = stencil_of(1, 1, 1)
    step = Step(lambda point: point.x - point.y)
    one, three = stencil.constant(1), stencil.constant(3)
    for kind, expected in ((Point, -2), (Swapped, 2), (Point, -2)):
        assert step(kind(one, three))[0] == expected


@pytest.mark.parametrize("wrong", [2.0, "text", {"x": 1}, np.zeros(3)])
def test_a_step_refuses_what_would_be_recorded_as_a_constant(wrong):
    stencil = stencil_of(1, 1, 1)
    with pytest.raises(TypeError, match=type(wrong).__name__):
        Step(lambda point: point.x)(Point(stencil.constant(1), wrong))
    with pytest.raises(RuntimeError) as error:
        Step(lambda x: Point(x, wrong))(stencil.constant(1))
    assert isinstance(error.value.__cause__, TypeError)


def test_a_structure_is_its_arrays_and_its_form():
    stencil = stencil_of(1, 3, 1)
    a, b, c = (stencil.Float(range(n)) for n in (1, 2, 3))
    taps = stencil.planes([0.0]).taps([(0, 1)])
    structure = Pair(Point(a, None), taps, [(b, c), [], c])
    flat = flatten(structure)
    assert all(x is y for x, y in zip(flat.arrays, (a, b, c, c), strict=True))
    assert flat.taps == [taps]
    assert build(flat.form, range(4), ["taps"]) == Pair(Point(0, None), "taps", [(1, 2), [], 3])
    assert flatten(build(*flat)).form == flat.form
    assert flatten(structure._replace(rest=[])).form != flat.form


def test_evaluate_reaches_into_named_structures():
    stencil = stencil_of(1, 3, 1)
    point = Point(stencil.constant(1) + 1, [stencil.constant(2) + 2])
    evaluate(point, None)
    assert point.x.state == point.y[0].state == dr.VarState.Evaluated


@pytest.mark.parametrize("alias_first", [True, False])
def test_a_step_notices_when_arguments_begin_or_cease_to_be_the_same_array(alias_first):
    stencil = stencil_of(3, 5, 1)
    planes = stencil.planes([0.0])
    planes.store([stencil.constant(1)])
    step = Step(add)
    a, b = stencil.constant(5), stencil.constant(7)
    same, other = planes.taps([(0, 0), (0, 0)]), planes.taps([(0, 0), (1, 0)])
    calls = [(same, [a, a], 63.0), (other, [a, b], 79.0)]
    for taps, arrays, expected in (calls if alias_first else calls[::-1]) * 2:
        assert stencil.image(step(taps, arrays))[0].tolist() == [expected] * 5


def test_a_step_records_again_for_another_number_of_lanes():
    def mean_column(arrays):
        return [arrays[0] * 0 + dr.width(arrays[0])]  # a width is baked into a recording

    step = Step(mean_column)
    for width in (5, 40, 5):
        stencil = stencil_of(2, width, 1)
        assert step([stencil.constant(1)])[0][0] == stencil.lanes
    assert step.recordings == 2


def test_two_sizes_side_by_side_do_not_disturb_each_other():
    for method in (AssignmentAtrous(), Assignment(filter=Bilateral(radius=3))):
        alone, mixed, states = {}, {}, {}
        for h, w in ((9, 11), (12, 7)):
            state = method.init(h, w)
            for i in range(3):
                alone[h], state = method(noisy(make_frame(h, w, index=i), seed=i), state)
            states[h] = method.init(h, w)
        for i in range(3):
            for h, w in ((9, 11), (12, 7)):
                mixed[h], states[h] = method(noisy(make_frame(h, w, index=i), seed=i), states[h])
        for h in alone:
            np.testing.assert_array_equal(mixed[h], alone[h])


def misaligned(image, floats):
    """The same image in memory that starts some floats after a cache line."""
    memory = np.empty(image.size + 32, image.dtype)
    start = (-memory.ctypes.data % 64) // 4 + floats
    copy = memory[start:start + image.size].reshape(image.shape)
    copy[...] = image
    return copy


def test_alignment_strides_and_shared_memory_of_the_input_do_not_matter():
    frame = noisy(make_frame(9, 11))
    method = AssignmentAtrous()

    def run(*frames):
        state = method.init(9, 11)
        for f in frames:
            image, state = method(f, state)
        return image, state

    expected, _ = run(frame, frame, frame)
    kinds = [with_images(frame, **{k: misaligned(v, n) for k, v in frame.images.items()})
             for n in (0, 1, 5)]
    kinds[1] = with_images(kinds[1], color=np.asfortranarray(frame["color"]))
    result, state = run(*kinds)
    np.testing.assert_array_equal(result, expected)
    assert state.history.clamp_and_blend.recordings == 1
    shared = np.repeat(np.full((9, 11, 1), 0.6, np.float32), 3, axis=2)
    aliased = with_images(frame, color=shared, normal=shared, albedo=shared)
    apart = with_images(frame, color=shared.copy(), normal=shared.copy(), albedo=shared.copy())
    np.testing.assert_array_equal(run(aliased, aliased)[0], run(apart, apart)[0])


def test_a_frame_may_change_after_it_was_denoised():
    """Nothing of the frame's memory is read later."""
    frame = noisy(make_frame(9, 11))
    method = Temporal()
    images = {name: image.copy() for name, image in frame.images.items()}
    first, state = method(with_images(frame, **images), method.init(9, 11))
    before = first.copy()
    second, _ = method(frame, state)
    for image in images.values():
        image.fill(0)
    np.testing.assert_array_equal(first, before)
    _, state = method(frame, method.init(9, 11))
    np.testing.assert_array_equal(method(frame, state)[0], second)


def test_a_second_state_compiles_nothing():
    frame = noisy(make_frame(9, 11))
    method = AssignmentAtrous()
    for f in (frame, frame):
        method(f, method.init(9, 11))
    assert compiled(lambda: method(frame, method.init(9, 11))) == 0


def test_the_motion_table_grows_with_the_scene():
    stencil = stencil_of(2, 2, 1)
    table = np.arange(70 * 16, dtype=np.float32).reshape(70, 16)
    tables = [load_table(table, stencil) for _ in range(8)]
    assert {t.numpy().ctypes.data % 64 for t in tables} == {0}  # packed gathers need it
    loaded = tables[0].numpy()
    assert loaded.size == 128 * 16
    np.testing.assert_array_equal(loaded[:70 * 16], table.ravel())
    assert np.isnan(loaded[70 * 16:]).all()


@pytest.mark.parametrize(("size", "layout", "words"), [
    ((0, 5), None, "empty"), ((5, 5), "planar", "layout 'planar'")])
def test_impossible_grids_are_refused(size, layout, words):
    with pytest.raises(InputError, match=words):
        Stencil(*size, 1, "llvm", layout)


COLLECTED_WHILE_RECORDING = """
import gc
import onespp.denoise
import drjit.llvm as llvm
import numpy as np
from onespp.denoise.jit.step import Step

class Cycle:
    pass

gc.disable()
cycle = Cycle()
cycle.itself, cycle.array = cycle, llvm.Float(np.arange(5.0)) + 1
del cycle

def step(arrays):
    doubled = arrays[0] * 2
    containers = [[] for _ in range(1000)]  # enough for the collector to run
    return [doubled + len(containers)]

gc.enable()
recorded = Step(step)
gc.set_threshold(500, 1, 1)
print(recorded([llvm.Float(np.arange(3.0))])[0])
assert gc.isenabled()
"""


def test_arrays_in_reference_cycles_are_not_freed_while_a_step_is_recorded():
    """Dr.Jit aborts when one is, so this runs in a process of its own."""
    done = subprocess.run([sys.executable, "-c", COLLECTED_WHILE_RECORDING], text=True, check=False,
                          capture_output=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["[1000,", "1002,", "1004]"]
