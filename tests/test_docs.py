"""The documentation: it builds without a warning, code in it runs, commands parse, links hold."""

from __future__ import annotations

import doctest
import io
import re
import shlex
import sys
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import click
import draw_architecture
import failures
import from_code
import ladder
import numpy as np
import pytest
import results
from PIL import Image
from sphinx.cmd.build import build_main

import onespp.cli
import onespp.denoise.studies.ablation
import onespp.denoise.studies.lead
import onespp.render.cli.bench
from onespp.denoise.catalog import METHODS, PEERS, build, parameters
from onespp.denoise.methods.outliers import RemoveOutliers
from onespp.denoise.methods.parameters import pairs
from onespp.denoise.metrics.table import MEASURES
from onespp.denoise.metrics.tonemap import srgb_from_linear
from onespp.denoise.score.method_score import INPUT, MethodScore
from onespp.denoise.score.scorecard import Scores
from onespp.denoise.score.sequence import score
from onespp.denoise.studies.lead import OIDN_FORMS
from onespp.render.errors import InputError
from onespp.user_code import is_file
from tests.support.frames import make_frame, noisy
from tests.support.report_sequence import make_report_sequence

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {path.name: path for path in (ROOT / "README.md", *sorted(DOCS.glob("*.md")))}
pytestmark = pytest.mark.filterwarnings("ignore:.*MystReferenceResolver")

BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.M | re.S)
CODE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
FOREIGN = {"ruff", "pyright", "pip", "python3"}  # programs whose options are not ours

UNKNOWN = {"my_scene.py", "my_filter.py", "my_metric.py"}  # the reader's

def blocks(page: str, language: str) -> list[tuple[str, str]]:
    """(what stands behind the language, text) of the code blocks of a page."""
    return [(m[2].strip(), m[3]) for m in BLOCK.finditer(PAGES[page].read_text("utf-8"))
            if m[1] == language]


def having(language: str, word: str | None = None) -> list[str]:
    """Pages that have code blocks of a language (without the word behind it)."""
    return [page for page in PAGES if any(word not in info.split() for info, _ in
                                          blocks(page, language))]


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("site")
    assert build_main(["-E", "-W", "--keep-going", "-q", "-b", "html", str(DOCS), str(out)]) == 0
    return out


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A working folder that has a small sequence in data/demo."""
    make_report_sequence(tmp_path / "data/demo", 2)
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Anchors(HTMLParser):
    """The ids of an HTML page, and where it points to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.targets: list[str] = []
        self.feed(page.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids.add(found.get("id") or "")
        if target := found.get("href" if tag in ("a", "link") else "src"):
            self.targets.append(target)


def test_pages_build_without_warnings_and_every_link_in_them_leads_somewhere(site):
    pages = {path.name: Anchors(path) for path in site.glob("*.html")}
    assert {"index.html", *(f"{Path(page).stem}.html" for page in PAGES if page != "README.md")
            } <= pages.keys()
    for name, page in pages.items():
        for target in page.targets:
            if re.match(r"(https?|data|mailto):", target):
                continue
            path, _, anchor = target.partition("#")
            path = path.partition("?")[0]
            assert not path or (site / path).exists(), f"{name} -> {target}"
            where = pages.get(path or name)
            assert not anchor or where is None or anchor in where.ids, f"{name} -> {target}"


def test_what_is_made_from_the_code_is_in_the_pages(site):
    text = {name: (site / f"{name}.html").read_text("utf-8")
            for name in ("architecture", "methods", "files", "metrics", "scenes", "commands")}
    assert not any("from-code:" in page for page in text.values())
    assert all(f'id="method-{name}"' in text["methods"] for name in METHODS)
    assert "10.1145/3105762.3105770" in text["methods"]
    assert text["architecture"].count('<g class="room') == len(from_code.rooms())
    assert "replay_before" in text["files"]
    assert "hard/switched-off" in text["scenes"]
    assert "--reference-spp" in text["commands"]


@pytest.fixture
def house(tmp_path) -> Path:
    """A source tree: `render/job` above the tracer, `render/frame` below it."""
    for name, text in {
            "render/__init__": '"""Frames."""', "render/frame": "x = 1",
            "render/job": "from render.tracer.path import y\nfrom .frame import x",
            "render/tracer/__init__": '"""Light, traced."""',
            "render/tracer/path": "from ..frame import x\ndef f(): import onespp.scenes.box",
            "scenes/box": "import os", "denoise/catalog": "from onespp.render import frame",
            "denoise/cli/main": "from .. import catalog\nimport onespp.render.frame"}.items():
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return tmp_path


def test_rooms_are_folders_and_imports_between_them(house):
    found = draw_architecture.rooms(house)
    assert {key: (room.files, room.below) for key, room in found.items()} == {
        "render^": (["job"], {"render/tracer", "render"}), "render": (["frame"], set()),
        "render/tracer": (["path"], {"render", "scenes"}), "scenes": (["box"], set()),
        "denoise": (["catalog"], {"render"}), "denoise/cli": (["main"], {"denoise", "render"})}
    assert found["render/tracer"].about == "Light, traced."
    assert draw_architecture.reduced(found) == [
        ("denoise", "render"), ("denoise/cli", "denoise"), ("render/tracer", "render"),
        ("render/tracer", "scenes"), ("render^", "render/tracer")]
    assert draw_architecture.circles(found) == []


def test_a_circle_is_found_and_drawn_as_wrong(house):
    (house / "scenes/box.py").write_text("import onespp.render.job\n")
    found = draw_architecture.rooms(house)
    assert ("render^", "scenes") in draw_architecture.circles(found)
    assert draw_architecture.svg(found).count(" wrong") == 3
    assert " wrong" not in draw_architecture.svg(rooms_of_ours())


def test_arrows_go_down_and_rooms_do_not_overlap(house):
    for found in (draw_architecture.rooms(house), rooms_of_ours()):
        level = draw_architecture.layers(found)
        assert all(level[key] > level[below] for key, room in found.items() for below in room.below)
        rows, x, _ = draw_architecture.arrange(found)
        for row in rows:
            for a, b in pairwise([x[p] for p in row if isinstance(p, str)]):
                assert b - a >= draw_architecture.ROOM_WIDTH


def slugs(page: Path) -> set[str]:
    heads = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES)
