import numpy as np
import pytest

from onespp.render.channels import FRAME, REPLAY
from onespp.render.files.frame_ranges import parse_frames
from onespp.render.job import RenderJob, render_sequence
from onespp.render.tracer.renderer import Renderer
from onespp.render.tracer.replay import replay
from onespp.scenes.description import Camera, Rectangle, Scene, Shape, Sphere
from onespp.scenes.transforms import look_at, rotate, scale, translate
from tests.support.small_sequence import contents

HEIGHT, WIDTH = 30, 36
GRAY = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": (0.5,) * 3}}


def scene(moves=False, emission=(8.0, 8.0, 8.0), **changes) -> Scene:
    """A ball over a floor before a wall, under a lamp that the camera does not see."""
    ball = (lambda f: translate((0.3 * f - 0.6, 0.6, 0)) @ scale(0.5)) if moves else (
        translate((0, 0.6, 0)) @ scale(0.5))
    shapes = (Shape("ball", Sphere(), GRAY, ball),
              Shape("floor", Rectangle(), GRAY, rotate((1, 0, 0), -90) @ scale(4)),
              Shape("lamp", Rectangle(), GRAY, translate((0, 4, 0)) @ rotate((1, 0, 0), 90),
                    emission),
              Shape("wall", Rectangle(), GRAY, translate((0, 1, -1.5)) @ scale(4)))
    parts = {"name": "gradient", "about": "for tests", "frames": 8, "width": WIDTH,
             "height": HEIGHT, "max_depth": 3, "shapes": shapes,
             "camera": Camera(look_at((0, 2, 5), (0, 0.4, 0)))}
    return Scene(**(parts | changes))


def replayed(made, index=1, seed=0, **options):
    frame = Renderer(made, HEIGHT, WIDTH, **options).frame(index, seed, (*FRAME, *REPLAY))
    return frame, frame["replay"], frame["replay_before"], frame["replay"][..., 0] >= 0


def replayed_from_the_first(made, index):
    """The same of samples of frame 0, some frames before."""
    renderer = Renderer(made, HEIGHT, WIDTH)
    planes = replay(renderer, index, 0, seed=0)
    return (renderer.frame(index), planes["replay"], planes["replay_before"],
            planes["replay"][..., 0] >= 0)


