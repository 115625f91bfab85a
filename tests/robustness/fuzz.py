"""Feeds damaged files to every reader: each must be read, or be refused in one sentence.

    python -m tests.robustness.fuzz 20000              # inputs for each reader
    python -m tests.robustness.fuzz 20000 --seed 7 exr mat

Every input is a good file with a few changes: cut off, bytes flipped, numbers replaced by hostile
ones in either byte order, pieces removed, doubled or made up; in JSON also values, keys and types.
The process may not use more than 4 GiB, and no input may take more than 10 s of computing. What
fails stays in the folder that is named.
"""

from __future__ import annotations

import argparse
import copy
import json
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from onespp.denoise.report.html import render_page
from onespp.denoise.score.compare import comparison
from onespp.denoise.score.cost import cost
from onespp.denoise.score.scorecard import read_scores
from onespp.denoise.score.sequence import measure_sequence
from onespp.render.errors import InputError
from onespp.render.files import exr
from onespp.render.files.sequence import FrameSequence, Reference
from onespp.render.files.times import read_times
from onespp.render.games202.convert import export_games202, import_games202, read_mat
from onespp.render.gltf.gltf import load_gltf
from onespp.render.references import References
from onespp.render.scene_files.mitsuba_xml import load_xml
from onespp.render.tracer.reference import SampleSums
from onespp.render.tracer.renderer import Renderer
from onespp.scenes import catalog
from onespp.scenes.description import SceneError
from tests.cli.test_command import SCENE
from tests.support.gltf_scenes import lit, moving, painted
from tests.support.report_sequence import make_report_sequence
from tests.support.small_sequence import small_sequence
from tests.support.xml_scenes import painted as painted_xml

MEMORY, SECONDS = 4 << 30, 10.0
_INTEGERS = (0, 1, -1, 2, 7, 255, 65535, 65536, 10**6, 2**31 - 1, -2**31)
_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 0.5, 1e308, -1e-320, 10**30, 2**63, float("nan"), float("inf"), "",
    "../../x", "/etc/passwd", "a" * 5000, "\ud800", "\0", "a\nb", "0:5", [], {}, [[]], [0] * 50,
    {"a": 1}, {"../x": {}}, "<script>", "{{ 7 }}")

_WORDS = ("None,", "0,", "-1", "(", ")", "float('nan')", "float('inf'),", "'../x',", "()", "[]",
          "raise ValueError('a\\nb')", "@", "translate((1, 2))", "scale(0)", "1/0", "exit()", "\0",
          "''", "10**30,", "1e400")


@dataclass(frozen=True)
class Reader:
    """`make` writes a good file into an empty folder and returns it; `read` reads it again."""

    make: Callable[[Path], Path]
    read: Callable[[Path], object]
    kind: str = "bytes"


def _exr(folder: Path) -> Path:
    return small_sequence(folder, (0,)).folder / "frames/0000.exr"


def _read_exr(path: Path) -> None:
    images, header = exr.read_exr(path)
    assert all(image.shape == (header.height, header.width) for image in images.values())
    FrameSequence.open(path.parents[1]).read_frame(0)


def _partial(folder: Path) -> Path:
    sequence = small_sequence(folder, (0,))
    _references(sequence)._save(0, SampleSums(
        tuple((np.zeros((*sequence.size, 3)), n) for n in (8, 8, 4, 4))))
    return folder / "reference/0000.partial.npz"


def _references(sequence: FrameSequence) -> References:
    return References(cast(Renderer, None), sequence, 0, False, {})


def _read_partial(path: Path) -> None:
    _references(FrameSequence.open(path.parents[1]))._saved(0)


def _reference(folder: Path) -> Path:
    sequence = small_sequence(folder, (0,))
    parts = np.random.default_rng(0).random((4, *sequence.size, 3), np.float32)
    sequence.write_reference(0, Reference.of_parts(parts, 64))
    return folder / "reference/0000.exr"


def _read_reference(path: Path) -> None:
    sequence = FrameSequence.open(path.parents[1])
    _references(sequence)._smaller(0)
    sequence.has_parts(0)
    reference = sequence.read_reference(0)
    assert reference.color.shape == reference.variance.shape == (*sequence.size, 3)


def _games202(folder: Path) -> Path:
    export_games202(make_report_sequence(folder / "s", 2), folder)
    return folder / "matrix_0.mat"


