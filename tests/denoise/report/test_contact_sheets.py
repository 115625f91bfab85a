"""Contact sheets, the movie and the plot: there, whole, decodable, and of what they say."""

from __future__ import annotations

import json
import sys

import av
import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

import onespp.denoise.report.movie
from onespp.denoise.metrics.tonemap import bytes_from_linear, srgb_from_linear
from onespp.denoise.report.contact_sheets import (
    LARGE_ENOUGH,
    WANTED,
    _columns,
    contact_sheet,
    display_error,
    draw_pictures,
    movie_pictures,
)
from onespp.denoise.report.movie import MovieError, write_movie
from onespp.denoise.report.panels import (
    ERROR_MAX,
    GAP,
    error_picture,
    panel,
    scaled_size,
    shortened,
    tile,
)
from onespp.denoise.report.speed_error_plot import pareto_front, plot_speed_against_error
from onespp.denoise.score.scorecard import INPUT
from onespp.denoise.score.sequence import measure_sequence, score
from onespp.render.errors import InputError
from onespp.render.progress import silent
from tests.support.made_sequence import COUNT, HEIGHT, WIDTH, make_sequence, truth


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    sequence = make_sequence(tmp_path_factory.mktemp("drawn") / "made")
    return sequence, draw(sequence)


def draw(sequence, progress=silent):
    """Scores, with what drawing them noted."""
    scores = score(sequence, progress=progress)
    trouble = draw_pictures(sequence, scores, progress=progress)
    return scores.model_copy(update={"notes": [*scores.notes, *trouble]})


def decoded(path) -> np.ndarray:
    """(n, h, w, 3) uint8 of a movie."""
    with av.open(str(path)) as file:
        return np.stack([f.to_ndarray(format="rgb24") for f in file.decode(video=0)])


def files(folder) -> set[str]:
    return {path.name for path in folder.iterdir()}


# The whole set


def test_scoring_leaves_sheets_plot_and_movie_and_nothing_partial(drawn):
    sequence, scores = drawn
    assert not any("no movie" in note for note in scores.notes)
    assert files(sequence.folder / "pictures") == {
        "sheet_0000.png", "sheet_0002.png", "sheet_0003.png", "sequence.mp4",
        "speed_against_error.png"}
    for path in (sequence.folder / "pictures").glob("*.png"):
        with Image.open(path) as image:
            image.load()


def test_without_a_reference_there_are_pictures_but_no_plot(tmp_path):
    sequence = make_sequence(tmp_path / "made", reference=False)
    pictures = sequence.folder / "pictures"
    pictures.mkdir()
    (pictures / "speed_against_error.png").write_bytes(b"of an older run")
    draw(sequence)
    assert files(pictures) == {"sheet_0000.png", "sheet_0002.png", "sheet_0003.png",
                               "sequence.mp4"}


def test_sheets_of_frames_that_are_no_longer_chosen_go(tmp_path):
    sequence = make_sequence(tmp_path / "made", methods=False)
    (sequence.folder / "pictures").mkdir()
    (sequence.folder / "pictures/sheet_0099.png").write_bytes(b"old")
    draw(sequence)
    assert "sheet_0099.png" not in files(sequence.folder / "pictures")


def test_progress_counts_up_to_the_total(tmp_path):
    told = []
    sequence = make_sequence(tmp_path / "made", methods=False)
    draw(sequence, progress=lambda done, total, what, note="": told.append((done, total, what)))
    drawing = [(done, total) for done, total, what in told if what == "pictures"]
    assert drawing == [(i + 1, len(drawing)) for i in range(len(drawing))]


# Contact sheets


def test_a_sheet_shows_the_pictures_and_their_errors_pixel_for_pixel(drawn):
    sequence, scores = drawn
    sheet = np.asarray(contact_sheet(sequence, scores, 2))
    reference = sequence.read_reference(2).color
    for image in (sequence.read_result("fine", 2), reference):
        assert holds(sheet, enlarged(bytes_from_linear(image), sheet, 4))
    error = display_error(sequence.read_result("fine", 2), reference)
    assert holds(sheet, enlarged(error_picture(error), sheet, 4))


