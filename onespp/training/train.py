"""The steps of a training, which goes on where it was stopped, to the same weights.

Adam with beta 0.9 and 0.99. The rate grows to `RATE` tenfold in a geometric progression over the
first `RAMP` steps (the paper: over 10 of 500 epochs) and falls with 1 / sqrt(step) after them. What
is written and validated is a mean over the steps t, in which late ones count more: with weights w,

    mean += 9 / (t + 8) (w - mean)

which does what a rate that falls to 0 at the end would do, and knows of no end. So nothing depends
on how many steps there are to be: a training may be stopped at any of them, and gone on with.
Batches follow from the seed and the step, checkpoints hold all else.

Source of the mean: Shamir and Zhang 2013, "Stochastic gradient descent for non-smooth
optimization", with eta = 8. Of the optimizer: Chaitanya et al. 2017, section 4. Departures: the
mean; a ramp counted in steps; a gradient (of all weights, as one vector) longer than `LONGEST` is
scaled to it, or else one clip with a firefly would shorten the next hundred steps.
"""

# pyright: standard, reportMissingImports=false
from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from onespp.datasets.folder import DataSet
from onespp.denoise.methods.learned.architecture import WIDTHS, Architecture, Weights
from onespp.denoise.methods.learned.networks import architecture_of
from onespp.denoise.methods.learned.weights import Network, write_network
from onespp.render.errors import InputError
from onespp.render.files.atomic import write_text
from onespp.render.files.json_file import format_json
from onespp.render.host.versions import versions
from onespp.render.progress import Progress, silent

from .batches import Batches
from .checkpoint import Checkpoint
from .log import Data, Log

RATE, RAMP, LONGEST = 1e-3, 50, 1.0
RULES = 2  # by which steps are made: changes with whatever changes the weights of a seed
VALIDATION_SEED = 1  # whatever the training's: losses of several are of the same clips
_SHOWN = 50  # steps whose mean loss is shown


@dataclass(frozen=True)
class Settings:
    """What the weights after a step depend on, beside the data.

    Attributes:
        network: of `NETWORKS`. width: of `WIDTHS`. seed: of the first weights and all batches.
        batch: clips a step. crop: side of a clip, pixels. result: in the place of the noisy frames,
            as `Batches.of` has it.
    """

    network: str = "rae"
    width: str = "quarter"
    seed: int = 0
    batch: int = 4
    crop: int = 128
    result: str = ""

    def __post_init__(self) -> None:
        architecture_of(self.network)
        if self.width not in WIDTHS:
            raise InputError(f"--width is {self.width}: use {', '.join(WIDTHS)}")
        if self.batch < 1:
            raise InputError(f"--batch is {self.batch}: use 1 or more")
        if self.seed < 0:
            raise InputError(f"--seed is {self.seed}: use 0 or more")

    @property
    def architecture(self) -> Architecture:
        return architecture_of(self.network)


def require_jax() -> None:
    """InputError where JAX or Optax are not installed."""
    missing = [name for name in ("jax", "optax") if find_spec(name) is None]
    if missing:
        raise InputError(f"training needs {' and '.join(missing)}: run "
                         "`pip install 'onespp[train]'`")


def rate_of(step: int) -> float:
    """Of step 0, 1, ..."""
    return RATE * (10.0 ** (step / RAMP - 1) if step < RAMP else (RAMP / (step + 1)) ** 0.5)


def share_of(step: int) -> float:
    """Of the weights after step 0, 1, ... in the mean."""
    return 9 / (step + 9)


def train(folder: Path, out: Path, steps: int, settings: Settings, every: int = 100,
          cache: Path | None = None, progress: Progress = silent) -> Checkpoint:
    """Train to so many steps, from the checkpoint beside `out` if there is one.

    With each checkpoint `out` is written and its log (.json).

    Args:
        every: steps between checkpoints. cache: folder for memory maps of frames.

    Raises:
        InputError: no JAX, a data set that may not or cannot be used, a checkpoint of other
            settings, a loss that is no number, or a disk that refuses.
        KeyboardInterrupt: from `progress`; a checkpoint is written first.
    """
    require_jax()
    for name, value in (("--steps", steps), ("--checkpoint", every)):
        if value < 1:
            raise InputError(f"{name} is {value}: use 1 or more")
    batches = Batches.of(folder, settings.crop, settings.batch, settings.seed, cache,
                         result=settings.result)
    others = _validation(folder, settings, cache)
    known = {**asdict(settings), "data": batches.digest, "rules": RULES}
    path = checkpoint_of(out)
    optimizer = _Optimizer(settings)
    stand = (Checkpoint.read(path, known) if path.exists()
             else Checkpoint(known, optimizer.arrays()))
    done = len(stand.losses)
    if done > steps:
        raise InputError(f"{path} has {done} steps already: use --steps {done} or more, or another "
                         "--out")
    optimizer.load(stand.arrays)
    name = f"train {settings.network}-{settings.width}"

    def save() -> None:
        stand.arrays = optimizer.arrays()
        stand.write(path)
        _write(out, stand, optimizer.weights(), settings, batches)

    with _in_turn(batches, done, steps) as queue:
        for step, batch in queue:
            begun_at = time.perf_counter()
            loss = optimizer.step(step, *batch)
            if not np.isfinite(loss):
                raise InputError(f"the loss of step {step + 1} is {loss}: look for frames of "
                                 f"{folder} that are not finite (`onespp check`)")
            stand.losses.append(loss)
            stand.seconds += time.perf_counter() - begun_at
            if step + 1 == steps or (step + 1) % every == 0:
                if others:
                    stand.validation[step + 1] = optimizer.loss(*others)
                save()
            try:
                progress(step + 1, steps, name, f"loss {np.mean(stand.losses[-_SHOWN:]):.4f}")
            except KeyboardInterrupt:
                save()
                raise
    if done == steps:
        save()
    return stand