def _import(path: Path) -> None:
    import_games202(path.parent, path.parent / "out", overwrite=True)


def _scored(folder: Path) -> Path:
    sequence = make_report_sequence(folder, 2)
    (folder / "scores.json").write_text(measure_sequence(sequence).json_text())
    return folder / "scores.json"


def _read_scores(path: Path) -> None:
    scores = read_scores(path)
    render_page(FrameSequence.open(path.parent), scores, {})
    comparison(scores, scores)
    scores.csv_text()


def _run(folder: Path) -> Path:
    return make_report_sequence(folder, 2).folder / "denoised/fine/run.json"


def _read_run(path: Path) -> None:
    sequence = FrameSequence.open(path.parents[2])
    cost(sequence, sequence.read_run("fine"), None)


def _times(folder: Path) -> Path:
    sequence = make_report_sequence(folder, 2)
    quartiles, fine = [0.5, 2.0], {"radius": 2, "sigma": 0.5}
    (folder / "times.json").write_text(json.dumps({
        "size": [48, 32], "frames": 2, "steps": 4, "device": "llvm", "threads": 2, "machine": "x",
        "ratio_to": "fine", "methods": {"fine": {
            "parameters": fine, "first_ms": 3.0, "ms": 1.0, "ms_quartiles": quartiles,
            "ratio": 1.0, "ratio_quartiles": quartiles}}}))
    assert sequence.methods()
    return folder / "times.json"


def _read_times(path: Path) -> None:
    sequence = FrameSequence.open(path.parent)
    cost(sequence, sequence.read_run("fine"), read_times(path.parent))


def _scene(folder: Path) -> Path:
    (folder / "scene.py").write_text(SCENE)
    return folder / "scene.py"


def _ply(folder: Path) -> Path:
    return painted_xml(folder).with_name("ball.ply")


READERS = {
    "exr": Reader(_exr, _read_exr),
    "manifest": Reader(lambda f: small_sequence(f, (0,)).folder / "manifest.json",
                       lambda p: FrameSequence.open(p.parent), "json"),
    "matrices": Reader(lambda f: small_sequence(f, (0,)).folder / "frames/0000.json",
                       lambda p: FrameSequence.open(p.parents[1]).read_matrices(0), "json"),
    "partial": Reader(_partial, _read_partial),
    "reference": Reader(_reference, _read_reference),
    "mat": Reader(_games202, read_mat),
    "import": Reader(_games202, _import),
    "import-exr": Reader(lambda f: _games202(f).with_name("ID_0.exr"), _import),
    "run": Reader(_run, _read_run, "json"),
    "scores": Reader(_scored, _read_scores, "json"),
    "times": Reader(_times, _read_times, "json"),
    "gltf": Reader(lambda f: lit(f)[0], lambda p: load_gltf(p), "json"),
    "gltf-colors": Reader(lambda f: painted(f)[0], lambda p: load_gltf(p), "json"),
    "ply": Reader(_ply, lambda p: load_xml(p.with_name("painted.xml"))),
    "glb": Reader(lambda f: moving(f)[0], lambda p: load_gltf(p)),
    "scene": Reader(_scene, lambda p: catalog.load(str(p)), "text"),
}


def spoil(rng: np.random.Generator, data: bytes, kind: str) -> bytes:
    """Good bytes with one to four changes."""
    if kind == "json" and rng.random() < 0.6:
        return _spoil_json(rng, data)
    if kind == "text":
        return _spoil_text(rng, data)
    changed = bytearray(data)
    for _ in range(1 + rng.integers(4) * rng.integers(2)):
        _BYTES[rng.integers(len(_BYTES))](rng, changed)
    return bytes(changed)


def _place(rng: np.random.Generator, data: bytearray) -> int:
    """Any place, a header's more often than others."""
    size = max(1, len(data))
    return int(rng.integers(min(size, 600) if rng.random() < 0.7 else size))


def _cut(rng: np.random.Generator, data: bytearray) -> None:
    del data[int(rng.integers(len(data) + 1)):]


def _flip(rng: np.random.Generator, data: bytearray) -> None:
    if data:
        data[_place(rng, data)] ^= 1 << int(rng.integers(8))