def enlarged(picture: np.ndarray, sheet: np.ndarray, columns: int) -> np.ndarray:
    k = ((sheet.shape[1] - GAP) // columns - GAP) // WIDTH
    return picture.repeat(k, axis=0).repeat(k, axis=1)


def holds(sheet: np.ndarray, picture: np.ndarray) -> bool:
    """Whether the picture stands somewhere in the sheet."""
    height, width = picture.shape[:2]
    corners = np.argwhere((sheet[:-height + 1, :-width + 1] == picture[0, 0]).all(axis=-1))
    return any(np.array_equal(sheet[y:y + height, x:x + width], picture) for y, x in corners)


def test_a_sheet_without_a_reference_has_no_error_row(tmp_path, drawn):
    sequence = make_sequence(tmp_path / "made", reference=False)
    bare = contact_sheet(sequence, measure_sequence(sequence), 2)
    full = contact_sheet(*drawn, 2)
    assert bare.height < 0.6 * full.height


@pytest.mark.parametrize(("size", "count"), [((256, 256), 3), ((720, 1280), 9), ((2160, 3840), 4),
                                             ((8, 6), 3), ((90, 160), 30)])
def test_sheets_stay_below_4000_pixels_and_small_images_grow(size, count):
    columns = _columns(count, size)
    height, width = scaled_size(size, columns, WANTED, columns * (LARGE_ENOUGH + GAP) + GAP)
    assert columns * (width + GAP) + GAP < 4000
    assert 300 <= width <= LARGE_ENOUGH
    assert height / width == pytest.approx(size[0] / size[1], rel=0.01)


def test_the_error_colours_are_fixed_and_grow_brighter_with_the_error():
    error = ERROR_MAX * np.linspace(0, 1, 40)[None]
    brightness = error_picture(error).astype(int).sum(axis=-1)[0]
    assert (np.diff(brightness) >= 0).all()
    assert brightness[0] < 20
    half_way = (255 * np.array(colormaps["inferno"](0.5)[:3])).round()
    assert np.abs(error_picture(np.full((1, 1), ERROR_MAX / 4))[0, 0] - half_way).max() <= 2
    beyond = error_picture(np.array([[ERROR_MAX, 7.0]]))
    assert np.array_equal(beyond[0, 0], beyond[0, 1])


def test_the_error_picture_judges_display_values_and_black_for_non_finite_pixels():
    reference = truth(0)
    image = reference.copy()
    image[1, 2] = np.nan
    error = display_error(image, reference)
    assert error[1, 2] == pytest.approx(srgb_from_linear(reference[1, 2]).mean())
    assert np.delete(error.ravel(), WIDTH + 2).max() == 0


def test_long_names_are_cut_to_their_panel():
    assert shortened("assignment", 14, 1000) == "assignment"
    cut = shortened("a-very-long-name-of-a-method", 14, 80)
    assert cut.endswith("...")
    assert len(cut) < 20
    picture = Image.new("RGB", (48, 20))
    made = panel("a-very-long-name-of-a-method", "33.33 dB", [picture])
    assert made.width == 48
    assert tile([made], 1).width % 2 == 0


# The movie


def test_the_movie_has_every_frame_at_the_size_and_rate_of_the_sequence(drawn):
    sequence, scores = drawn
    path = sequence.folder / "pictures/sequence.mp4"
    expected = list(movie_pictures(sequence, scores, ["fine"]))
    movie = decoded(path)
    assert movie.shape == (COUNT, *expected[0].shape)
    assert np.abs(movie[2].astype(int) - expected[2]).mean() < 6  # lossy, and half the colours
    with av.open(str(path)) as file:
        about = file.streams.video[0]
        assert (about.codec_context.name, about.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (about.codec_context.colorspace, about.codec_context.color_primaries) == (1, 1)
        assert (about.codec_context.color_trc, about.average_rate) == (13, 12)


@pytest.mark.parametrize("colour", [(200, 60, 30), (20, 160, 90), (128, 128, 128)])
def test_the_movie_keeps_colours(tmp_path, colour):
    flat = np.full((64, 64, 3), colour, np.uint8)
    write_movie(tmp_path / "a.mp4", [flat, flat], 24)
    assert np.abs(decoded(tmp_path / "a.mp4")[1].astype(int) - flat).max() <= 3


def test_the_movie_shows_input_best_method_and_reference(drawn):
    sequence, scores = drawn
    columns = next(iter(movie_pictures(sequence, scores, ["fine"])))
    for image in (sequence.read_frame(0, ("color",))["color"], sequence.read_result("fine", 0),
                  sequence.read_reference(0).color):
        assert holds(columns, enlarged(bytes_from_linear(image), columns, 3))


def test_a_method_without_a_frame_leaves_its_place_black(tmp_path):
    sequence = make_sequence(tmp_path / "made")
    (sequence.folder / "denoised/fine/0001.exr").unlink()
    shown = list(movie_pictures(sequence, measure_sequence(sequence), ["fine"]))
    assert len({picture.shape for picture in shown}) == 1
    assert holds(shown[1], enlarged(np.zeros((HEIGHT, WIDTH, 3), np.uint8), shown[1], 3))


def test_without_pyav_a_sentence_says_how_to_get_it_and_all_else_is_there(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    sequence = make_sequence(tmp_path / "made")
    scores = draw(sequence)
    assert [note for note in scores.notes if note == "There is no movie: PyAV is not installed: "
            "run `pip install 'onespp[movie]'`."]
    assert "sequence.mp4" not in files(sequence.folder / "pictures")
    assert "sheet_0000.png" in files(sequence.folder / "pictures")
    assert json.loads((sequence.folder / "scores.json").read_text())["methods"]


def test_a_movie_that_is_asked_for_is_refused_without_pyav_before_anything_is_scored(
        tmp_path, monkeypatch, call):
    sequence = make_sequence(tmp_path / "made")
    monkeypatch.setitem(sys.modules, "av", None)
    code, _, words = call("score", sequence.folder, "--movie")
    assert code == 2
    assert words == ("onespp: no movie can be made: PyAV is not installed: run `pip install "
                     "'onespp[movie]'`, or leave out --movie\n")
    assert not (sequence.folder / "scores.json").exists()


def test_a_movie_that_is_not_wanted_is_not_made(tmp_path, call):
    sequence = make_sequence(tmp_path / "made")
    assert call("score", sequence.folder, "--no-movie")[0] == 0
    assert "sequence.mp4" not in files(sequence.folder / "pictures")


def test_an_encoder_that_fails_is_named_with_its_reason(tmp_path, monkeypatch):
    def fail(*_):
        raise av.error.InvalidDataError(1, "broken")

    monkeypatch.setattr(onespp.denoise.report.movie, "_stream", fail)
    with pytest.raises(MovieError, match="broken"):
        write_movie(tmp_path / "out/a.mp4", [np.zeros((512, 512, 3), np.uint8)] * 2, 24)
    assert files(tmp_path / "out") == set()


@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError("a truncated file")])
def test_an_interrupted_movie_keeps_the_old_one_and_leaves_nothing_partial(tmp_path, error):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"the old one")

    def pictures():
        yield np.zeros((64, 64, 3), np.uint8)
        raise error

    with pytest.raises(error if isinstance(error, type) else type(error)):
        write_movie(path, pictures(), 24)
    assert files(tmp_path) == {"a.mp4"}
    assert path.read_bytes() == b"the old one"


