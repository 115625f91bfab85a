"""How fast clips are read: which are, by whom, and what the command prints of it."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest

from onespp.clips import clips as clips_module
from onespp.clips import speed
from onespp.clips.store import Store
from onespp.render.errors import InputError

OPTIONS: dict[str, Any] = {"frames": 1, "crop": 16}


def test_processes_read_different_clips_and_decoding_makes_none(made, monkeypatch):
    read, decoded = [], []
    item, images = clips_module.Clips.__getitem__, Store.images
    monkeypatch.setattr(clips_module.Clips, "__getitem__",
                        lambda self, i: read.append(i) or item(self, i))
    assert speed.read(str(made.folder), OPTIONS, "clips", 1, 2, time.time(), 1e-9) > 0
    assert read == [1, 1]  # to be warm, and one that counts
    assert speed.read(str(made.folder), OPTIONS, "clips", 0, 2, time.time(), 0.05) > 0
    assert read[3:6] == [0, 2, 1]  # of three
    read.clear()
    monkeypatch.setattr(Store, "images", lambda *a: decoded.append(a[3:]) or images(*a))
    assert speed.read(str(made.folder), {**OPTIONS, "frames": 2}, "decoded", 0, 1, 0.0, 1e-9) > 0
    assert read == []
    assert [i for i, _ in decoded] == [0, 1, 0, 1]
    assert {*decoded[0][1]} == {"albedo", "color", "depth", "id", "normal", "reference"}


def test_speeds_of_processes_are_added_and_shown(made, monkeypatch, call):
    def calls(function, arguments, processes, look):
        assert function == "onespp.clips.speed:read"
        assert processes == len(arguments)
        yield from ((k, {"decoded": 3.0, "clips": 2.0}[a[2]]) for k, a in enumerate(arguments))

    monkeypatch.setattr(speed, "calls", calls)
    code, out, err = call("bench", "clips", made.folder, "--frames", 2, "--crop", 16)
    assert code == 0, err
    assert out.split() == ["workers", "decoded/s", "clips/s", "1", "3.00", "2.00", "2", "6.00",
                           "4.00", "4", "12.00", "8.00"]
    found = json.loads(call("bench", "clips", made.folder, "--frames", 2, "--crop", 16,
                            "--workers", 3, "--json", "-")[1])
    assert found == [{"processes": 3, "decoded": 9.0, "clips": 6.0}]
    for wrong, words in (((made.folder.parent,), "is not a data set"),
                         ((made.folder, "--frames", 99), "frames is 99"),
                         ((made.folder, "--frames", 2, "--crop", 16, "--seconds", 0), "more than")):
        code, _, err = call("bench", "clips", *wrong)
        assert (code, words in err) == (2, True), err


@pytest.mark.slow
def test_real_processes_read_at_once(made):
    one, two = speed.speeds(made.folder, (1, 2), 0.3, **OPTIONS)
    assert (one.processes, two.processes) == (1, 2)
    assert min(one.clips, one.decoded, two.clips, two.decoded) > 0
    with pytest.raises(InputError, match="lacks the channel 'uv'"):
        speed.speeds(made.folder, (1,), 0.3, **OPTIONS, channels=("uv",))