def test_links_of_the_sources_lead_to_files_and_headings(page):
    path = PAGES[page]
    for target in LINK.findall(path.read_text("utf-8")):
        if not target.startswith("http"):
            file, _, anchor = target.partition("#")
            other = path if not file else path.parent / file
            assert other.is_file(), f"{page} -> {target}"
            assert not anchor or anchor in slugs(other), f"{page} -> {target}"


@cache
def rooms_of_ours() -> dict:
    return draw_architecture.rooms(ROOT)


@cache
def python_files() -> list[str]:
    """Paths of the project's Python files, environments aside."""
    return [path.relative_to(ROOT).as_posix() for top in ROOT.iterdir()
            if top.is_dir() and top.name[0] != "." for path in top.rglob("*.py")]


@pytest.mark.parametrize("page", PAGES)
def test_files_that_are_named_exist(page):
    """`tests/test_x.py`, or the end of a path, as `tracer/path.py`."""
    for code in CODE.findall(PAGES[page].read_text("utf-8")):
        for name in re.findall(r"[\w./]+\.py\b", code):
            if name not in UNKNOWN:
                assert any(f"/{file}".endswith(f"/{name}") for file in python_files()), (page, name)


def test_the_readme_is_one_page():
    assert len((ROOT / "README.md").read_bytes()) <= 6000


@pytest.mark.parametrize("page", having("python"))
def test_python_blocks_run(page, folder, call):
    names: dict = {"__name__": "page"}
    module = ModuleType("page")  # a dataclass looks its module up
    sys.modules["page"] = module
    try:
        for number, (info, code) in enumerate(blocks(page, "python"), 1):
            compiled = compile(code, f"{page}, Python block {number}", "exec")
            if info and find_spec(info) is None:  # a package that this block needs
                continue
            exec(compiled, names)
            if "class MyFilter" in code:
                Path("my_filter.py").write_text(code)
                call("render", "box", "--frames", "0:1", "--size", "16x9", "--out", "data/box")
                done, _, err = call("denoise", "data/box", "--method", "my_filter.py")
                assert done == 0, err
            if "def scene(" in code:
                Path("my_scene.py").write_text(code)
                code, out, err = call("render", "my_scene.py", "--frames", "0:1", "--size", "16x9",
                                      "--out", "data/mine")
                assert (code, out) == (0, "rendered 1 frames into data/mine\n"), err
    finally:
        del sys.modules["page"]


