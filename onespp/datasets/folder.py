"""A data set's folder: what is in it, what is missing, and whether it is as it was written.

Nothing here renders: data loaders read it (`onespp/clips/`).
"""

from __future__ import annotations

import hashlib
import os
import traceback
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from onespp.render.channels import TRACING
from onespp.render.errors import InputError
from onespp.render.files.atomic import explain, read_bytes, write_bytes, write_text
from onespp.render.files.json_file import JsonFile, format_json, read_json
from onespp.render.files.lock import when_free, writing
from onespp.render.files.manifest import Manifest
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent
from onespp.scenes.drawn.draw import DRAWING

from .card import card
from .plan import SPLITS, Plan, SplitName

FORMAT = 1
_SECONDS_FOR_OTHERS = 60.0
_RECENT = 50  # sequences, by which the rest is estimated
_SHA256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class Part(JsonFile):
    """A file of a sequence."""

    bytes: Annotated[int, Field(ge=0)]
    sha256: _SHA256


class Made(JsonFile):
    """sequence.json: that a sequence is whole, what was drawn, and its files with their hashes.

    `rejected` says why earlier draws were not taken. `fingerprint` is the scene's.
    """

    number: Annotated[int, Field(ge=0)]
    split: SplitName
    fingerprint: str
    draw: dict[str, Any]
    rejected: list[str]
    files: dict[Annotated[str, Field(pattern=r"^seed\d+/(frames|reference)/\d{4,}\.(exr|json)$")],
                Part]

    @property
    def digest(self) -> str:
        """A hash over all files."""
        text = "".join(f"{name} {part.sha256}\n" for name, part in sorted(self.files.items()))
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def bytes(self) -> int:
        return sum(part.bytes for part in self.files.values())


class Entry(JsonFile):
    """A sequence in dataset.json."""

    split: SplitName
    digest: _SHA256
    bytes: int


class DataSetFile(JsonFile):
    """dataset.json: the plan, who rendered, and the sequences that were whole when it was written.

    `drawing` is `scenes.drawn.draw.DRAWING` of the onespp that draws its scenes, `tracing`
    `render.channels.TRACING` of the one that renders them.
    """

    format: Annotated[int, Field(ge=FORMAT, le=FORMAT)] = FORMAT
    drawing: int = 1
    tracing: int = 1
    plan: Plan
    versions: dict[str, str]
    sequences: dict[int, Entry] = Field(default_factory=dict)


@dataclass(frozen=True)
class Status:
    """How far a data set is.

    Attributes:
        made, failed, left: numbers of sequences; failed ones are left as well. bytes: on disk.
        seconds_left: at the pace of the last ones, None where that cannot be told.
    """

    made: int
    failed: list[int]
    left: int
    bytes: int
    seconds_left: float | None

    def __str__(self) -> str:
        text = (f"{self.made} of {self.made + self.left} sequences are made "
                f"({self.bytes / 2**20:.1f} MiB)")
        if self.left and self.seconds_left is not None:
            text += f", the rest takes {self.seconds_left / 60:.1f} minutes at the last pace"
        if self.failed:
            text += f"; failed: {', '.join(map(str, self.failed[:20]))} (see failures/)"
        return text