def test_an_interrupted_sheet_leaves_nothing_partial(tmp_path, monkeypatch):
    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    sequence = make_sequence(tmp_path / "made", methods=False)
    monkeypatch.setattr(Image.Image, "save", interrupt)
    with pytest.raises(KeyboardInterrupt):
        draw(sequence)
    assert files(sequence.folder / "pictures") == set()
    assert json.loads((sequence.folder / "scores.json").read_text())["methods"][INPUT]


def test_pictures_of_odd_or_differing_size_are_refused(tmp_path):
    with pytest.raises(ValueError, match="even"):
        write_movie(tmp_path / "a.mp4", [np.zeros((7, 8, 3), np.uint8)], 24)
    with pytest.raises(ValueError, match="first"):
        write_movie(tmp_path / "a.mp4", [np.zeros((8, n, 3), np.uint8) for n in (8, 10)], 24)
    assert files(tmp_path) == set()


# The plot


def test_the_pareto_front_holds_what_nothing_beats_in_both():
    points = {"slow": (90.0, 33.0), "fast": (2.0, 24.0), "worse": (95.0, 32.0),
              "middle": (30.0, 31.0), "late": (31.0, 31.0)}
    assert pareto_front(points) == ["fast", "middle", "slow"]


@pytest.mark.parametrize("count", [1, 12])
def test_a_plot_of_one_method_and_of_many_shows_a_point_each(tmp_path, drawn, count):
    base = drawn[1].methods["fine"]
    methods = {f"method-{i}": base.model_copy(update={"ms_per_frame": 10.0 * 1.5 ** i})
               for i in range(count)}
    scores = drawn[1].model_copy(update={"methods": {INPUT: drawn[1].methods[INPUT], **methods}})
    assert plot_speed_against_error(scores, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as image:
        seen = {tuple(pixel) for pixel in np.asarray(image.convert("RGB")).reshape(-1, 3).tolist()}
    for i in range(10):
        colour = tuple(round(255 * c) for c in colormaps["tab10"].colors[i])
        assert (colour in seen) == (i < count)


def test_no_name_lies_across_the_axis(tmp_path, drawn):
    base = drawn[1].methods["fine"]
    methods = {"a name as long as names may be": base.model_copy(update={"ms_per_frame": 10.0}),
               "slow": base.model_copy(update={"ms_per_frame": 400.0})}
    scores = drawn[1].model_copy(update={"methods": methods})
    assert plot_speed_against_error(scores, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as image:
        dark = np.asarray(image.convert("L")) < 80
    axis = dark[:, :dark.shape[1] // 4]
    rows = np.flatnonzero(axis[:, axis.sum(0).argmax()])
    pieces = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    assert max(map(len, pieces)) > 0.7 * dark.shape[0]


def test_a_plot_takes_a_scene_of_any_name(tmp_path, drawn):
    scores = drawn[1].model_copy(update={"scene": r"a$b_$^{ \frac"})
    assert plot_speed_against_error(scores, tmp_path / "plot.png")


def test_points_of_times_not_measured_in_turns_are_hollow(tmp_path, drawn):
    base = drawn[1].methods["fine"]

    def hollow(*in_turns: bool) -> list[bool]:
        """Whether the middle of each method's point is white."""
        methods = {f"method-{i}": base.model_copy(update={
            "ms_per_frame": 10.0 * 4**i, "interleaved": turn}) for i, turn in enumerate(in_turns)}
        scores = drawn[1].model_copy(update={"methods": methods})
        plot_speed_against_error(scores, tmp_path / "plot.png")
        with Image.open(tmp_path / "plot.png") as image:
            picture = np.asarray(image.convert("RGB"))
        points = (np.argwhere((picture == np.round(255 * np.array(c))).all(-1))
                  for c in colormaps["tab10"].colors[:len(in_turns)])
        middles = ((at.min(axis=0) + at.max(axis=0)) // 2 for at in points)
        return [bool((picture[y, x] > 250).all()) for y, x in middles]

    assert hollow(False, False) == hollow(True, True) == [False, False]
    assert hollow(True, False) == [False, True]


def test_the_command_tells_how_to_get_a_movie_and_goes_on(tmp_path, monkeypatch, call):
    monkeypatch.setitem(sys.modules, "av", None)
    code, out, _ = call("score", make_sequence(tmp_path / "made").folder)
    assert code == 0
    assert ("There is no movie: PyAV is not installed: run `pip install 'onespp[movie]'`."
            in " ".join(out.split()))