@pytest.mark.parametrize("options", [{}, {"direct": "resampled", "sampler": "zsobol"}])
def test_in_a_scene_that_stands_still_nothing_changes(options):
    frame, now, before, seen = replayed(scene(), **options)
    np.testing.assert_array_equal(now, before)
    assert (now[seen] > 0).any(axis=0).all()
    strata = seen.reshape(HEIGHT // 3, 3, WIDTH // 3, 3).sum((1, 3))
    all_floor = (frame["id"] >= 0).reshape(HEIGHT // 3, 3, WIDTH // 3, 3).all((1, 3))
    assert (strata[all_floor] == 1).mean() > 0.98  # at a silhouette the point may be missed
    assert strata.max() == 1
    assert (now[~seen] == -1).all()


def test_the_samples_are_those_of_the_frame_before():
    """Seen through a pixel's centre, a point has the radiance that its frame has there."""
    made = scene()
    _, _, before, seen = replayed(made)
    frame = Renderer(made, HEIGHT, WIDTH).frame(0, 0)
    for i, name in enumerate(("direct", "indirect")):
        expected = frame[name][seen] @ [0.212671, 0.715160, 0.072169]
        assert np.isclose(before[seen][:, i], expected, rtol=1e-3, atol=1e-5).mean() > 0.98


def test_a_lamp_that_is_dimmed_shows_in_full():
    dimmed = scene(emission=lambda f: (8.0, 8.0, 8.0) if f < 1 else (2.0, 2.0, 2.0))
    _, now, before, seen = replayed(dimmed)
    assert before[seen].max() > 0.1
    np.testing.assert_allclose(now[seen], before[seen] / 4, rtol=1e-5)


def test_a_ball_that_moves_under_an_even_sky_does_not_change_its_shading():
    """Where nothing else is, the sky is the same from everywhere."""
    alone = scene(moves=True, shapes=scene(moves=True).shapes[:1], environment=(1.0, 1.0, 1.0))
    frame, now, before, seen = replayed(alone)
    assert seen.sum() > 5
    assert (frame["id"][seen] == 0).mean() > 0.8  # they moved with it; the rest at its rim
    np.testing.assert_allclose(now[seen], before[seen], rtol=1e-3, atol=1e-4)


def test_a_shadow_that_moves_shows_where_it_was_and_is():
    frame, now, before, seen = replayed_from_the_first(scene(moves=True), 3)
    on_floor = seen & (frame["id"] == 1)
    change = np.abs(now - before)[..., 0]
    assert change[on_floor].max() > 0.1
    assert (change[on_floor] == 0).mean() > 0.5


def test_points_that_the_ball_hides_now_are_left_out():
    """What stands still and stays in view lands in its own pixel; only the ball's move on."""
    made = scene(moves=True)
    still = Renderer(made, HEIGHT, WIDTH).frame(0)
    frame, _, _, seen = replayed_from_the_first(made, 3)
    covered = (frame["id"] == 0) & (still["id"] != 0)
    assert covered.sum() > 20
    from_ball = (still["id"] == 0).sum() / 9
    assert seen[frame["id"] == 0].sum() < 1.7 * from_ball


def test_the_first_frame_has_none_and_others_do_not_change_by_it():
    made = scene(moves=True)
    _, now, before, _ = replayed(made, index=0)
    assert (now == -1).all()
    assert (before == -1).all()
    with_it, *_ = replayed(made)
    without = Renderer(made, HEIGHT, WIDTH).frame(1)
    for name in FRAME:
        np.testing.assert_array_equal(with_it[name], without[name])


def test_the_same_in_any_order_and_another_with_another_seed():
    made = scene(moves=True)
    renderer = Renderer(made, HEIGHT, WIDTH)
    renderer.frame(5)
    late = renderer.frame(1, 0, (*FRAME, *REPLAY))
    frame, now, _, _ = replayed(made)
    for name in (*FRAME, *REPLAY):
        np.testing.assert_array_equal(late[name], frame[name], err_msg=name)
    assert not np.array_equal(replayed(made, seed=1)[1], now)


PIECES = {"one": ("0:6",), "halves": ("0:3", "3:6"), "every second": ("0:6:2", "0:6"),
          "backwards": ("5", "4", "2:4", "0:2"), "the last alone": ("5", "0:6")}


@pytest.fixture(scope="module")
def in_pieces(tmp_path_factory):
    """The same six frames, asked for in different pieces: contents of their files."""
    made, found = scene(moves=True, emission=lambda f: (8.0 + f,) * 3), {}
    for name, pieces in PIECES.items():
        out = tmp_path_factory.mktemp("pieces") / "s"
        for piece in pieces:
            render_sequence(RenderJob(made, parse_frames(piece), 12, 15, reference_spp=4,
                                      added=REPLAY), out)
        found[name] = {file: data for file, data in contents(out).items()
                       if file.endswith((".exr", ".npz")) or file.startswith("frames")}
    return found


@pytest.mark.parametrize("name", [name for name in PIECES if name != "one"])
def test_a_frame_is_the_same_bytes_in_whichever_pieces_it_was_rendered(in_pieces, name):
    assert len(in_pieces["one"]) == 18
    assert in_pieces[name].keys() == in_pieces["one"].keys()
    assert [f for f, data in in_pieces["one"].items() if in_pieces[name][f] != data] == []


def test_the_command_adds_them(tmp_path, call):
    out = tmp_path / "box"
    base = ("render", "box", "--frames", "0:2", "--size", "12x9", "--out", out)
    code, _, _ = call(*base, "--channels", "+gradient")
    assert code == 0
    from onespp.render.files.sequence import FrameSequence
    sequence = FrameSequence.open(out)
    assert sequence.manifest.channels[-2:] == REPLAY
    assert (sequence.read_frame(0)["replay"] == -1).all()
    assert (sequence.read_frame(1)["replay"] >= 0).any()
    code, _, err = call(*base, "--channels", "+gradients")
    assert (code, "--channels names gradients" in err) == (2, True)