@dataclass(frozen=True)
class DataSet:
    """A folder that holds a data set, and its plan.

    All methods raise InputError for files that are missing, damaged, or cannot be written.
    """

    folder: Path
    plan: Plan

    @classmethod
    def open(cls, folder: Path | str) -> DataSet:
        """The data set in a folder; InputError if there is none."""
        path = Path(folder) / "dataset.json"
        if not path.exists():
            raise InputError(f"{folder} is not a data set (it has no dataset.json): make one with "
                             "`onespp dataset`")
        return cls(Path(folder), _plan_in(Path(folder), read_json(path, DataSetFile).plan))

    @classmethod
    def create(cls, folder: Path | str, plan: Plan, versions: Mapping[str, str]) -> DataSet:
        """The data set in a folder, begun, or continued where its plan is the same but for the
        number of sequences, of which the larger one counts.

        Raises:
            InputError: the folder holds another data set, or other files.
        """
        folder = Path(folder)
        path = folder / "dataset.json"
        try:
            if path.exists():
                there = read_json(path, DataSetFile)
                if there.plan.key != plan.key:
                    _require_same_files(folder, there.plan, plan)
                    raise InputError(f"{folder} holds a data set of another plan "
                                     f"({_difference(there.plan, plan)}): use another --out")
                if there.drawing != DRAWING:
                    raise InputError(f"{folder} has scenes that another version of onespp drew, "
                                     "and this one draws others: use another --out")
                if there.tracing != TRACING:
                    raise InputError(f"{folder} has frames that another version of onespp "
                                     "rendered, and this one puts other values into them: use "
                                     "another --out")
                if there.plan.sequences >= plan.sequences:
                    plan = there.plan.model_copy(update={"folder": plan.folder})
                    if _stored(folder, plan) == there.plan:
                        return cls(folder, plan)
                written = there.model_copy(update={"plan": _stored(folder, plan)})
            else:
                if folder.exists() and any(not p.name.startswith(".") for p in folder.iterdir()):
                    raise InputError(f"{folder} holds files that are no data set: use another "
                                     "--out")
                written = DataSetFile(drawing=DRAWING, tracing=TRACING,
                                      plan=_stored(folder, plan), versions=dict(versions))
        except OSError as error:
            raise InputError(explain(folder, error)) from error
        with cls(folder, plan)._changing():
            write_text(path, format_json(written))
        return cls(folder, plan)

    def place(self, number: int) -> Path:
        """The folder of a sequence."""
        return self.folder / self.plan.split_of(number) / f"{number:06d}"

    def sequence(self, number: int, k: int = 0) -> FrameSequence:
        """The k-th render of a sequence."""
        return FrameSequence.open(self.place(number) / f"seed{k}")

    def numbers(self, split: str | None = None) -> list[int]:
        """Numbers of the sequences that are whole, increasing; of a split, or all."""
        found = (int(path.parent.name) for name in (SPLITS if split is None else (split,))
                 for path in self.folder.glob(f"{name}/[0-9]*/sequence.json")
                 if path.parent.name.isdigit())
        return sorted(n for n in found if n < self.plan.sequences)

    def made(self, number: int) -> Made | None:
        """What a sequence says of itself, None while it is not whole."""
        path = self.place(number) / "sequence.json"
        return read_json(path, Made) if path.exists() else None

    def finish_sequence(self, number: int, fingerprint: str, draw: Mapping[str, Any],
                        rejected: list[str]) -> Made:
        """Write sequence.json, with the hashes of the files that are there."""
        place = self.place(number)
        files = {path.relative_to(place).as_posix(): _part(path)
                 for kind in ("frames", "reference")
                 for path in sorted(place.glob(f"seed*/{kind}/[0-9]*"))
                 if path.suffix in (".exr", ".json")}
        made = Made(number=number, split=self.plan.split_of(number),  # type: ignore[arg-type]
                    fingerprint=fingerprint, draw=dict(draw), rejected=rejected, files=files)
        write_bytes(place / "sequence.json", format_json(made).encode(), durable=True)
        with suppress(OSError):
            self._failure(number).unlink(missing_ok=True)
            self._failure(number).parent.rmdir()
        return made

    def note_failure(self, number: int, error: BaseException) -> None:
        """Add what went wrong to the sequence's log."""
        path = self._failure(number)
        before = path.read_text("utf-8") if path.exists() else ""
        said = "".join(traceback.format_exception(error)) + getattr(error, "log", "")
        write_text(path, f"{before}{said}\n")

    def failed(self) -> list[int]:
        """Numbers of sequences that failed and have not been made since."""
        names = sorted(self.folder.glob("failures/[0-9]*.txt"))
        return [int(path.stem) for path in names if path.stem.isdigit()]

    def status(self) -> Status:
        """How far it is."""
        made = self.numbers()
        times = sorted((self.place(n) / "sequence.json").stat().st_mtime for n in made)[-_RECENT:]
        left = self.plan.sequences - len(made)
        pace = (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else None
        size = sum(found.bytes for n in made if (found := self.made(n)))
        return Status(len(made), self.failed(), left, size, None if pace is None else left * pace)

    def finish(self) -> DataSetFile:
        """Write dataset.json and the card anew, of what is whole now."""
        with self._changing():
            path = self.folder / "dataset.json"
            there = read_json(path, DataSetFile)
            found = {n: made for n in self.numbers() if (made := self.made(n))}
            written = there.model_copy(update={"sequences": {
                n: Entry(split=made.split, digest=made.digest, bytes=made.bytes)
                for n, made in found.items()}})
            write_text(path, format_json(written))
            write_text(self.folder / "README.md", card(
                self.plan, there.versions, {n: made.draw for n, made in found.items()},
                {n: (e.split, e.digest, e.bytes) for n, e in written.sequences.items()}))
            return written

    def verify(self, progress: Progress = silent) -> list[str]:
        """Read everything again; a sentence for each thing that is not as it was written."""
        there = read_json(self.folder / "dataset.json", DataSetFile)
        wrong, numbers = [], self.numbers()
        missing = sorted({*range(self.plan.sequences)} - {*numbers})
        if missing:
            more = f" and {len(missing) - 10} more" if len(missing) > 10 else ""
            wrong.append(f"{self.folder} lacks {len(missing)} of {self.plan.sequences} sequences "
                         f"({', '.join(map(str, missing[:10]))}{more}): run the same `onespp "
                         "dataset` again")
        for done, number in enumerate(numbers):
            progress(done, len(numbers), "verify", f"sequence {number}")
            try:
                wrong += self._wrong(number, there.sequences.get(number), there.tracing)
            except InputError as error:
                wrong.append(str(error))
        progress(len(numbers), len(numbers), "verify")
        return wrong

    def _wrong(self, number: int, entry: Entry | None, tracing: int) -> Iterator[str]:
        place, made = self.place(number), self.made(number)
        assert made is not None
        if made.number != number:
            yield f"{place}/sequence.json is of sequence {made.number}: remove the folder"
        expected = {f"seed{k}/frames/{i:04d}.{kind}" for k in range(self.plan.seeds)
                    for i in range(self.plan.frames) for kind in ("exr", "json")}
        if self.plan.reference_spp or self.plan.reference_error:
            expected |= {f"seed0/reference/{i:04d}.exr" for i in range(self.plan.frames)}
        if {*made.files} != expected:
            yield f"{place}/sequence.json does not list the files of the plan: remove the folder"
        for name, part in made.files.items():
            if _part(place / name) != part:
                yield f"{place / name} is not as it was written: remove {place} and make it again"
        for k in range(self.plan.seeds):
            if read_json(place / f"seed{k}" / "manifest.json", Manifest).tracing != tracing:
                yield (f"{place}/seed{k} was rendered by another version of onespp than "
                       f"{self.folder} is of, whose frames hold other values: remove {place} and "
                       "make it again")
        if entry is not None and entry.digest != made.digest:
            yield f"{place} is not what {self.folder}/dataset.json lists: it was made anew since"

    def _failure(self, number: int) -> Path:
        return self.folder / "failures" / f"{number:06d}.txt"

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Holds the lock on dataset.json; waits for others who do."""
        with ExitStack() as held:
            when_free(lambda: held.enter_context(writing(self.folder, "dataset")),
                      _SECONDS_FOR_OTHERS, 0.1)
            yield


def _part(path: Path) -> Part:
    data = read_bytes(path)
    return Part(bytes=len(data), sha256=hashlib.sha256(data).hexdigest())


def _stored(folder: Path, plan: Plan) -> Plan:
    """The plan as dataset.json has it: where files are is said from the data set's folder, so that
    both may be moved together."""
    if not plan.folder:
        return plan
    with suppress(ValueError):  # another drive
        return plan.model_copy(update={"folder": Path(os.path.relpath(
            plan.folder, folder.resolve())).as_posix()})
    return plan


def _plan_in(folder: Path, stored: Plan) -> Plan:
    """The reverse of `_stored`."""
    if not stored.folder:
        return stored
    return stored.model_copy(update={"folder": (folder / stored.folder).resolve().as_posix()})


def _require_same_files(folder: Path, there: Plan, plan: Plan) -> None:
    if there.contents.keys() == plan.contents.keys():
        for name, content in there.contents.items():
            if content != plan.contents[name]:
                raise InputError(f"{name}, or a file that it names, has changed since {folder} was "
                                 "begun: put it back, or use another --out")


def _difference(a: Plan, b: Plan) -> str:
    """The first thing in which two plans differ."""
    one, two = (plan.model_dump(mode="json") for plan in (a, b))
    for key, value in one.items():
        if value == two[key] or key in ("sequences", "about", "licence"):
            continue
        if isinstance(value, dict):
            inner = next(k for k in value if value[k] != two[key][k])
            return f"{key}.{inner} is {value[inner]} there, {two[key][inner]} here"
        return f"{key} is {value} there, {two[key]} here"
    return "the same settings"
