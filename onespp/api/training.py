"""Training a network on a data set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from onespp.denoise.methods.learned.networks import architecture_of
from onespp.render.errors import InputError
from onespp.training.train import Settings, log_of, require_jax, train

from .caller import caller, public
from .datasets import dataset

_FRAMES, _REFERENCE_SPP = 8, 64  # of a data set that is drawn to train on


@dataclass(frozen=True)
class Trained:
    """What a training wrote.

    Attributes:
        weights, log, curve: files. steps: in all. loss: mean of the last 50. seconds: that steps
            took. validation: loss on scenes that were not trained on, None where there are none.
    """

    weights: Path
    log: Path
    curve: Path
    steps: int
    loss: float
    seconds: float
    validation: float | None


@public
def train_network(network: str, folder: Path | str | None, out: Path | str, *, steps: int = 2000,
                  width: str | None = None, seed: int = 0, batch: int = 4, crop: int = 128,
                  checkpoint: int = 100, cache: Path | str | None = None,
                  sequences: int = 100, result: str = "") -> Trained:
    """Train a network, such as `rae` for `onespp denoise --method rae-quarter --set weights=FILE`.

    The same call goes on where it was stopped, to the same weights. More `steps` go on as well.

    Args:
        network: a kind, of `NETWORKS`.
        folder: of a data set with references; None draws one beside `out`, by the plan `rooms`.
        out: file of the weights (.npz). Beside it are the checkpoint, the log of losses (.json) and
            their picture (.png).
        steps: in all. width: a share of the published numbers of features, of `WIDTHS`;
            None: of the kind.
        seed: of the first weights and of all batches. batch: clips of seven frames a step.
        crop: their side, pixels. checkpoint: steps between checkpoints.
        cache: a folder for memory maps of frames, which are read quicker.
        sequences: of a data set that is drawn.
        result: name of what `onespp denoise` has made of all sequences of the data set, which the
            network gets in the place of the noisy frames.

    Raises:
        InputError: there is no such network, JAX or Optax are missing, the data set is of scenes
            that results are measured on or cannot be used, or what is beside `out` is of another
            training.
        KeyboardInterrupt: after a step; a checkpoint is written.
    """
    from onespp.training.curve import draw_curve

    out, width = Path(out), width or architecture_of(network).width
    settings = Settings(network, width, seed, batch, crop, result)
    require_jax()
    if out.suffix != ".npz":
        raise InputError(f"--out is {out}: give a file that ends with .npz")
    if folder is None and result:
        raise InputError(f"--result is '{result}', of a data set that is there: give its folder")
    if folder is None:
        folder = out.with_suffix(".data")
        dataset("rooms", folder, sequences=sequences, frames=_FRAMES, size=(crop, crop),
                reference_spp=_REFERENCE_SPP, changes={"split.test": 0.0})
    with caller().progress() as report:
        stand = train(Path(folder), out, steps, settings, checkpoint,
                      None if cache is None else Path(cache), report)
    curve = out.with_suffix(".png")
    draw_curve(stand, f"{network}-{width}, {len(stand.losses)} steps of {batch} clips", curve)
    last = stand.losses[-50:]
    return Trained(out, log_of(out), curve, len(stand.losses), sum(last) / len(last),
                   stand.seconds, stand.validation.get(len(stand.losses)))
