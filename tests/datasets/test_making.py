"""Data sets made, stopped and gone on with, shared between processes, damaged, and looked at."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import onespp
from onespp.api.datasets import preview
from onespp.datasets import look, making
from onespp.datasets.folder import DataSet, DataSetFile, Made
from onespp.datasets.plan import Plan, changed_plan, read_plan
from onespp.render.channels import TRACING
from onespp.render.errors import InputError
from onespp.render.files.frame_ranges import part_of
from onespp.render.files.json_file import read_json
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence
from onespp.scenes.description import Camera
from onespp.scenes.drawn.draw import DRAWING, Drawn, draw


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def copy(made, tmp_path) -> DataSet:
    """A copy of the small data set that a test may change."""
    shutil.copytree(made.folder, tmp_path / "copy")
    return DataSet.open(tmp_path / "copy")


@pytest.fixture
def plan() -> Plan:
    return read_plan("simple", {"sequences": 3, "frames": 2, "height": 16, "width": 24})


@pytest.fixture
def quick(monkeypatch, plan, tmp_path):
    """An empty data set whose sequences are made of nothing, at once; and those made, in order."""
    data, order = DataSet.create(tmp_path / "quick", plan, {}), []

    def make(data: DataSet, number: int, progress=None) -> Made:
        with writing(data.place(number), "sequence"):
            order.append(number)
            return data.finish_sequence(number, "f", draw(plan.request(number)).record, [])

    monkeypatch.setattr(making, "make", make)
    return data, order


def test_a_data_set_is_whole_and_says_what_was_drawn(made):
    assert made.numbers() == [0, 1]
    assert made.numbers("validation") == [1]
    assert made.verify() == []
    assert made.status().left == 0
    found = made.made(1)
    assert found.draw["camera"] == "orbit"
    assert found.fingerprint == made.sequence(1).manifest.fingerprint
    listed = read_json(made.folder / "dataset.json", DataSetFile).sequences
    assert {n: e.digest for n, e in listed.items()} == {n: made.made(n).digest for n in (0, 1)}
    card = (made.folder / "README.md").read_text()
    assert "| validation | 1 | 3 |" in card
    assert found.digest[:16] in card


def test_renders_of_a_frame_share_its_reference_but_no_noise(made):
    one, two = made.sequence(0, 0), made.sequence(0, 1)
    assert one.has_reference(2)
    assert not two.has_reference(2)
    a, b = one.read_frame(1), two.read_frame(1)
    assert np.array_equal(a["depth"], b["depth"])
    assert not np.array_equal(a["color"], b["color"])


def test_what_is_missing_is_made_again_to_the_same_bytes(made, copy):
    whole = files(copy.folder)
    (copy.place(0) / "sequence.json").unlink()
    (copy.place(0) / "seed1/frames/0001.exr").unlink()
    (copy.place(0) / "seed0/reference/0002.exr").unlink()
    onespp.dataset(copy.plan, copy.folder)
    assert files(copy.folder) == whole


def test_a_byte_that_changed_and_a_sequence_that_is_gone_are_found(copy, call):
    path = copy.place(0) / "seed0/frames/0001.exr"
    data = bytearray(path.read_bytes())
    data[-20] ^= 1
    path.write_bytes(data)
    (copy.place(1) / "sequence.json").unlink()
    wrong = copy.verify()
    assert len(wrong) == 2
    assert "lacks 1 of 2 sequences (1)" in wrong[0]
    assert wrong[1].startswith(f"{path} is not as it was written")
    code, out, err = call("dataset", "--verify", copy.folder)
    assert (code, str(path) in out) == (2, True)
    assert "is not whole: 2 things are wrong" in err
    assert "1 of 2 sequences are made" in call("dataset", "--status", "--out", copy.folder)[1]


def test_a_sequence_that_fails_is_tried_twice_and_does_not_stop_the_others(monkeypatch, quick):
    data, _ = quick
    works, tried = making.make, []

    def make(data: DataSet, number: int, progress=None) -> Made:
        tried.append(number)
        if number == 1:
            raise ValueError("no luck")
        return works(data, number)

    monkeypatch.setattr(making, "make", make)
    monkeypatch.setattr(making, "make_alone", make)
    told: list[str] = []
    outcome = making.make_all(data, range(3), tell=told.append)
    assert tried == [0, 1, 2, 1]
    assert (outcome.made, outcome.failed) == ([0, 2], {1: "no luck"})
    assert told == ["sequence 1 failed and gets a second try: no luck"]
    assert data.failed() == data.status().failed == [1]
    assert (data.folder / "failures/000001.txt").read_text().count("ValueError: no luck") == 2
    monkeypatch.setattr(making, "make", works)
    assert making.make_all(data, range(3)).made == [0, 2, 1]
    assert data.failed() == []


@pytest.mark.slow
def test_where_memory_ran_out_a_process_of_its_own_makes_the_same_bytes(made, copy, monkeypatch):
    whole = files(copy.folder)
    for path in (copy.place(1) / "sequence.json", *copy.place(1).glob("seed*/frames/0002.exr")):
        path.unlink()

    def make(data: DataSet, number: int, progress=None) -> Made:
        raise MemoryError

    monkeypatch.setattr(making, "make", make)
    told: list[str] = []
    outcome = making.make_all(copy, range(2), tell=told.append)
    assert (outcome.made, outcome.failed) == ([0, 1], {})
    assert told == ["sequence 1 failed and gets a second try: MemoryError()"]
    copy.finish()
    assert files(copy.folder) == whole


@pytest.mark.slow
def test_a_process_that_the_system_kills_ends_nothing_else(monkeypatch, quick):
    """The process is this Python, told to kill itself in the middle of a call."""
    data, _ = quick
    monkeypatch.setattr(making, "_MADE_BY", "tests.datasets.test_making:killed")
    works = making.make

    def make(data: DataSet, number: int, progress=None) -> Made:
        if number == 1:
            raise MemoryError
        return works(data, number)

    monkeypatch.setattr(making, "make", make)
    outcome = making.make_all(data, range(3))
    assert outcome.made == [0, 2]
    assert outcome.failed == {1: "its process was killed, as systems do where memory runs out"}
    assert data.failed() == [1]


def killed(folder: str, number: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_full_disk_ends_it(monkeypatch, quick):
    data, _ = quick

    def full(data: DataSet, number: int, progress=None) -> Made:
        raise InputError("the disk is full") from OSError(28, "No space left on device")

    monkeypatch.setattr(making, "make", full)
    with pytest.raises(InputError, match="the disk is full"):
        making.make_all(data, range(3))


def test_a_sequence_that_another_process_makes_is_left_to_it(quick):
    data, order = quick
    code = ("import sys\nfrom pathlib import Path\nfrom onespp.render.files.lock import writing\n"
            "with writing(Path(sys.argv[1]), 'sequence'):\n    print('held', flush=True)\n"
            "    sys.stdin.read()")
    with subprocess.Popen([sys.executable, "-c", code, str(data.place(0))], text=True,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == "held\n"
        outcome = making.make_all(data, range(3))
        assert (order, outcome.elsewhere) == ([1, 2], [0])
        other.kill()  # as a machine that is switched off
    assert making.make_all(data, range(3)).elsewhere == []
    assert order == [1, 2, 0]


def test_parts_make_all_between_them():
    parts = [part_of(range(7), f"{k}/3") for k in (1, 2, 3)]
    assert sorted(n for part in parts for n in part) == [*range(7)]
    for part in ("0/3", "4/3", "1", "a/b"):
        with pytest.raises(InputError, match="use K/N"):
            part_of(range(7), part)


@pytest.mark.parametrize(("line", "words"), [
    (f'  "drawing": {DRAWING},\n', "scenes that another version of onespp drew"),
    (f'  "tracing": {TRACING},\n', "frames that another version of onespp rendered")])
def test_what_another_version_draws_or_renders_is_not_mixed_in(plan, tmp_path, line, words):
    """A file that does not say which is of the first."""
    DataSet.create(tmp_path / "d", plan, {})
    path = tmp_path / "d/dataset.json"
    text = path.read_text()
    assert line in text
    path.write_text(text.replace(line, ""))
    with pytest.raises(InputError, match=words):
        DataSet.create(tmp_path / "d", plan, {})


def test_frames_of_another_version_among_the_others_are_found(copy):
    path = copy.place(1) / "seed0/manifest.json"
    path.write_text(path.read_text().replace(f'"tracing": {TRACING}', f'"tracing": {TRACING + 1}'))
    (said,) = copy.verify()
    assert said.startswith(f"{path.parent} was rendered by another version of onespp")
    for old in (copy.folder / "dataset.json", *copy.folder.glob("*/*/seed*/manifest.json")):
        text = "".join(line for line in old.read_text().splitlines(True) if "tracing" not in line)
        old.write_text(text)
    assert copy.verify() == []  # all of the first


def test_a_folder_holds_one_data_set_which_may_grow(quick, plan, tmp_path):
    data, _ = quick
    assert DataSet.create(data.folder, changed_plan(plan, {"sequences": 2}), {}).plan == plan
    more = changed_plan(plan, {"sequences": 9})
    assert DataSet.create(data.folder, more, {}) == DataSet.open(data.folder)
    with pytest.raises(InputError, match=r"another plan \(draw.things is \[5, 9\] there"):
        DataSet.create(data.folder, changed_plan(plan, {"draw.things": [5, 8]}), {})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/letter.txt").write_text("x")
    with pytest.raises(InputError, match="no data set"):
        DataSet.create(tmp_path / "mine", plan, {})
    with pytest.raises(InputError, match="is not a data set"):
        DataSet.open(tmp_path / "mine")


def test_the_command_says_what_was_made_and_what_was_not(quick, call, monkeypatch, tmp_path):
    command = ("dataset", "simple", "--sequences", 2, "--size", "24x16", "--frames", 2, "--out",
               tmp_path / "d", "--set", "draw.things=[3, 4]", "--reference-error", 0.5)
    code, out, err = call(*command)
    assert (code, out) == (0, f"{tmp_path / 'd'}: 2 of 2 sequences are made (0.0 MiB)\n"), err
    plan = DataSet.open(tmp_path / "d").plan
    assert (plan.width, plan.height, plan.draw.things) == (24, 16, (3, 4))
    assert (plan.reference_spp, plan.reference_error) == (None, 0.5)
    (tmp_path / "d/train/000000/sequence.json").unlink()

    def fails(*arguments):
        raise ValueError("no luck")

    monkeypatch.setattr(making, "make", fails)
    monkeypatch.setattr(making, "make_alone", fails)
    code, out, err = call(*command)
    assert code == 2
    assert "sequence 0 failed twice (no luck)" in out
    assert "1 of 2 sequences could not be made" in err
    for wrong, words in (((), "there is no PLAN"), (("roms",), "did you mean 'rooms'"),
                         (("rooms", "--set", "draw.thing=1"), "unknown key 'draw.thing'"),
                         (("rooms", "--part", "3/2", "--out", tmp_path / "d"), "use K/N")):
        code, _, err = call("dataset", *wrong)
        assert (code, words in err) == (2, True), err


def test_a_preview_shows_the_first_scenes(made, tmp_path):
    lines = preview(made.plan, 1, tmp_path / "sheet.png")
    assert [line.split()[:2] for line in lines] == [["0", "train"]]
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    first, gap = sheet[4:20, 4:28], sheet[:4]
    assert gap.std() == 0
    assert first.std() > 5


@pytest.fixture(scope="module")
def drawn() -> Drawn:
    return draw(read_plan("simple", {"frames": 2}).request(0))


def test_a_camera_in_a_thing_is_noticed(drawn):
    name = drawn.things[0]
    shape = next(s for s in drawn.scene.shapes if s.name == name)
    there = np.eye(4)
    there[:3, 3] = (shape.world_from_object_at(0) @ (0, 0.1, 0, 1))[:3]
    scene = replace(drawn.scene, camera=Camera(there))
    assert look.inside(drawn, [0, 1]) is None
    assert look.inside(replace(drawn, scene=scene), [0]) == f"the camera is in {name}"


@pytest.mark.parametrize(("change", "words"), [
    ({}, None), ({"color": 1e-4}, "is dark"), ({"color": np.nan}, "is dark"),
    ({"color": 9.0}, "is blown"), ({"depth": 0.3}, "something is in front"),
    ({"id": -1}, "shows no things"), ({"lamps": 2}, "a lamp is in front")])
def test_frames_with_nothing_to_see_are_noticed(drawn, change, words):
    thing, lamp = (drawn.scene.object_names.index(name) for name in (
        drawn.things[0], drawn.record["lamps"][0]["name"]))
    values = {"color": 0.2, "depth": 3.0, "id": thing, "lamps": 0, **change}
    seen = look.Seen(1, np.full((16, 16, 3), values["color"]), np.full((16, 16), values["id"]),
                     np.full((16, 16), values["depth"]))
    seen.id[:values["lamps"]] = lamp
    why = look.unlike_a_picture(drawn, [seen])
    assert why is None if words is None else words in (why or "")


def test_noise_does_not_make_a_frame_dark():
    noisy = np.random.default_rng(1).gamma(0.05, 4.0, (64, 64, 1)) * np.ones(3)
    assert look.displayed(noisy) > 0.8 * look.displayed(np.full((64, 64, 3), 0.2))


def test_a_draw_that_is_rejected_is_drawn_again(monkeypatch, plan):
    said = iter(["frame 0 is dark", None])
    monkeypatch.setattr(look, "unlike_a_picture", lambda drawn, frames: next(said))
    found = look.usable(plan, 0)
    assert (found.drawn.record["attempt"], found.rejected) == (1, ["frame 0 is dark"])
    monkeypatch.setattr(look, "unlike_a_picture", lambda drawn, frames: "frame 0 is dark")
    monkeypatch.setattr(look, "MOST_ATTEMPTS", 2)
    with pytest.raises(InputError, match="none of 2 draws of sequence 0 of 'simple'"):
        look.usable(plan, 0)


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 2 MiB."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = ["mount", "-t", "tmpfs", "-o", "size=2m", "onespp-test", str(place)]
    if shutil.which("mount") is None or subprocess.run(mounted, capture_output=True).returncode:
        pytest.skip("this process may not mount a file system")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.slow
def test_a_disk_that_fills_leaves_whole_files_and_is_gone_on_with(made, small_disk):
    """A real one, full but for what a sequence and a half takes; then there is room again."""
    ballast = small_disk / "ballast"
    took = sum(len(text) for text in files(made.place(0)).values())
    free = os.statvfs(small_disk)
    ballast.write_bytes(bytes(free.f_bavail * free.f_frsize - 3 * took // 2))
    with pytest.raises(InputError, match="because the disk is full"):
        onespp.dataset(made.plan, small_disk / "set")
    data = DataSet.open(small_disk / "set")
    assert data.status().left > 0
    for path in data.folder.rglob("frames/*.exr"):
        FrameSequence.open(path.parents[1]).read_frame(int(path.stem))
    ballast.unlink()
    assert onespp.dataset(made.plan, data.folder).verify() == []
    assert files(data.folder) == files(made.folder)