@pytest.mark.parametrize("page", having("sh", "costly"))
def test_cheap_commands_run(page, folder, call):
    for info, text in blocks(page, "sh"):
        if "costly" not in info.split():
            for words in command_lines(text):
                assert words[0] == "onespp", f"{page}: mark the block as costly"
                code, _, err = call(*words[1:])
                assert code == 0, f"{page}: {' '.join(words)}: {err}"


def command_lines(text: str) -> list[list[str]]:
    """The words of each command of a shell block."""
    found: list[list[str]] = []
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        while words:
            end = words.index("&&") if "&&" in words else len(words)
            found.append(words[:end])
            words = words[end + 1:]
    return found


@pytest.mark.parametrize("page", having("sh"))
def test_every_command_line_parses(page):
    for _, text in blocks(page, "sh"):
        for words in command_lines(text):
            check_command(words)


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_the_text_are_there(page):
    """`onespp score --by-cause` may lack its arguments, but names a command and its options."""
    text = BLOCK.sub("", PAGES[page].read_text("utf-8"))
    options = {o for command in (*map(at, known_commands()), results.results)
               for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
    for code in CODE.findall(text):
        words = shlex.split(code) if "'" not in code and '"' not in code else code.split()
        if words[0] == "onespp" and len(words) > 1:
            command, rest = find(words[1:])
            own = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
            assert {w for w in rest if w.startswith("--")} <= own, f"{page}: {code}"
        elif words[0].startswith("--"):
            assert {w for w in words if w.startswith("--")} <= options, f"{page}: {code}"
        elif words[0] in ("make", "python", "pytest"):
            check_command(words)
        check_settings(words)


def known_commands() -> list[str]:
    return [path for path, _ in from_code.walk(onespp.cli.app)]


def at(path: str) -> click.Command:
    return find(path.split())[0]


def find(words: list[str]) -> tuple[click.Command, list[str]]:
    """The command that words begin with, and the words behind it."""
    for length in (2, 1):
        path = " ".join(words[:length])
        found = dict(from_code.walk(onespp.cli.app)).get(path)
        if found is not None:
            return found, words[length:]
    raise AssertionError(f"there is no command 'onespp {' '.join(words)}'")


def check_command(words: list[str]) -> None:
    """Fails unless a command line would be understood."""
    program, *rest = words
    program = program.rpartition("/")[2]
    if program == "python" and rest[:1] == ["-m"]:
        program, *rest = rest[1:]
        if (ROOT / program.replace(".", "/")).with_suffix(".py").is_file():
            return
    if program == "find" and "-exec" in rest:
        check_command(rest[rest.index("-exec") + 1:-1])
    elif program == "onespp" and rest:
        command, rest = find(rest)
        parse(command, rest)
        if command.name != "dataset":  # those are of a plan
            check_settings(rest)
    elif program == "make":
        targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M)
        assert {w for w in rest if "=" not in w} <= set(targets), words
    elif program == "python" and rest[0] == "docs/results.py":
        parse(results.results, rest[1:])
    elif program == "python" and rest[0] == "docs/ladder.py":
        parse(ladder.ladder, rest[1:])
    elif program in ("python", "pytest"):
        assert all((ROOT / w).is_file() for w in rest if w.endswith(".py")), words
    else:
        assert program in {"onespp", *FOREIGN}, words


def parse(command: click.Command, words: list[str]) -> None:
    try:
        command.make_context("onespp", list(words))
    except click.exceptions.Exit:
        pass
    except click.UsageError as error:
        raise AssertionError(f"{words}: {error.format_message()}") from None


def check_settings(words: list[str]) -> None:
    """Parameters of `--set` are a method's: the one that is named, or any."""
    settings = pairs(b for a, b in pairwise(words) if a == "--set")
    named = [b for a, b in pairwise(words) if a == "--method"]
    if any(is_file(name) and not (ROOT / name).exists() for name in named):
        return  # the reader's
    named = [str(ROOT / name) if is_file(name) else name for name in named]
    for key, value in settings.items():
        able = [name for name in named or METHODS if key in parameters(build(name))]
        assert able, f"no method has the parameter {key}"
        build(able[0], {key: value})


