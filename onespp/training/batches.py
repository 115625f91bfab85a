"""Clips of a data set as the network reads them, and which data sets may be trained on.

A batch follows from (seed, step) alone, whatever was read before.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from onespp.clips.clips import Clips
from onespp.clips.store import RESULT
from onespp.datasets.folder import DataSet
from onespp.denoise.methods.learned.networks import NETWORKS
from onespp.denoise.oracles.learned import compressed, planes_of, texture_of
from onespp.render.errors import InputError
from onespp.scenes.catalog import GENERATED, HARD_NAMES, SCENES

FRAMES = 7  # of a clip
ALIGNMENT = max(kind.alignment for kind in NETWORKS.values())  # of its sides, for any network
KEPT = frozenset({*SCENES, *HARD_NAMES, *GENERATED[12:], "slow_box", "swinging_lamp", "docs"})
"""Scenes that results are measured on, which nothing may be trained on."""
_GUIDES = ("albedo", "emission", "normal", "depth", "id")


@dataclass(frozen=True)
class Batches:
    """Batches of a split, with their truth.

    Attributes:
        batch: clips of each. digest: of the sequences that they are from. light: the channel that
            is to be denoised.
    """

    clips: Clips
    batch: int
    seed: int
    digest: str
    light: str = "color"

    @classmethod
    def of(cls, folder: Path, crop: int, batch: int, seed: int, cache: Path | None = None,
           split: str = "train", augment: bool = True, result: str = "") -> Batches:
        """Of a data set; InputError for one that may not, or cannot, be trained on.

        Args:
            result: name of what `onespp denoise` has made of all sequences, in the place of the
                noisy frames; "": these.
        """
        if crop < ALIGNMENT or crop % ALIGNMENT:
            raise InputError(f"--crop is {crop}: use a multiple of {ALIGNMENT} pixels")
        if not (folder / "dataset.json").exists() and (folder / "manifest.json").exists():
            raise InputError(f"{folder} is a sequence, not a data set: make one with `onespp "
                             "dataset`, of other scenes than results are measured on")
        data = DataSet.open(folder)
        sequences = {number: data.sequence(number) for number in data.numbers()}
        for number, sequence in sequences.items():
            name = sequence.manifest.scene.removesuffix(".py").rpartition("docs/")[2]
            if name in KEPT:
                raise InputError(f"{data.place(number)} is of the scene '{name}', which results "
                                 "are measured on: train on a data set without it")
        if data.plan.frames < FRAMES:
            raise InputError(f"{folder} has sequences of {data.plan.frames} frames: use a data set "
                             f"of {FRAMES} or more")
        if not (data.plan.reference_spp or data.plan.reference_error):
            raise InputError(f"{folder} has no references: make a data set with --reference-spp")
        rough = ("roughness",) if all("roughness" in s.channels for s in sequences.values()) else ()
        light = RESULT + result if result else "color"
        clips = Clips(folder, FRAMES, crop, (light, *_GUIDES, *rough), split, seed=seed,
                      augment=augment, cache=cache)
        text = "".join(f"{n} {made.digest}\n" for n in clips.numbers if (made := data.made(n)))
        return cls(clips, batch, seed, hashlib.sha256(text.encode()).hexdigest()[:16], light)

    def read(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """(batch, time, h, w, 7) planes and (batch, time, h, w, 3) compressed light of the truth,
        float32."""
        random = np.random.default_rng((self.seed, step))
        count = len(self.clips)
        chosen = (random.permutation(count)[:self.batch] if count >= self.batch
                  else random.integers(count, size=self.batch))
        self.clips.set_epoch(step)
        planes, truths = zip(*(_read(self.clips[int(i)], self.light) for i in chosen))
        return np.stack(planes), np.stack(truths)


def _read(clip: dict[str, np.ndarray], light: str) -> tuple[np.ndarray, np.ndarray]:
    images = {name: clip[name] for name in (*_GUIDES, "roughness") if name in clip}
    images["color"] = clip[light]
    planes = [planes_of({name: image[t] for name, image in images.items()}, matrix)
              for t, matrix in enumerate(clip["camera_from_world"])]
    albedo, emission = texture_of(images)
    truth = compressed((clip["reference"] - emission) / albedo)
    return np.stack(planes).astype(np.float32), truth.astype(np.float32)
