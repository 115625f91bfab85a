"""A metric of one's own.

    onespp score data/box --metric my_metric.py

It is measured on every frame of every method, and stands in the table, in scores.json, in `onespp
compare` and in the report.
"""

from __future__ import annotations

import numpy as np

from onespp.denoise.metrics.metric import Metric


def _edge_error(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean difference of horizontal and vertical gradients.

    Args:
        image, reference: (h, w, 3), in the space that the row below names; not to write to.
    Returns:
        A finite number, or None where the metric does not apply.
    """
    across = np.diff(image, axis=1) - np.diff(reference, axis=1)
    down = np.diff(image, axis=0) - np.diff(reference, axis=0)
    return float((np.abs(across).mean() + np.abs(down).mean()) / 2)


my_metric = Metric(
    name="my_metric",             # in scores.json
    label="my metric",            # in tables
    function=_edge_error,
    space="srgb",                 # display values in [0, 1]; or "linear", radiance
    unit="",
    higher_is_better=False,
    format=".4f",
    about="mean |grad a - grad b|, on clipped sRGB",
)