def checkpoint_of(out: Path) -> Path:
    """Where the checkpoint of a file of weights is."""
    return out.with_suffix(".checkpoint.npz")


def log_of(out: Path) -> Path:
    """Where the losses of a training are."""
    return out.with_suffix(".json")


def _write(out: Path, stand: Checkpoint, weights: Weights, settings: Settings,
           batches: Batches) -> None:
    plan, digits = batches.clips.plan, 6
    log = Log(
        **asdict(settings), steps=len(stand.losses),
        data=Data(name=plan.name, seed=plan.seed, digest=batches.digest,
                  sequences=len(batches.clips.numbers)),
        versions=versions("jax", "optax", "numpy"), seconds=round(stand.seconds, 1),
        loss=[round(x, digits) for x in stand.losses],
        validation={str(k): round(v, digits) for k, v in stand.validation.items()})
    about = log.model_dump(exclude={"network", "width", "seconds", "loss", "validation"})
    write_network(out, Network(settings.network, settings.width, weights, about))
    write_text(log_of(out), format_json(log))


def _validation(folder: Path, settings: Settings,
                cache: Path | None) -> tuple[np.ndarray, np.ndarray] | None:
    """A batch of scenes that are not trained on; None where the data set has none."""
    split = "validation"
    if not DataSet.open(folder).numbers(split):
        return None
    return Batches.of(folder, settings.crop, settings.batch, VALIDATION_SEED, cache, split,
                      augment=False, result=settings.result).read(0)


@contextmanager
def _in_turn(batches: Batches, first: int, end: int) -> Iterator[Iterator[tuple[int, tuple]]]:
    """Yields (step, batch), each read while the one before it is worked on."""
    with ThreadPoolExecutor(1) as reader:
        def listed() -> Iterator[tuple[int, tuple]]:
            ahead = reader.submit(batches.read, first) if first < end else None
            for step in range(first, end):
                assert ahead is not None
                batch = ahead.result()
                if step + 1 < end:
                    ahead = reader.submit(batches.read, step + 1)
                yield step, batch

        yield listed()


class _Optimizer:
    """Weights, their mean over the steps, and Adam's moments; and the compiled step."""

    def __init__(self, settings: Settings) -> None:
        import jax
        import optax

        from .forward import forward
        from .loss import loss

        def of(weights: Any, planes: Any, truth: Any) -> Any:
            return loss(forward(settings.architecture, weights, planes), truth)

        def update(weights: Any, mean: Any, moments: Any, rate: Any, share: Any, planes: Any,
                   truth: Any) -> tuple:
            value, slope = jax.value_and_grad(of)(weights, planes, truth)
            change, moments = adam.update(slope, moments)
            weights = jax.tree.map(lambda w, c: w - rate * c, weights, change)
            mean = jax.tree.map(lambda m, w: m + share * (w - m), mean, weights)
            return weights, mean, moments, value

        adam = optax.chain(optax.clip_by_global_norm(LONGEST),
                           optax.scale_by_adam(b1=0.9, b2=0.99))
        self._jax, self._update, self._loss = jax, jax.jit(update), jax.jit(of)
        self._weights: Any = settings.architecture.begun(settings.width, settings.seed)
        self._mean: Any = self._weights
        self._moments: Any = adam.init(self._weights)

    def step(self, step: int, planes: np.ndarray, truth: np.ndarray) -> float:
        """Its loss, before the change."""
        self._weights, self._mean, self._moments, value = self._update(
            self._weights, self._mean, self._moments, np.float32(rate_of(step)),
            np.float32(share_of(step)), planes, truth)
        return float(value)

    def loss(self, planes: np.ndarray, truth: np.ndarray) -> float:
        """Of the mean."""
        return float(self._loss(self._mean, planes, truth))

    def weights(self) -> Weights:
        """The mean."""
        return {name: np.asarray(array) for name, array in self._mean.items()}

    def arrays(self) -> dict[str, np.ndarray]:
        """All of it; see `load`."""
        leaves = self._jax.tree.leaves(self._moments)
        return {**{name: np.asarray(array) for name, array in self._weights.items()},
                **{f"mean/{name}": array for name, array in self.weights().items()},
                **{f"adam{i}": np.asarray(x) for i, x in enumerate(leaves)}}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        leaves, form = self._jax.tree.flatten(self._moments)
        self._moments = form.unflatten([arrays[f"adam{i}"] for i in range(len(leaves))])
        self._weights, self._mean = ({name: arrays[f"{kind}{name}"] for name in self._weights}
                                     for kind in ("", "mean/"))
