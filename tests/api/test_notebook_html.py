"""What frames, sequences, scores and reports show of themselves in a notebook."""

from __future__ import annotations

import base64
import csv
import io
import re
import sys
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import onespp
from onespp.api import scoring
from onespp.render.channels import CHANNELS
from onespp.show.html import strip_html, table_html
from onespp.show.pictures import Display, fitted, picture
from onespp.show.png import png
from tests.support.browser import chromium
from tests.support.frames import make_frame

EMPTY = {"img", "br", "input", "meta", "link"}


@pytest.fixture(scope="module")
def sequence(tmp_path_factory) -> onespp.FrameSequence:
    made = onespp.render("box", tmp_path_factory.mktemp("shown") / "s", frames=3, size=(18, 24),
                         reference_spp=16)
    return onespp.denoise(made, "atrous")


@pytest.fixture(scope="module")
def scores(sequence) -> onespp.Scores:
    return onespp.score(sequence)


@pytest.fixture(scope="module")
def opened():
    """Opens a piece of HTML in a page; fails where that complains."""
    complaints: list[str] = []
    with chromium() as browser:
        def open_piece(piece: str):
            page = browser.new_page(viewport={"width": 900, "height": 900})
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.set_content(f"<meta charset='utf-8'><body>{piece}</body>")
            return page

        yield open_piece
    assert complaints == []


class Balanced(HTMLParser):
    """Every element that begins ends, in order; keeps texts and the addresses of images."""

    def __init__(self, piece: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.images: list[str] = []
        self.texts: list[str] = []
        self.feed(piece)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.images.append(dict(attrs)["src"] or "")
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def decoded(address: str) -> np.ndarray:
    head, text = address.split(",")
    assert head == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB"))


def test_png_files_hold_their_pixels():
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 3)).astype(np.uint8)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png(pixels)))), pixels)


def test_a_frame_shows_its_colour_and_every_channel(sequence):
    frame = sequence.read_frame(1)
    shown = Balanced(frame._repr_html_())
    assert len(shown.images) == 1 + len(frame.images)
    assert set(frame.images) <= set(shown.texts)
    np.testing.assert_array_equal(decoded(shown.images[0]), picture(frame["color"]))


def test_large_frames_are_shown_small():
    image = np.zeros((1080, 1920, 3), np.float32)
    assert fitted(image, 480).shape == (270, 480, 3)
    assert fitted(image[:10, :100], 480).shape == (10, 100, 3)


def test_every_channel_has_a_picture():
    frame = make_frame(12, 16)
    for name, channel in CHANNELS.items():
        shape = (12, 16, channel.components)[:2 if channel.components == 1 else 3]
        image = (np.where(frame["id"] > 0, 1, -1) if channel.is_id
                 else np.random.default_rng(0).normal(size=shape))
        image = image.astype(np.int32 if channel.is_id else np.float32)
        if not channel.is_id:
            image[0, 0] = np.nan
        shown = picture(image, channel.display)
        assert (shown.shape, shown.dtype) == ((12, 16, 3), np.uint8), name
        assert len(np.unique(shown)) > 1, name


def test_display_values_are_those_of_the_metrics():
    linear = np.array([[[0.25, 0.5, 2.0], [np.nan, -1.0, np.inf]]], np.float32)
    np.testing.assert_array_equal(picture(linear), [[[137, 188, 255], [0, 0, 255]]])
    np.testing.assert_array_equal(picture(np.tile([0.0, 1.0, -1.0], (1, 1, 1)), Display.AXES)[0, 0],
                                  [128, 255, 0])


def test_a_sequence_shows_input_results_and_reference(sequence, scores):
    shown = Balanced(sequence._repr_html_())
    assert [text for text in shown.texts if text in ("input", "atrous", "reference")] == [
        "input", "atrous", "reference"]
    np.testing.assert_array_equal(decoded(shown.images[1]),
                                  picture(sequence.read_result("atrous", 0)))


def test_the_slider_chooses_the_frame(opened, sequence):
    page = opened(sequence._repr_html_())
    page.locator("input[type=range]").fill("2")
    assert page.locator("output").input_value() == "2"
    for i, expected in enumerate((sequence.read_frame(2)["color"],
                                  sequence.read_result("atrous", 2),
                                  sequence.read_reference(2).color)):
        image = page.locator("img").nth(i)
        np.testing.assert_array_equal(decoded(image.get_attribute("src")),
                                      picture(expected))
        assert image.evaluate("image => image.naturalWidth") == 24


def test_two_strips_on_a_page_keep_apart(opened):
    images = [np.full((4, 4, 3), v, np.float32) for v in (0.0, 1.0)]
    page = opened(strip_html("a", [0, 1], {"x": images}) + strip_html("a", [0, 1], {"x": images}))
    page.locator("input").nth(1).fill("1")
    sources = [page.locator("img").nth(i).get_attribute("src") for i in (0, 1)]
    assert (decoded(sources[0]) == 0).all()
    assert (decoded(sources[1]) == 255).all()


def test_names_are_text_and_no_html():
    name = '<script>alert("&")</script>'
    image = np.zeros((2, 2, 3), np.float32)
    for piece in (strip_html(name, [0], {name: [image]}),
                  table_html(name, {name: {name: name}}, set(), [name])):
        assert name not in piece
        assert "".join(Balanced(piece).texts).count('alert("&")') >= 2


def test_scores_are_a_table_with_the_best_in_bold(scores):
    piece = scores._repr_html_()
    shown = Balanced(piece)
    assert {"input", "atrous", "PSNR (dB)", "ms/frame"} <= set(shown.texts)
    assert f"<b>{scores.methods['atrous']['psnr_srgb']:.2f}" in piece
    assert any("reference 16 spp" in text for text in shown.texts)


def test_scores_as_a_data_frame_are_what_the_csv_file_holds(scores, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=list))
    rows = scores.to_pandas()
    expected = list(csv.DictReader(io.StringIO(scores.csv_text())))
    assert len(rows) == len(expected) == 6
    assert [{k: "" if v is None else str(v) for k, v in row.items()} for row in rows] == expected


def test_a_data_frame_without_pandas_is_refused_in_a_sentence(scores, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(onespp.InputError, match="needs pandas, which is not installed"):
        scores.to_pandas()


def test_a_report_is_the_page_itself(opened, sequence, scores):
    """Its viewer, too, which loads images: from inside the page."""
    report = onespp.report(sequence, channels=["albedo"])
    page = opened(report._repr_html_())
    inner = page.frame_locator("iframe")
    inner.locator('#stage[data-ready="true"]').wait_for(timeout=120_000, state="attached")
    assert inner.locator("h1").inner_text() == "box"
    assert [inner.locator(f"#trouble-{side}").inner_text() for side in "ab"] == ["", ""]


def test_a_report_that_is_too_large_says_where_it_is(sequence, monkeypatch):
    report = onespp.report(sequence, channels=[])
    monkeypatch.setattr(scoring, "LARGEST_INLINE", 1000)
    text = report._repr_html_()
    assert str(report.path) in text
    assert not re.search("<iframe|<script", text)