def test_a_misspelt_command_line_is_noticed():
    lines = ("onespp scor data/room", "onespp score --pictuers data/room", "make dmeo",
             "onespp denoise data/room --set levls=3", "python docs/results.py --spp 3")
    for line in lines:
        with pytest.raises(AssertionError):
            check_command([str(word) for word in line.split()])


@pytest.mark.parametrize("name", [*METHODS, "outliers"])
def test_every_parameter_is_documented_and_its_range_holds(name):
    method = RemoveOutliers() if name == "outliers" else build(name)
    for p in from_code.parameters(method):
        assert p.about, f"{name}.{p.name} is not among the Attributes"
        inside, outside = bounds(p.range)
        kind = type(p.default)
        for value in inside:
            changed(name, p.name, kind(value))
        for value in outside:
            with pytest.raises(InputError, match=p.name):
                changed(name, p.name, kind(value))


# Parameters that bound one another: what the other one must be for the ends of the range.
COUPLED = {"innovation_levels": {"sharp_innovation_levels": "2"},
           "output_levels": {"sharp_output_levels": "1"},
           "sharp_innovation_levels": {"innovation_levels": "8"},
           "sharp_output_levels": {"output_levels": "8"}}


def changed(name: str, parameter: str, value: float) -> None:
    """InputError if the method, or the stage before it, refuses the value."""
    if name == "outliers":
        replace(RemoveOutliers(), **{parameter: value})
    else:
        build(name, {**COUPLED.get(parameter, {}), parameter: str(value)})


def bounds(range_: str) -> tuple[list[float], list[float]]:
    """Values on the edge of a range, and values just outside of it."""
    if between := re.fullmatch(r"(\S+) to (\S+)", range_):
        low, high = map(float, between.groups())
        off = 1.0 if low == int(low) and high == int(high) else 0.5 * low
        return [low, high], [low - off, high + off]
    if above := re.fullmatch(r"above (\S+)", range_):
        least = float(above[1])
        return [least + 1e-3], [least]
    return [], []


def modules() -> list[ModuleType]:
    """Those whose public examples run: of the methods and of the metrics."""
    things = [*METHODS.values(), RemoveOutliers, *(m.function for m in MEASURES.values()),
              srgb_from_linear]
    return [sys.modules[name] for name in dict.fromkeys(t.__module__ for t in things)]


def test_examples_of_docstrings_run():
    frame = noisy(make_frame(12, 16))
    runner, finder = doctest.DocTestRunner(), doctest.DocTestFinder()
    examples = {test.name: test for module in modules()
                for test in finder.find(module, extraglobs={"frame": frame}) if test.examples}
    for test in examples.values():
        runner.run(test)
    assert runner.summarize().failed == 0
    assert len(examples) >= 15


def test_every_block_of_results_has_a_part_and_every_part_a_block():
    for path in (ROOT / "README.md", DOCS / "results.md", DOCS / "methods.md"):
        found = re.findall(r"<!-- results:([\w-]+) -->", path.read_text("utf-8"))
        assert found == [name for name, (where, _) in results.PARTS.items() if where == path]


def test_the_ladder_is_what_its_command_writes_but_for_the_numbers(tmp_path):
    ladder.ladder.main(["--frames", "0:2", "--size", "24x24", "--reference-spp", "4",
                        "--rounds", "1", "--data", str(tmp_path / "data"), "--out", str(tmp_path)],
                       standalone_mode=False)
    number = re.compile(r"\d[\d.:]*(?:e[+-]\d+)?")
    made, kept = (number.sub("#", (folder / "ladder.md").read_text("utf-8"))
                  for folder in (tmp_path, DOCS))
    assert made == kept
    names = {path.name for path in (tmp_path / "ladder").iterdir()}
    assert names == {path.name for path in (DOCS / "ladder").iterdir()}
    assert names == {"input.jpg", "scale.jpg", *(f"{rung.method}.jpg" for rung in ladder.RUNGS)}
    assert sum(path.stat().st_size for path in (DOCS / "ladder").iterdir()) < 150_000


