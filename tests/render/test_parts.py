"""A sequence rendered by several processes at once is that of one."""

from __future__ import annotations

import pytest

import onespp
from onespp import InputError
from onespp.render.files.lock import Busy, writing, writing_share

from .tracer.test_renderer import small_scene


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*") if path.is_file() and path.name != "manifest.json"}


def test_parts_may_be_rendered_at_once_and_the_whole_checks_them(tmp_path):
    options = {"frames": 3, "size": (8, 12), "reference_spp": 4}
    scene, folder = small_scene(), tmp_path / "parts"
    onespp.render(scene, tmp_path / "whole", **options)
    with writing_share(folder, "render", "1-of-2"):  # as another process that renders its part
        onespp.render(scene, folder, part="2/2", **options)
        for arguments in ({}, {"part": "1/2"}):
            with pytest.raises(Busy, match="is being written by another"):
                onespp.render(scene, folder, **options, **arguments)
    there = {path.stem for path in folder.rglob("*.exr")}
    assert there == {"0001"}
    onespp.render(scene, folder, part="1/2", **options)
    with writing(folder, "render"), pytest.raises(Busy):
        onespp.render(scene, folder, part="1/2", **options)
    (folder / "reference/0001.exr").unlink()
    whole = onespp.render(scene, folder, **options)
    assert whole.manifest.reference_spp == 4
    assert files(folder) == files(tmp_path / "whole")


@pytest.mark.parametrize(("options", "words"), [
    ({"part": "3/3"}, "has none: use fewer parts"), ({"part": "2"}, "use K/N"),
    ({"part": "1/2", "overwrite": True}, "does not go with part"),
    ({"part": "1/2", "reference_error": 0.1}, "looks at all frames")])
def test_parts_that_cannot_be_are_refused(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        onespp.render(small_scene(), tmp_path / "s", frames=2, size=(8, 12), **options)
    assert not (tmp_path / "s").exists()


def test_the_command_says_which_part_is_there(tmp_path, call):
    options = ("box", "--frames", "0:2", "--size", "12x9", "--out", tmp_path / "box")
    code, out, err = call("render", *options, "--part", "2/2")
    assert (code, out) == (0, f"rendered part 2/2 of 2 frames into {tmp_path / 'box'}\n"), err
    assert sorted(p.name for p in (tmp_path / "box/frames").glob("*.exr")) == ["0001.exr"]
