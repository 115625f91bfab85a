"""What a file is never written over, and names that are none."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import pytest

from onespp.render.errors import InputError
from onespp.render.files.atomic import write_bytes


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pipes with names")
@pytest.mark.parametrize("through_a_link", [False, True])
def test_a_device_or_a_pipe_is_not_replaced_by_a_file(tmp_path, through_a_link):
    """`--json /dev/null`, as root, put a file in the place of the machine's /dev/null."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    path = pipe
    if through_a_link:  # as /dev/stdout is
        path = tmp_path / "link"
        path.symlink_to(pipe)
    before = path.lstat().st_ino
    with pytest.raises(InputError, match="is a device or a pipe: give the name of a file"):
        write_bytes(path, b"x")
    assert path.lstat().st_ino == before
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert len(list(tmp_path.iterdir())) == 1 + through_a_link


@pytest.mark.parametrize("name", ["", ".", Path.cwd().anchor])
def test_a_folder_without_a_name_is_no_file(name):
    with pytest.raises(InputError, match="no name for a file"):
        write_bytes(Path(name), b"x")
