"""A data set in other layouts: as shards for WebDataset, as zarr, and as Noisebase has it.

Of the first two, arrays are (frames, h, w) or (frames, h, w, c), of the channels that files have
and in their types, `reference` and `reference-half` (its first half minus itself), and the
matrices. Beside them is what was drawn.
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from onespp.datasets.folder import DataSet
from onespp.datasets.plan import SPLITS
from onespp.render.errors import InputError
from onespp.render.files.atomic import replacing
from onespp.render.progress import Progress, silent

from .noisebase import write_description, write_sequence
from .store import HALF, MATRICES, REFERENCE, whole

SHARD_BYTES = 256 << 20


def export(data: DataSet, layout: str, out: Path, progress: Progress = silent) -> int:
    """Write the sequences that are whole into the folder `out`; how many renders.

    Raises:
        InputError: an unknown layout, a package that it needs is not installed, `out` holds
            something, or the disk refuses.
    """
    if layout not in LAYOUTS:
        raise InputError(f"--format is {layout!r}: use {', '.join(LAYOUTS)} for a data set")
    if out.exists() and any(out.iterdir()):
        raise InputError(f"{out} holds files already: use another --out")
    return LAYOUTS[layout](data, out, progress)


def webdataset(data: DataSet, out: Path, progress: Progress = silent) -> int:
    """Shards SPLIT-000000.tar of at most `SHARD_BYTES`, or of one sample.

    A sample is a render of a sequence, NUMBER-sK: its arrays as .npy, and NUMBER-sK.json. Equal
    data sets give equal bytes.
    """
    done = 0
    for split in SPLITS:
        pending: list[tuple[str, bytes]] = []
        size = shards = 0
        for number in data.numbers(split):
            for k in range(data.plan.seeds):
                key = f"{number:06d}-s{k}"
                sample = [(f"{key}.{name}.npy", _npy(array))
                          for name, array in _arrays(data, number, k).items()]
                sample.append((f"{key}.json", _about(data, number, k).encode()))
                length = sum(len(content) for _, content in sample)
                if pending and size + length > SHARD_BYTES:
                    _write_tar(out / f"{split}-{shards:06d}.tar", pending)
                    pending, size, shards = [], 0, shards + 1
                pending += sample
                size += length
                done += 1
                progress(done, len(data.numbers()) * data.plan.seeds, "export")
        if pending:
            _write_tar(out / f"{split}-{shards:06d}.tar", pending)
    return done


def zarr(data: DataSet, out: Path, progress: Progress = silent) -> int:
    """A zarr 3 store: SPLIT/NUMBER/sK/CHANNEL, a shard a channel, a frame a chunk, zstd."""
    library = _zarr("zarr")
    done = 0
    root = library.open_group(str(out), mode="w", zarr_format=3,
                              attributes={"plan": data.plan.model_dump(mode="json")})
    for number in data.numbers():
        for k in range(data.plan.seeds):
            place = f"{data.plan.split_of(number)}/{number:06d}/s{k}"
            group = root.create_group(place, attributes=json.loads(_about(data, number, k)))
            for name, array in _arrays(data, number, k).items():
                group.create_array(name, data=array, chunks=(1, *array.shape[1:]),
                                   shards=array.shape)
            done += 1
            progress(done, len(data.numbers()) * data.plan.seeds, "export")
    return done


def noisebase(data: DataSet, out: Path, progress: Progress = silent) -> int:
    """SPLIT/scene0000.zip and SPLIT.yaml, see `noisebase.py`."""
    library, done = _zarr("noisebase"), 0
    for split in SPLITS:
        numbers = data.numbers(split)
        for index, number in enumerate(numbers):
            write_sequence(library, data, number, out / split / f"scene{index:04d}.zip")
            done += 1
            progress(done, len(data.numbers()), "export")
        if numbers:
            write_description(data, split, len(numbers), out / f"{split}.yaml")
    return done * data.plan.seeds


def _zarr(layout: str) -> Any:
    try:
        import zarr as library  # pyright: ignore[reportMissingImports]  # not for Python 3.10
    except ImportError:
        raise InputError(f"--format {layout} needs a package that is not installed: pip install "
                         "'onespp[zarr]'") from None
    if int(library.__version__.partition(".")[0]) < 3:
        raise InputError(f"zarr is version {library.__version__}: pip install 'onespp[zarr]' "
                         "for version 3, which has shards")
    return library


LAYOUTS: dict[str, Callable[[DataSet, Path, Progress], int]] = {
    "zarr": zarr, "webdataset": webdataset, "noisebase": noisebase}


def _arrays(data: DataSet, number: int, k: int) -> dict[str, np.ndarray]:
    sequence = data.sequence(number, k)
    truth = [REFERENCE, HALF] if sequence.has_reference(sequence.frames[0]) else []
    return whole(data, number, k, [*sequence.manifest.channels, *truth, *MATRICES])


def _about(data: DataSet, number: int, k: int) -> str:
    made = data.made(number)
    about: dict[str, Any] = {} if made is None else {
        "split": made.split, "fingerprint": made.fingerprint, "draw": made.draw}
    return json.dumps({"sequence": number, "render": k, **about}, sort_keys=True)


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    return stream.getvalue()


def _write_tar(path: Path, contents: list[tuple[str, bytes]]) -> None:
    with (replacing(path) as temporary,
          tarfile.open(temporary, "w", format=tarfile.PAX_FORMAT) as tar):
        for name, content in contents:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