@pytest.fixture(scope="module")
def scores(tmp_path_factory) -> Scores:
    return score(make_report_sequence(tmp_path_factory.mktemp("made") / "made"))


@pytest.fixture
def plan(tmp_path, scores) -> results.Plan:
    """A plan whose scenes were rendered and scored already."""
    plan = results.Plan("0:4", {"made": "48x32"}, 256, 8, 8, 0, ("cut",), tmp_path, False)
    plan.__dict__["ours"] = {"made": scores}
    plan.__dict__["pairs"] = {"made": (scores, scores)}
    plan.__dict__["others"] = {"a scene": scores}
    return plan


def test_tables_hold_the_scores_and_what_they_stand_on(plan):
    scores = plan.pairs["made"][1]
    noisy_db, floor = scores.methods["input"]["psnr_srgb"], scores.reference_floor_db
    stands_on = (f"`made`: frames 0:4 at 48x32, reference 256 spp (noise floor {floor:.1f} dB), "
                 f"seed 7, input {noisy_db:.2f} dB")
    for make in (results.summary, results.all_scores, results.others):
        assert stands_on in make(plan)
        assert "clipped sRGB" in make(plan)
        assert f"| {noisy_db:.2f} " in make(plan)


def test_writing_replaces_one_block_and_no_more():
    page = "a\n<!-- results:x -->\nold\n<!-- /results -->\nb\n<!-- results:y -->\n<!-- /results -->"
    new = results.block("x", "new \\1", "make results")
    assert results.replaced(page, "x", new) == page.replace(
        "<!-- results:x -->\nold\n<!-- /results -->", new)
    with pytest.raises(InputError, match="results:z"):
        results.replaced(page, "z", new)


def with_decibels(scores: Scores, decibels: dict[str, list[float | None]]) -> Scores:
    """Scores of methods that have these PSNRs, a frame each, and their mean."""
    like, made = scores.methods["fine"].model_dump(), {INPUT: scores.methods[INPUT]}
    for name, values in decibels.items():
        made[name] = MethodScore.model_validate({
            **like, "psnr_srgb": np.mean([v for v in values if v is not None]),
            "per_frame": [{**row, "psnr_srgb": v} for row, v in zip(like["per_frame"], values)]})
    return scores.model_copy(update={"methods": made})


@pytest.fixture
def measured(plan, scores) -> results.Plan:
    """A plan that has all that the page of the methods shows."""
    plan.__dict__["light"] = {
        f"generated/{i}": with_decibels(scores, {"gaussian": [i], "svgf": [2 * i]})
        for i in (12, 14, 22)}
    plan.__dict__["hard_scores"] = {
        "cut": with_decibels(scores, {"gaussian": [10, 10], "atrous": [30, 30], "svgf": [30, 20],
                                      "oidn-high": [None, 50]}),
        "thin": with_decibels(scores, {"gaussian": [15, 15], "atrous": [20, 38], "svgf": [40, 40],
                                       "oidn-high": [60, 60]})}
    return plan


def test_a_failure_is_where_a_method_is_farthest_behind_the_mean_of_ours(measured):
    # Means of ours: of cut 65/3, its frames 70/3 and 20; of thin 28, its frames 25 and 31.
    assert {name: (f.scene, f.frame) for name, f in measured.worst.items()} == {
        "gaussian": ("thin", 1), "atrous": ("thin", 0), "svgf": ("cut", 1), "oidn-high": ("cut", 1)}
    found = measured.worst["atrous"]
    assert (found.lead, found.psnr, found.mean) == (1, 20, 25)
    assert found.usual == pytest.approx((1 + 30 - 65 / 3) / 2)
    said = " ".join(results.what_fails(measured).split())
    assert "13.0 dB behind the mean of our methods, 12.3 dB behind it over all scenes" in said


def test_the_table_of_all_methods_says_source_worth_and_failure(measured):
    rows = {line.split(" | ")[0]: line for line in results.methods(measured).splitlines()}
    assert list(rows)[2] == "| input, 1 spp"
    assert rows["| `svgf`"].startswith("| `svgf` | [Schied et al. 2017](https://doi.org/10.1145/"
                                       "3105762.3105770) | 32.00 |")
    assert rows["| `svgf`"].endswith("| `cut`, frame 1 |")
    assert "3 scenes, `generated/12` to `generated/22`" in results.methods(measured)


