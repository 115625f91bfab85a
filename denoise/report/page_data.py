"""What the page of a report says in words and numbers: one JSON object, made of the scores."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from matplotlib import colormaps

from onespp.denoise.metrics.errors import PSNR_CAP
from onespp.denoise.metrics.metric import Metric
from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.score.causes import CAUSES, HISTORIES
from onespp.denoise.score.method_score import ClassScore, MethodScore
from onespp.denoise.score.scorecard import INPUT, Scores, cells
from onespp.render.channels import CHANNELS
from onespp.render.files.sequence import FrameSequence

from .panels import ERROR_MAX
from .speed_error_plot import pareto_front, times_are

_SHOWN_ELSEWHERE = {"method", "ms_per_frame", "machine"}


def page_data(sequence: FrameSequence, scores: Scores, channels: list[str],
              ranges: dict[str, tuple[float, float]], histograms: dict[str, list[float]],
              edges: np.ndarray) -> dict[str, Any]:
    """What the page's scripts read.

    Args:
        channels: those of the frames that the report holds. ranges: of those that need one.
        histograms: method -> share of pixels in each bin between `edges`.
    """
    manifest = sequence.manifest
    metrics = [m for m in scores.measures.values()
               if any(method[m.name] is not None for method in scores.methods.values())]
    return {
        "scene": scores.scene, "frames": scores.frames, "width": manifest.width,
        "height": manifest.height, "fps": manifest.fps, "hasReference": scores.has_reference,
        "references": [i for i in scores.frames if sequence.has_reference(i)],
        "floor": scores.headline_floor,
        "floors": [scores.headline_floors.get(i) for i in scores.frames],
        "headline": HEADLINE.name, "toneMap": scores.tone_map,
        "metrics": [_metric(m, scores) for m in metrics],
        "methods": [_method(sequence, scores, name, metrics, histograms.get(name))
                    for name in scores.ordered()],
        "classes": _classes(scores),
        "edges": [float(f"{e:.4g}") for e in edges],
        "channels": [{"name": name, "about": CHANNELS[name].about, "range": ranges.get(name),
                      "display": CHANNELS[name].display.name.lower()}
                     for name in channels],
        "objects": list(manifest.objects) if "id" in channels else [],
        "timesAre": times_are([m.interleaved for m in scores.methods.values() if m.ms_per_frame]),
        "errorMax": ERROR_MAX, "exact": PSNR_CAP,
        "maps": {name: _colours(name) for name in ("inferno", "magma")},
    }


def _metric(metric: Metric, scores: Scores) -> dict[str, Any]:
    sign = 1 if metric.higher_is_better else -1
    points = {name: (ms, sign * value) for name, method in scores.methods.items()
              if (ms := method.ms_per_frame) and (value := method[metric.name]) is not None}
    return {"name": metric.name, "label": metric.label, "unit": metric.unit,
            "higherIsBetter": metric.higher_is_better, "format": metric.format,
            "about": metric.about, "front": pareto_front(points)}


def _method(sequence: FrameSequence, scores: Scores, name: str, metrics: list[Metric],
            histogram: list[float] | None) -> dict[str, Any]:
    method = scores.methods[name]
    rows = {row.frame: row for row in method.per_frame}
    coloured = sorted(set(scores.methods) - {INPUT})

    def over_frames(key: str) -> list[float | None]:
        return [rows[i][key] if i in rows else None for i in scores.frames]

    return {
        "name": name, "colour": coloured.index(name) if name in coloured else None,
        "ms": method.ms_per_frame, "inTurns": method.interleaved,
        "values": {m.name: method[m.name] for m in metrics},
        "errors": method.errors, "bounds": method.bounds,
        "perFrame": {m.name: over_frames(m.name) for m in metrics},
        "frames": [i for i in scores.frames if i in rows],
        "classes": {key: {name: {**row.model_dump(), "mse_share": max(0.0, row.mse_share)}
                          for name, row in split.items()}
                    for key, split in _splits(method).items()},
        "histogram": histogram,
    }


def _splits(method: MethodScore) -> dict[str, dict[str, ClassScore]]:
    return {"cause": method.by_cause, "history": method.by_history}


def _classes(scores: Scores) -> dict[str, list[dict[str, str]]]:
    """For each way to split pixels, the classes that some method has pixels and an error in."""
    about = {"cause": dict(CAUSES),
             "history": {name: f"seen for {name} frames in a row" for name in HISTORIES}}
    return {key: [{"name": name, "about": what} for name, what in rows.items()
                  if any(name in split and split[name].pixels and split[name].mse_share
                         for m in scores.methods.values() for split in [_splits(m)[key]])]
            for key, rows in about.items()}


def _colours(name: str) -> str:
    """256 colours of a map, base64 of their R, G, B bytes."""
    table = colormaps[name](np.arange(256), bytes=True)[:, :3]
    return base64.b64encode(np.ascontiguousarray(table).tobytes()).decode()


def table_data(scores: Scores) -> tuple[list[tuple[str, str]], list[tuple[str, list[str]]]]:
    """Columns (heading, what it means) and rows (method, texts) of the table of everything."""
    rows = {name: {**cells(scores, name), **_measures(scores, name),
                   **_rest(scores, name)} for name in scores.ordered()}
    headings = [h for h in dict.fromkeys(h for row in rows.values() for h in row)
                if any(row.get(h, "-") != "-" for row in rows.values())]
    about = {_heading(m): m.about for m in scores.measures.values()}
    return ([(h, about.get(h, "")) for h in headings],
            [(name, [row.get(h, "-") for h in headings]) for name, row in rows.items()])


def _measures(scores: Scores, name: str) -> dict[str, str]:
    method = scores.methods[name]
    errors = {HEADLINE.name: method.errors.get(HEADLINE.name)}  # the others' are in the files
    return {_heading(m): m.text(method[m.name], errors.get(m.name), m.name in method.bounds)
            for m in scores.measures.values()}


def _heading(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})" if metric.unit else metric.label


def best_cells(scores: Scores, columns: list[tuple[str, str]]) -> list[set[str]]:
    """For each column the text of the best value, where it is a measure of several methods."""
    best = []
    headings = {_heading(m): m for m in scores.measures.values()}
    for heading, _ in columns:
        metric = headings.get(heading)
        judged = [] if metric is None else [
            (v, name) for name, method in scores.methods.items()
            if (v := method[metric.name]) is not None]
        if metric is None or len(judged) < 2:
            best.append(set())
        else:
            pick = max if metric.higher_is_better else min
            _, name = pick(judged, key=lambda row: row[0])
            best.append({_measures(scores, name)[heading]})
    return best


_NAMES = {"first_ms": "first frame (ms)", "startup_ms": "start-up (ms)",
          "peak_mb": "peak memory (MiB)", "megapixels_per_s": "Mpix/s",
          "interleaved": "timed in turns", "bias_squared": "bias^2", "non_finite_pixels":
          "non-finite pixels"}
_SPLIT = ("bias_squared", "variance")


def _rest(scores: Scores, name: str) -> dict[str, str]:
    """What scores say of a method beyond the measures, one number or word each."""
    data, shown = scores.methods[name].model_dump(), {*_SHOWN_ELSEWHERE, *scores.measures}
    plain = {key: value for key, value in data.items()
             if key not in shown and not isinstance(value, dict | list)}
    split = {key: value for key, value in (data.get("split") or {}).items() if key in _SPLIT}
    return {_NAMES.get(key, key.replace("_", " ")): text_of(value)
            for key, value in {**split, **plain}.items()}


def text_of(value: Any) -> str:
    if value is None or value == "":
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def highlights(scores: Scores) -> list[dict[str, str]]:
    """The few figures that a reader wants first: label, value, and a line below."""
    width, height = scores.size
    tiles = []
    judged = {name: value for name, method in scores.methods.items()
              if name != INPUT and (value := method[HEADLINE.name]) is not None}
    if judged:
        best = max(judged, key=judged.__getitem__)
        timed = {name: ms for name in judged if (ms := scores.methods[name].ms_per_frame)}
        fastest = min(timed, key=timed.__getitem__, default=None)
        both = best == fastest and len(judged) > 1
        tiles.append(_tile(scores, "Best, and fastest" if both else "Best", best))
        if fastest is not None and fastest != best:
            tiles.append(_tile(scores, "Fastest", fastest))
    if scores.reference_halves:
        error = max((m.errors.get(HEADLINE.name, 0.0) for m in scores.methods.values()), default=0)
        tiles.append({"label": "Reference", "value": f"{scores.reference_spp} spp, two halves",
                      "about": f"{HEADLINE.label} is known to ±{error:.2f} {HEADLINE.unit} or "
                               "better"})
    elif scores.headline_floor is not None:
        tiles.append({"label": "Noise floor of the reference",
                      "value": f"{scores.headline_floor:.1f} {HEADLINE.unit}",
                      "about": f"{scores.reference_spp} spp; a perfect image would score this"})
    samples = "" if scores.spp is None else (
        f" at {scores.spp} sample{'s' if scores.spp > 1 else ''} a pixel")
    tiles.append({"label": "Sequence", "value": f"{len(scores.frames)} frames",
                  "about": f"{width}x{height}{samples}"})
    return tiles


def _tile(scores: Scores, label: str, name: str) -> dict[str, str]:
    row = cells(scores, name)
    parts = [scores.label(name)]
    if row[f"gain ({HEADLINE.unit})"] != "-":
        parts.append(f"{row[f'gain ({HEADLINE.unit})']} {HEADLINE.unit} over the input")
    if row["ms/frame"] != "-":
        parts.append(f"{row['ms/frame']} ms a frame")
    return {"label": label, "value": f"{row[_heading(HEADLINE)]} {HEADLINE.unit}",
            "about": ", ".join(parts)}
