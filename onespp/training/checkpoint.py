"""Where a training stands, as a file: weights, what the optimizer remembers, and the losses."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from onespp.render.errors import InputError
from onespp.render.files.atomic import read_bytes, write_bytes


@dataclass
class Checkpoint:
    """After some steps.

    Attributes:
        settings: what all steps depend on; another one does not go on from here.
        arrays: weights by name, and the optimizer's, numbered. losses: of each step.
        validation: step -> loss on other scenes. seconds: that the steps took.
    """

    settings: Mapping[str, Any]
    arrays: dict[str, np.ndarray]
    losses: list[float] = field(default_factory=list)
    validation: dict[int, float] = field(default_factory=dict)
    seconds: float = 0.0

    def write(self, path: Path) -> None:
        """InputError where the disk refuses."""
        about = {"settings": {**self.settings}, "validation": self.validation,
                 "seconds": self.seconds}
        memory = io.BytesIO()
        np.savez(memory, allow_pickle=False, **{f"array/{k}": a for k, a in self.arrays.items()},
                 losses=np.array(self.losses),
                 about=np.frombuffer(json.dumps(about).encode(), np.uint8))
        write_bytes(path, memory.getvalue(), durable=True)

    @staticmethod
    def read(path: Path, settings: Mapping[str, Any]) -> Checkpoint:
        """Of a training with these settings.

        Raises:
            InputError: the file is damaged, or of another training.
        """
        try:
            with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as file:
                about = json.loads(file["about"].tobytes())
                arrays = {name[6:]: file[name] for name in file.files if name.startswith("array/")}
                # (before there were other networks and inputs, none was named)
                found = Checkpoint({"network": "rae", "result": "", **about["settings"]}, arrays,
                                   file["losses"].tolist(),
                                   {int(k): v for k, v in about["validation"].items()},
                                   about["seconds"])
        except (ValueError, KeyError, TypeError, AttributeError, EOFError,
                zipfile.BadZipFile) as error:
            raise InputError(f"{path} is damaged ({error}): remove it to begin anew") from error
        for key, value in settings.items():
            there = found.settings.get(key)
            if there != value:
                raise InputError(f"{path} is of a training with other settings ({key} is {there} "
                                 f"there, {value} here): use another --out, or remove it")
        return found