def test_targets_are_judged_on_the_sequences_of_the_other_tables(measured, scores, monkeypatch):
    def ahead(by):
        return with_decibels(scores, {**{form: [30, 30] for form in OIDN_FORMS},
                                      "onespp": [30 + by, 30 + by]})

    made = {"ours": {"box": ahead(3), "room": ahead(1)}, "light": {"generated/12": ahead(2)},
            "hard_scores": {"cut": ahead(4)}}
    measured.__dict__.update(made)
    monkeypatch.setattr(results, "plain_copy", lambda sequence, folder: (sequence, folder))
    monkeypatch.setattr(results.FrameSequence, "open", lambda folder: folder)
    monkeypatch.setattr(results, "all_methods", lambda _: {})
    monkeypatch.setattr(results, "scores_of", lambda copied: ahead(5) if copied == (
        measured.data / copied[0].relative_to(measured.data),
        measured.data / "plain" / copied[0].relative_to(measured.data)) else None)
    said = results.targets(measured)
    for row in ("| box: least lead | +2.5 dB | +3.00 dB | held |",
                "| room: least lead | +2.0 dB | +1.00 dB | **missed** |",
                "| kept scenes: mean lead | +2.0 dB | +2.00 dB | held |",
                "| hard scenes: least lead | +0.0 dB | +4.00 dB | held |",
                "| plain frames: least lead | +1.0 dB | +5.00 dB (`box`) | held |"):
        assert row in said


def test_every_method_names_its_source_or_is_ours():
    own = {name for name in METHODS if from_code.cited(name) == "ours"}
    assert own == {name for name in METHODS if name.startswith("onespp")}
    assert all(re.search(r"GAMES202| \d{4}\b", from_code.cited(m)) for m in {*METHODS} - own)


def test_the_picture_of_a_failure_is_of_the_place_where_others_do_better(tmp_path, monkeypatch):
    monkeypatch.setattr(failures, "WINDOW", (12, 16))
    sequence = make_report_sequence(tmp_path / "hard/cut", 1)
    wrong = sequence.read_reference(0).color.copy()
    wrong[20:, 32:] = 9  # by both, and farther off, since it is dark there
    sequence.write_result("rough", 0, wrong)
    wrong[:12, :16] = 9
    sequence.write_result("fine", 0, wrong)
    data = failures.picture(sequence, "fine", 0, ["rough"])
    shown = np.asarray(Image.open(io.BytesIO(data)), float)[::failures.SCALE, ::failures.SCALE]
    image, reference, error = np.split(shown, 3, axis=1)
    assert image.shape == (12, 16, 3)
    assert image.min() > 240 > reference.mean() > 130
    assert error.mean() > 100


def test_pictures_of_failures_are_those_that_the_page_shows():
    shown = re.findall(r'src="failures/([\w-]+).jpg"', PAGES["methods.md"].read_text("utf-8"))
    files = [*(DOCS / "failures").glob("*")]
    assert {path.name for path in files} == {f"{name}.jpg" for name in shown}
    assert sum(path.stat().st_size for path in files) < 400_000


def test_the_commands_that_are_printed_under_tables_parse(plan):
    two = replace(plan, sizes={"box": "48x32", "room": "48x32"})
    for name in results.PARTS:
        check_command(shlex.split(results.own_command(name, two)))


@pytest.mark.slow
def test_results_render_denoise_and_score(tmp_path, capsys):
    arguments = ["--parts", "summary,lead", "--frames", "0:2", "--box-size", "32x32",
                 "--room-size", "32x18", "--reference-spp", "4", "--data", str(tmp_path)]
    results.results.main(arguments, standalone_mode=False)
    first = capsys.readouterr()
    assert "| **`onespp`** |" in first.out
    assert "room_plain: denoise onespp" in first.err
    results.scores_in.cache_clear()
    results.results.main(arguments, standalone_mode=False)
    again = capsys.readouterr()
    assert again.out == first.out
    assert "denoise" not in again.err


def test_peers_are_listed():
    assert all(f"`{name}`" in from_code.peers() for name in PEERS)
