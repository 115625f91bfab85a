"""One measure of error: what it takes, its unit and its direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .estimate import Estimate, Scale


@dataclass(frozen=True)
class Metric:
    """One measure of a frame.

    Attributes:
        name: key in scores.json and column in scores.csv.
        label: heading in tables.
        function: (a, b) -> float, finite for finite images; None where it does not apply.
        space: what `function` takes, "linear" radiance, "srgb" display values, "flip" (radiance,
            and a `FlipReference`), or a "step" of two frames (`flicker.py`).
        unit: goes with the label, as "dB"; "" where there is none.
        higher_is_better: the direction.
        format: how tables print it.
        about: the definition in a line.
        in_table: whether it has a column on the terminal; the files have them all.
        most_frames: for a slow one, the number of frames it is measured on, spread evenly; None:
            all.
        estimate: of a quadratic one, the mean square by a reference's halves, from a `Pair` or a
            `Step`; None without halves, or where it does not apply.
        scale: what the measure makes of that.
    """

    name: str
    label: str
    function: Callable[..., float | None]
    space: str
    unit: str
    higher_is_better: bool
    format: str
    about: str
    in_table: bool = True
    most_frames: int | None = None
    estimate: Callable[[Any], Estimate | None] | None = None
    scale: Scale = "mean"

    def text(self, value: float | None, error: float | None = None, bound: bool = False) -> str:
        """A value for a table: "38.71 ±0.08", "≥ 41.20" of a bound, "-" where there is none.

        Example:
            >>> row = Metric("db", "dB", lambda a, b: None, "", "dB", True, ".2f", "")
            >>> row.text(38.712, 0.083), row.text(41.2, bound=True), row.text(None)
            ('38.71 ±0.08', '≥ 41.20', '-')
        """
        if value is None:
            return "-"
        if bound:
            return f"{'≥' if self.higher_is_better else '≤'} {value:{self.format}}"
        return f"{value:{self.format}}" + ("" if error is None else f" ±{error:{self.format}}")