def _number(rng: np.random.Generator, data: bytearray) -> None:
    at, value = _place(rng, data), int(rng.choice(np.array(_INTEGERS)))
    form = "<>"[rng.integers(2)] + "iq"[rng.integers(2)]
    data[at:at + struct.calcsize(form)] = struct.pack(form, value)


def _swap(rng: np.random.Generator, data: bytearray) -> None:
    at = _place(rng, data) // 4 * 4
    data[at:at + 4] = data[at:at + 4][::-1]


def _remove(rng: np.random.Generator, data: bytearray) -> None:
    at = _place(rng, data)
    del data[at:at + int(rng.integers(1, 60))]


def _double(rng: np.random.Generator, data: bytearray) -> None:
    at, size = _place(rng, data), int(rng.integers(1, 80))
    data[at:at] = data[at:at + size]


def _junk(rng: np.random.Generator, data: bytearray) -> None:
    at, size = _place(rng, data), int(rng.integers(1, 40))
    new = bytes(size) if rng.random() < 0.3 else rng.bytes(size)
    data[at:at + size * int(rng.integers(2))] = new


_BYTES = (_cut, _flip, _number, _number, _swap, _remove, _double, _junk)


def _spoil_json(rng: np.random.Generator, data: bytes) -> bytes:
    tree = [copy.deepcopy(json.loads(data))]
    for _ in range(rng.integers(1, 4)):
        at: Any = tree
        key: Any = 0
        while isinstance(at[key], dict | list) and at[key] and rng.random() < 0.85:
            at = at[key]
            keys = list(at) if isinstance(at, dict) else range(len(at))
            key = keys[rng.integers(len(keys))]
        choice = rng.integers(4)
        if choice == 0 and isinstance(at, dict):
            at[str(_VALUES[rng.integers(len(_VALUES))])] = at.pop(key)
        elif choice == 1 and at is not tree:
            del at[key]
        else:
            at[key] = copy.deepcopy(_VALUES[rng.integers(len(_VALUES))])
        if not isinstance(tree[0], dict | list) or not tree[0]:
            break
    return json.dumps(tree[0], ensure_ascii=bool(rng.integers(2))).encode(errors="surrogatepass")


def _spoil_text(rng: np.random.Generator, data: bytes) -> bytes:
    """Python that cannot do harm: cut off, or with words replaced by a few others."""
    if rng.random() < 0.2:
        return data[:rng.integers(len(data))]
    words = data.decode().split(" ")
    for _ in range(rng.integers(1, 4)):
        words[rng.integers(len(words))] = _WORDS[rng.integers(len(_WORDS))]
    return " ".join(words).encode()


def outcome(read: Callable[[Path], object], path: Path) -> str:
    """'read' or 'refused'. Raises what a reader lets escape, and AssertionError for bad words."""
    started = time.process_time()
    try:
        read(path)
        result = "read"
    except (InputError, SceneError) as error:
        text = str(error)
        assert text.isprintable(), text
        assert len(text) < 700 + len(str(path)), text
        result = "refused"
    assert time.process_time() - started < SECONDS, "it took too long"
    return result


def fuzz(name: str, inputs: int, seed: int, folder: Path) -> Counter[str]:
    """Outcomes of `inputs` spoiled files of one reader; what fails is in `folder`."""
    reader, rng = READERS[name], np.random.default_rng([seed, *name.encode()])
    path = reader.make(folder)
    good, outcomes = path.read_bytes(), Counter[str]()
    assert outcome(reader.read, path) == "read", "the good file is not read"
    for number in range(inputs):
        path.write_bytes(spoil(rng, good, reader.kind))
        try:
            outcomes[outcome(reader.read, path)] += 1
        except BaseException as error:
            raise RuntimeError(f"{name}, seed {seed}, input {number}: {path}") from error
    return outcomes


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("inputs", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("readers", nargs="*", default=list(READERS))
    given = parser.parse_intermixed_args()
    with suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for name in given.readers:
        folder, started = Path(tempfile.mkdtemp(prefix=f"fuzz-{name}-")), time.perf_counter()
        found = fuzz(name, given.inputs, given.seed, folder)
        print(f"{name}: {given.inputs} inputs, {found['read']} read, {found['refused']} refused, "
              f"{time.perf_counter() - started:.0f} s", flush=True)
    with suppress(NameError):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
        print(f"peak memory {peak} MiB", file=sys.stderr)


if __name__ == "__main__":
    main()
