"""The report in a real browser, opened from disk: it loads, and does what hands ask of it."""

from __future__ import annotations

from itertools import count
from typing import Any
from urllib.parse import parse_qs

import numpy as np
import pytest

from onespp.denoise.metrics.image import pair
from onespp.denoise.metrics.perceptual.flip import flip_map
from onespp.denoise.metrics.tonemap import bytes_from_linear
from onespp.denoise.report.html import write_report
from onespp.denoise.score.sequence import score
from tests.support.browser import chromium
from tests.support.report_sequence import COUNT, HEIGHT, METHODS, WIDTH, make_report_sequence

READY = '#stage[data-ready="true"]'
PATIENCE = 120_000  # ms; a slow machine is not a failure
COUNTER = count()


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """(sequence, scores, address of the page)."""
    sequence = make_report_sequence(tmp_path_factory.mktemp("a report") / "made")
    scores = score(sequence)
    return sequence, scores, write_report(sequence, scores).as_uri()


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


def heard(context) -> tuple[Any, list[str]]:
    """A new page, and what it complains of at any time."""
    context.set_default_timeout(PATIENCE)
    page, complaints = context.new_page(), []
    page.on("console", lambda m: m.type == "error" and complaints.append(m.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url}"))
    return page, complaints


@pytest.fixture
def opened(browser, report):
    """Opens the page in a window of its own; fails the test if the page complains at any time."""
    complaints, contexts = [], []

    def open_page(hash_: str = "", width: int = 1300, height: int = 900, **options):
        contexts.append(browser.new_context(viewport={"width": width, "height": height},
                                            reduced_motion="reduce", **options))
        page, said = heard(contexts[-1])
        complaints.append(said)
        page.goto(report[2] + hash_)
        page.wait_for_selector(READY)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert not any(complaints), complaints


@pytest.fixture(scope="module")
def window(browser, report):
    page, complaints = heard(browser.new_context(viewport={"width": 1300, "height": 900},
                                                 reduced_motion="reduce"))
    page.goto(report[2])
    page.wait_for_selector(READY)
    yield page, complaints
    page.context.close()


@pytest.fixture
def shown(window):
    """Shows what an address says in a window that tests share (to open one takes two seconds);
    what addresses do not hold is as the test before left it. Fails as `opened`."""
    page, complaints = window
    complaints.clear()

    def show(hash_: str = ""):
        page.evaluate("""hash => new Promise((resolve) => {
            document.activeElement.blur();
            addEventListener("hashchange", resolve, {once: true});
            location.hash = hash;
        })""", f"{hash_ or '#'}&unlike={next(COUNTER)}")  # ignored, but another address
        page.wait_for_selector(READY)
        return page

    yield show
    assert complaints == []


def new_page(browser):
    page = browser.new_page(viewport={"width": 1300, "height": 900}, reduced_motion="reduce")
    page.set_default_timeout(PATIENCE)
    return page


def colour_at(page, x: float, y: float) -> list[int]:
    """R, G, B of the stage's canvas at a fraction of its width and height."""
    return page.evaluate("""([x, y]) => {
        const canvas = document.getElementById("canvas");
        const at = [Math.floor(x * canvas.width), Math.floor(y * canvas.height)];
        return [...canvas.getContext("2d").getImageData(...at, 1, 1).data].slice(0, 3);
    }""", [x, y])


def box_of(page, selector: str) -> dict[str, float]:
    """Where an element is in the window, once it is in view and rests."""
    page.locator(selector).scroll_into_view_if_needed()
    return page.locator(selector).bounding_box()


def hash_of(page, frame: int) -> dict[str, str]:
    """The address once it has followed to a frame, which it does when hands rest."""
    page.wait_for_function(
        "n => new URLSearchParams(location.hash.slice(1)).get('frame') === String(n)", arg=frame)
    return {k: v[0] for k, v in parse_qs(page.evaluate("location.hash.slice(1)")).items()}


def expected(image: np.ndarray, x: int, y: int) -> np.ndarray:
    return bytes_from_linear(image[y, x]).astype(int)


def test_it_opens_and_draws_every_plot(shown):
    page = shown()
    for name in ("speed", "frames", "histogram", "class-db", "class-share"):
        assert page.locator(f"#plot-{name} svg .axes").count() == 1, name
        drawn = page.locator(f"#plot-{name} svg :is(.line, .marker)").count()
        assert drawn >= len(METHODS), name
    assert page.locator("#plot-speed .marker").count() == len(METHODS)
    assert page.locator("#plot-speed .front").get_attribute(
        "aria-label") == "Pareto front: rough, fine"


def test_a_point_says_its_values_and_chooses_its_method(shown, report):
    page = shown("#frame=1&a=input&b=fine")
    point = page.locator('#plot-speed [aria-label^="rough"]')
    point.hover()
    value = f"{report[1].methods['rough']['psnr_srgb']:.2f} dB"
    page.wait_for_function("v => document.getElementById('tip').innerText.includes(v)", arg=value)
    point.click()
    page.wait_for_selector(READY)
    assert page.locator("#b").input_value() == "rough"


def test_the_plots_follow_the_measure_and_the_legend(shown):
    page = shown()
    measure = page.locator("#metric").input_value()
    page.select_option("#metric", "relmse")
    assert "relMSE" in page.locator("#plot-speed").text_content()
    page.click('#legend button:has-text("fine")')
    assert page.locator("#plot-speed .marker").count() == len(METHODS) - 1
    page.click('#legend button:has-text("fine")')
    page.select_option("#metric", measure)


def test_both_pictures_show_the_pixels_of_their_files(shown, report):
    page = shown("#frame=2&a=rough&b=reference&split=0.5")
    sequence = report[0]
    box = page.evaluate("(() => { const s = document.getElementById('stage');"
                        " return [s.clientWidth, s.clientHeight]; })()")
    zoom = min(box[0] / WIDTH, box[1] / HEIGHT)
    for x, y, image in ((10, 8, sequence.read_result("rough", 2)),
                        (40, 20, sequence.read_reference(2).color)):
        left = 0.5 + (x + 0.5 - WIDTH / 2) * zoom / box[0]
        top = 0.5 + (y + 0.5 - HEIGHT / 2) * zoom / box[1]
        assert np.abs(np.array(colour_at(page, left, top)) - expected(image, x, y)).max() <= 1


def test_the_slider_moves_by_hand_and_by_key(shown):
    page = shown("#frame=0&a=input&b=fine")
    stage = box_of(page, "#stage")
    middle = colour_at(page, 0.4, 0.5)
    handle = box_of(page, "#handle")
    page.mouse.move(handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
    page.mouse.down()
    page.mouse.move(stage["x"] + 0.2 * stage["width"], stage["y"] + 0.5 * stage["height"])
    page.mouse.up()
    assert page.locator("#handle").get_attribute("aria-valuenow") == "20"
    assert colour_at(page, 0.4, 0.5) != middle
    page.keyboard.press("ArrowRight")
    assert page.locator("#handle").get_attribute("aria-valuenow") == "22"


def test_frame_and_method_change_by_menu_and_key(shown, report):
    page = shown("#frame=0&a=input&b=fine")
    page.locator("#frame").fill("3")
    page.wait_for_selector('#stage[data-ready="true"][data-frame="3"]')
    page.select_option("#b", "rough")
    page.wait_for_selector(READY)
    value = report[1].methods["rough"].per_frame[3]["psnr_srgb"]
    assert page.locator("#tag-b").inner_text() == f"B · rough · {value:.2f} dB"
    page.locator("#canvas").focus()
    page.keyboard.press("ArrowRight")  # goes round
    page.wait_for_selector('#stage[data-ready="true"][data-frame="0"]')
    page.keyboard.press("x")
    page.wait_for_selector(READY)
    assert page.locator("#a").input_value() == "rough"
    page.keyboard.press("m")
    page.wait_for_selector('#stage[data-mode="side"]')
    assert page.locator("#handle").is_hidden()


def test_every_channel_is_shown(shown):
    page = shown("#frame=1&a=rough&b=rough")
    before = colour_at(page, 0.4, 0.5)
    for channel in ("error", "flip", "albedo", "normal", "position", "depth", "id"):
        page.select_option("#ca", channel)
        page.wait_for_selector(READY)
        assert page.locator("#trouble-a").inner_text() == ""
        assert colour_at(page, 0.4, 0.5) != before, channel
        assert channel in page.locator("#tag-a").inner_text()


def test_the_pixel_under_the_pointer_is_read_out(shown, report):
    page = shown("#frame=1&a=fine&b=reference&mode=side&zoom=8&x=24&y=16")
    stage = box_of(page, "#stage")
    x, y = 22, 13
    page.mouse.move(stage["x"] + stage["width"] / 4 + 8 * (x + 0.5 - 24),
                    stage["y"] + stage["height"] / 2 + 8 * (y + 0.5 - 16))
    page.wait_for_function("document.getElementById('pixel').textContent.includes('·')")
    object_name = report[0].manifest.objects[report[0].read_frame(1)["id"][y, x]]
    assert page.locator("#pixel").inner_text() == f"x {x}, y {y} · {object_name}"
    values = [float(cell) for cell in page.locator("#pixels tr:first-child td").all_inner_texts()]
    np.testing.assert_allclose(values[:3], report[0].read_result("fine", 1)[y, x], rtol=0.01)


def test_exposure_brightens_the_pictures(shown):
    page = shown("#frame=0&a=reference&b=reference")
    before = sum(colour_at(page, 0.4, 0.5))
    page.locator("#ev").fill("2")
    page.wait_for_selector(READY)
    assert sum(colour_at(page, 0.4, 0.5)) > before


def test_a_link_restores_the_view(opened):
    wanted = {"frame": "2", "a": "rough", "b": "reference", "ca": "error", "x": "20", "y": "17",
              "zoom": "30", "split": "0.3", "ev": "1.5"}
    page = opened("#" + "&".join(f"{k}={v}" for k, v in wanted.items()))
    assert page.locator("#stage").get_attribute("data-frame") == "2"
    assert [page.locator(f"#{i}").input_value() for i in ("a", "b", "ca", "cb", "ev")] == [
        "rough", "reference", "error", "result", "1.5"]
    assert page.locator("#zoom").inner_text() == "3000 %"
    assert page.locator("#handle").get_attribute("aria-valuenow") == "30"
    page.locator("#next").click()
    page.wait_for_selector('#stage[data-ready="true"][data-frame="3"]')
    assert hash_of(page, 3) == {**wanted, "frame": "3"}
    page.evaluate("location.hash = '#frame=1&a=input&b=fine'")
    page.wait_for_selector('#stage[data-ready="true"][data-frame="1"]')
    assert page.locator("#a").input_value() == "input"


def test_nonsense_in_a_link_is_ignored(shown):
    page = shown("#frame=99&a=<b>&b=none&zoom=-3&x=nan&ev=1e9&split=7")
    assert page.locator("#stage").get_attribute("data-frame") == str(COUNT // 2)
    assert page.locator("#zoom").inner_text() == "fit"


def test_the_wheel_zooms_where_the_picture_has_the_focus_and_scrolls_elsewhere(shown):
    """Events of our own: where a real pointer is after a scroll depends on the browser's pace."""
    page = shown("#frame=0&a=input&b=fine")
    wheel_is_taken = """() => !document.getElementById("canvas").dispatchEvent(
        new WheelEvent("wheel", {deltaY: -300, clientX: 300, clientY: 200, cancelable: true}))"""
    assert not page.evaluate(wheel_is_taken)
    assert page.locator("#zoom").inner_text() == "fit"
    page.locator("#canvas").focus()
    assert page.evaluate(wheel_is_taken)
    page.wait_for_function("document.getElementById('zoom').textContent !== 'fit'")


def test_it_plays_and_stops(shown):
    page = shown("#frame=0&a=input&b=fine")
    page.click("#play")
    page.wait_for_selector('#stage[data-frame="2"]')
    page.click("#play")
    page.wait_for_selector(READY)
    assert page.locator("#play").get_attribute("aria-pressed") == "false"
    seen = page.evaluate("""async () => {
        const seen = new Set();
        for (let i = 0; i < 20; i++) {
            seen.add(document.getElementById("stage").dataset.frame);
            await new Promise((resolve) => setTimeout(resolve, 20));
        }
        return seen.size;
    }""")
    assert seen == 1


def test_the_table_sorts_both_ways(shown, report):
    page = shown()
    names = "#table tbody th"
    psnr = {name: m["psnr_srgb"] for name, m in report[1].methods.items()}
    page.click('#table thead button:text-is("PSNR (dB)")')
    down = sorted(psnr, key=psnr.__getitem__, reverse=True)
    assert page.locator(names).all_inner_texts() == down
    page.click('#table thead button:text-is("PSNR (dB)")')
    assert page.locator(names).all_inner_texts() == down[::-1]
    assert page.locator('#table th[aria-sort="ascending"]').count() == 1


def test_the_theme_follows_the_system_and_the_button(opened):
    page, ground = opened(color_scheme="dark"), "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(ground)
    page.emulate_media(color_scheme="light")
    light = page.evaluate(ground)
    assert light != dark
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(ground) == dark
    page.click("#theme")
    assert page.evaluate(ground) == light
    page.reload()
    assert page.evaluate(ground) == light


def test_the_list_of_keys_opens_and_closes(shown):
    page = shown()
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    assert page.locator("#shortcuts dt").count() > 10
    page.keyboard.press("Escape")
    assert page.locator("#help").is_hidden()


def test_it_fits_a_phone(opened):
    page = opened(width=375, height=700, has_touch=True, is_mobile=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= 375
    stage = page.locator("#stage").bounding_box()
    assert stage["width"] > 300
    page.locator("#canvas").scroll_into_view_if_needed()
    page.locator("#canvas").tap(position={"x": 100, "y": 100})
    assert page.locator("#pixels td").first.inner_text() != ""


def test_everything_that_takes_the_focus_has_a_name(shown):
    page = shown()
    nameless = page.evaluate("""() => [...document.querySelectorAll(
        "button, select, input, a, canvas, [tabindex='0']")].filter((node) => !(
            node.getAttribute("aria-label") || node.getAttribute("aria-labelledby")
            || node.labels?.length || node.textContent.trim())).map((node) => node.outerHTML)""")
    assert nameless == []
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map((node) => node.id)")
    assert len(set(ids)) == len(ids)


def test_a_missing_file_is_said_in_its_place(browser, report, tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=1)
    page_file = write_report(sequence, score(sequence))
    (page_file.parent / "data/denoised/fine/0000.js").unlink()
    page = new_page(browser)
    page.goto(page_file.as_uri() + "#frame=0&a=input&b=fine")
    page.wait_for_selector(READY)
    assert "data/denoised/fine/0000.js is missing" in page.locator("#trouble-b").inner_text()
    assert page.locator("#trouble-a").inner_text() == ""
    page.close()


def test_without_references_it_shows_pictures_and_no_empty_plots(browser, tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=1)
    (sequence.folder / "reference/0000.exr").unlink()
    page, errors = new_page(browser), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(write_report(sequence, score(sequence)).as_uri())
    page.wait_for_selector(READY)
    page.wait_for_timeout(100)
    assert errors == []
    assert page.locator("#plots").is_hidden()
    assert sorted(page.locator("#a option").evaluate_all("all => all.map(o => o.value)")) == [
        "fine", "input", "rough"]
    assert page.locator("#trouble-b").inner_text() == ""
    page.close()


def open_and_watch(browser, report, hash_):
    """The page, and the names of the files that it has asked for so far."""
    page, asked = new_page(browser), []
    page.on("request", lambda request: asked.append(request.url.rsplit("/report/", 1)[-1]))
    page.goto(report[2] + hash_)
    page.wait_for_selector(READY)
    return page, asked


def test_only_what_is_looked_at_is_loaded(browser, report):
    page, asked = open_and_watch(browser, report, "#frame=1&a=input&b=fine")
    page.wait_for_function("document.getElementById('pixel').textContent.includes('·')")
    page.wait_for_function("document.querySelectorAll('#pixels tr').length === 3")
    page.wait_for_timeout(200)  # for anything more
    images = {url for url in asked if url.startswith("data/")}
    assert images == {f"data/{kind}/0001.js" for kind in (
        "frame/color", "denoised/fine", "frame/id", "reference")}
    page.close()


def test_frames_that_fly_by_are_not_loaded(browser, report):
    page, asked = open_and_watch(browser, report, "#frame=0&a=input&b=fine")
    page.evaluate("""() => [1, 2, 3].forEach((n) => {
        const slider = document.getElementById("frame");
        slider.value = n;
        slider.dispatchEvent(new Event("input"));
    })""")
    page.wait_for_selector('#stage[data-ready="true"][data-frame="3"]')
    assert "data/denoised/fine/0003.js" in asked
    assert not any(url.endswith("/0002.js") for url in asked)
    page.close()


@pytest.mark.parametrize("workers", [True, False])
def test_the_flip_map_is_that_of_the_library(browser, report, shown, workers):
    address = "#frame=1&a=rough&b=fine&ca=flip&cb=flip&mode=side"
    if workers:
        page = shown(address)
    else:
        page = new_page(browser)
        page.add_init_script("delete window.Worker")
        page.goto(report[2] + address)
        page.wait_for_selector(READY)
    stage = box_of(page, "#stage")
    zoom = min(stage["width"] / 2 / WIDTH, stage["height"] / HEIGHT)
    reference = report[0].read_reference(1).color
    wanted = flip_map(*pair(report[0].read_result("rough", 1), reference).srgb)
    for x, y in ((0, 0), (WIDTH - 1, 3), (20, HEIGHT - 1), (24, 16), (11, 9)):
        page.mouse.move(stage["x"] + stage["width"] / 4 + zoom * (x + 0.5 - WIDTH / 2),
                        stage["y"] + stage["height"] / 2 + zoom * (y + 0.5 - HEIGHT / 2))
        page.wait_for_function("at => document.getElementById('pixel').textContent.startsWith(at)",
                               arg=f"x {x}, y {y}")
        value = float(page.locator("#pixels tr:first-child td").first.inner_text())
        assert value == pytest.approx(wanted[y, x], abs=0.004)
    if not workers:
        page.close()


def test_hollow_points_are_of_times_not_measured_in_turns(browser, report, tmp_path):
    sequence = make_report_sequence(tmp_path / "made", frames=2)
    scores = score(sequence)
    methods = {name: method.model_copy(update={"interleaved": name == "fine"})
               for name, method in scores.methods.items()}
    page = new_page(browser)
    page.goto(write_report(sequence, scores.model_copy(update={"methods": methods})).as_uri())
    page.wait_for_selector(READY)
    hollow = page.locator("#plot-speed .marker:has(.hollow)")
    assert [label.split(":")[0] for label in hollow.evaluate_all(
        "all => all.map((node) => node.getAttribute('aria-label'))")] == ["rough"]
    assert "medians of their own runs (hollow)" in page.locator("#times-are").inner_text()
    page.close()
