"""The report of a scored sequence: a folder that opens in a browser, from disk, without a server.

    report/index.html           figures, plots, table, viewer: everything but the pixels
    report/data/KIND/.../0000.js    one packed image each (page_images.py), loaded when looked at
    report/scores.json, scores.csv

KIND is `frame/CHANNEL`, `reference` or `denoised/METHOD`. Equal input gives an equal
report; files of an older one are removed, others in the folder stay.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jinja2
import numpy as np

from onespp.denoise.score.scorecard import INPUT, Scores, caption
from onespp.render.channels import CHANNELS, Display
from onespp.render.errors import InputError
from onespp.render.files.atomic import all_or_none, write_text
from onespp.render.files.sequence import FrameSequence
from onespp.render.progress import Progress, silent

from . import page_images as packed
from .contact_sheets import display_errors
from .page_data import best_cells, highlights, page_data, table_data
from .provenance import provenance

EDGES = np.logspace(-4, 0, 49)
"""Edges of the bins of the histogram; errors below the first are in the first bin."""

_KINDS = {Display.LIGHT: packed.RADIANCE, Display.OBJECT: packed.WHOLE}

_SCRIPTS = ("format.js", "work.js", "pixels.js", "plots.js", "charts.js", "view.js",
            "readout.js", "viewer.js", "controls.js", "page.js")


def write_report(sequence: FrameSequence, scores: Scores, channels: Iterable[str] | None = None,
                 progress: Progress = silent, command: str = "") -> Path:
    """Write `report/` into the sequence's folder; the path of its index.html.

    Args:
        channels: of the frames to show beside colour; default: all that there are.
        progress: counts frames. command: the command line, to be shown.

    Raises:
        InputError: an unknown channel, or a file that cannot be read or written.
    """
    shown = _channels(sequence, channels)
    folder = sequence.folder / "report"
    histograms = {name: np.zeros(len(EDGES) - 1) for name in scores.methods}
    ranges: dict[str, tuple[float, float]] = {"roughness": (0.0, 1.0)}
    written: set[Path] = set()
    with all_or_none() as new, ThreadPoolExecutor() as pool:
        for n, frame in enumerate(scores.frames):
            def write(job: tuple[str, np.ndarray, packed.Kind], frame: int = frame) -> Path:
                key = f"{job[0]}/{frame:04d}"
                path = folder / "data" / f"{key}.js"
                if not path.exists():
                    new.append(path)  # the others belong to the page that is there
                write_text(path, packed.pack(key, job[1], job[2]))
                return path

            images = list(_images(sequence, scores, frame, shown))
            known = {key: image for key, image, _ in images}
            packing = [pool.submit(write, image) for image in images]
            _measure(known, histograms, ranges)
            written |= {part.result() for part in packing}
            progress(n + 1, len(scores.frames), "report")
    shares = {name: [float(f"{x:.4g}") for x in counts / counts.sum()]
              for name, counts in histograms.items() if counts.sum()}
    data = page_data(sequence, scores, shown, ranges, shares, EDGES)
    write_text(folder / "scores.json", scores.json_text())
    write_text(folder / "scores.csv", scores.csv_text())
    for old in {*folder.glob("data/**/*.js")} - written:
        old.unlink()
    write_text(folder / "index.html", render_page(sequence, scores, data, command))
    return folder / "index.html"


def inlined(page: Path) -> str:
    """The text of a report as one file, which holds its images."""
    data = page.parent / "data"
    files = {path.relative_to(data).with_suffix("").as_posix(): path.read_text("utf-8")
             for path in sorted(data.glob("**/*.js"))}
    script = f"<script>window.onesppFiles = {_safe(files)};</script>\n"
    return page.read_text("utf-8").replace(_DATA, script + _DATA, 1)


_DATA = '<script type="application/json" id="data">'


def _safe(data: object) -> str:
    """JSON in which no "<" lets a name in the data end the element that holds it."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _channels(sequence: FrameSequence, wanted: Iterable[str] | None) -> list[str]:
    there = [name for name in sequence.channels if name != "color"]
    if wanted is None:
        return there
    names = list(wanted)
    for name in names:
        if name not in there and name != "color":
            raise InputError(f"{sequence.folder} lacks the channel '{name}' (it has "
                             f"{', '.join(sequence.channels)})")
    return [name for name in there if name in names]


def _images(sequence: FrameSequence, scores: Scores, frame: int,
            channels: list[str]) -> Iterator[tuple[str, np.ndarray, packed.Kind]]:
    """(where it belongs, image, how it is stored) of all images of a frame."""
    images = sequence.read_frame(frame, ("color", *channels)).images
    for name, image in images.items():
        yield f"frame/{name}", image, _KINDS.get(CHANNELS[name].display, packed.GUIDE)
    if sequence.has_reference(frame):
        yield "reference", sequence.read_reference(frame).color, packed.RADIANCE
    for name in scores.methods:
        if name != INPUT and sequence.has_result(name, frame):
            yield f"denoised/{name}", sequence.read_result(name, frame), packed.RADIANCE


def _where(name: str) -> str:
    return "frame/color" if name == INPUT else f"denoised/{name}"


def _measure(images: dict[str, np.ndarray], histograms: dict[str, np.ndarray],
             ranges: dict[str, tuple[float, float]]) -> None:
    """Add a frame's errors to the histograms, and widen the ranges of what has no unit range."""
    if "reference" in images:
        judged = {name: images[_where(name)] for name in histograms if _where(name) in images}
        for name, error in zip(judged, display_errors(judged.values(), images["reference"])):
            inside = np.clip(error, EDGES[0], EDGES[-1])
            histograms[name] += np.histogram(inside, EDGES)[0]
    for name, channel in CHANNELS.items():
        image = images.get(f"frame/{name}")
        if image is not None and channel.display is Display.RANGE:
            values = image[np.isfinite(image) & (image != 0)]
            if values.size:
                low, high = ranges.get(name, (np.inf, -np.inf))
                ranges[name] = (min(low, float(values.min())), max(high, float(values.max())))


def render_page(sequence: FrameSequence, scores: Scores, data: dict, command: str = "") -> str:
    """The text of index.html."""
    environment = jinja2.Environment(loader=jinja2.PackageLoader("onespp.denoise.report", "page"),
                                     autoescape=True, undefined=jinja2.StrictUndefined,
                                     trim_blocks=True, lstrip_blocks=True)
    source = environment.loader
    assert source is not None
    def text(name: str) -> str:
        return source.get_source(environment, name)[0]
    columns, rows = table_data(scores)
    return environment.get_template("page.html.j2").render(
        scores=scores, about=sequence.manifest.about, tiles=highlights(scores),
        caption=caption(scores), columns=columns, rows=rows, best=best_cells(scores, columns),
        made=provenance(sequence, scores, command), style=text("page.css"),
        glossy="roughness" in sequence.channels,
        script="\n".join(text(name) for name in _SCRIPTS),
        data=_safe(data))
