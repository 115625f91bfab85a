"""Scores of a sequence, what got better or worse, and the report."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from onespp.denoise.metrics.own_metric import own_metrics
from onespp.denoise.metrics.table import MEASURES
from onespp.denoise.own_method import result_name
from onespp.denoise.score.compare import (
    Comparison,
    Threshold,
    comparison,
    parse_thresholds,
)
from onespp.denoise.score.scorecard import INPUT, Scores, read_scores
from onespp.denoise.score.sequence import score as score_sequence
from onespp.render.errors import InputError
from onespp.render.files.lock import writing
from onespp.render.files.sequence import FrameSequence

from .caller import caller, public


@public
def score(sequence: FrameSequence, methods: Iterable[str] | None = None, *,
          metrics: Iterable[str] = (), seeds: Iterable[FrameSequence] = (),
          pictures: bool = False, movie: bool | None = None) -> Scores:
    """Score the input and the results of methods against the references of a sequence.

    Errors are of display values (clipped sRGB) or of linear radiance; `onespp.metrics()` says
    which. Without references there are times alone.

    Args:
        methods: names of results; default all that are there.
        metrics: of your own to measure beside ours: files, as "my_metric.py:lpips_like", or names
            of installed ones.
        seeds: renders of the same with other seeds, denoised alike: they split the error into bias
            and variance.
        pictures: also draw contact sheets, plot and movie into the folder.
        movie: with or without the movie; None: with it where PyAV is installed.

    Returns:
        The scores, which are also in scores.json and scores.csv of the folder. In a notebook a
        table; `scores.methods["svgf"]["psnr_srgb"]` is one number, `scores.to_pandas()` all.

    Raises:
        InputError: an unknown method, no frames, or `seeds` that are of something else.

    Example:
        >>> import onespp
        >>> sequence = onespp.render("box", frames=2, size=(12, 16), reference_spp=16)
        >>> scores = onespp.score(onespp.denoise(sequence, "atrous"))
        >>> scores.methods["atrous"]["psnr_srgb"] > scores.methods["input"]["psnr_srgb"]
        True
    """
    if not isinstance(sequence, FrameSequence):
        raise InputError(f"score takes a sequence, not a {type(sequence).__name__}: "
                         "onespp.open(folder) gives one")
    if movie:
        from onespp.denoise.report.movie import require_av

        require_av()
    names = [methods] if isinstance(methods, str) else list(methods or ())
    own = own_metrics([metrics] if isinstance(metrics, str) else metrics)
    with writing(sequence.folder, "score"), caller().progress() as report:
        scores = score_sequence(sequence, names or None, report, list(seeds), caller().command(),
                                own)
        if pictures:  # after the scores, which are on disk whatever happens here
            from onespp.denoise.report.contact_sheets import draw_pictures

            drawn = [result_name(m) for m in names if m != INPUT]
            trouble = draw_pictures(sequence, scores, drawn or None, report,
                                    movie=movie is not False)
            scores = scores.model_copy(update={"notes": [*scores.notes, *trouble]})
    return scores


@public
def compare(a: Scores | Path | str, b: Scores | Path | str,
            methods: Iterable[str] | None = None,
            thresholds: Mapping[str, float | str | Threshold] | None = None) -> Comparison:
    """What got better or worse from the scores `a` to the later scores `b` of the same frames.

    Args:
        a, b: scores, or the paths of two scores.json.
        methods: to compare; default all that both have.
        thresholds: measure -> what it may get worse by, in its unit or, as "5%", relatively.

    Returns:
        `changes`, one of each method and measure, with standard errors; `failed` is true where one
        got worse past its threshold.

    Raises:
        InputError: scores of different sequences, nothing in common, or an unknown method.

    Example:
        >>> import onespp
        >>> sequence = onespp.render("box", frames=2, size=(12, 16), reference_spp=16)
        >>> scores = onespp.score(sequence)
        >>> onespp.compare(scores, scores).failed
        False
    """
    old, new = (scores if isinstance(scores, Scores) else read_scores(Path(scores))
                for scores in (a, b))
    own = {**old.own_metrics, **new.own_metrics}
    limits = {name: limit if isinstance(limit, Threshold) else
              parse_thresholds((f"{name}={limit}",), own)[name]
              for name, limit in (thresholds or {}).items()}
    return comparison(old, new, list(methods or ()) or None, limits)


LARGEST_INLINE = 32 << 20
"""Bytes of a report that a notebook shows inline: it keeps them in its file."""


@dataclass(frozen=True)
class Report:
    """A written report: `path` is its index.html, which opens in any browser."""

    path: Path

    def _repr_html_(self) -> str:
        """The page itself, for a notebook, or where it is if it is large."""
        size = sum(file.stat().st_size for file in self.path.parent.rglob("*.*"))
        if size > LARGEST_INLINE:
            return (f"<div>The report has {size >> 20} MB, too many for a notebook: open "
                    f"<code>{html.escape(str(self.path))}</code> in a browser, or write it with "
                    "fewer channels, as <code>channels=[]</code>.</div>")
        from onespp.denoise.report.html import inlined

        page = html.escape(inlined(self.path))
        return (f'<iframe srcdoc="{page}" style="width:100%;height:800px;border:0" '
                'title="report"></iframe>')


@public
def report(sequence: FrameSequence, channels: Iterable[str] | None = None) -> Report:
    """Write a report of a sequence that opens in any browser: plots, table, and a viewer.

    Scores it first, where it has no scores yet.

    Args:
        channels: of the frames to show beside colour; default all. Fewer make a smaller folder.

    Returns:
        Where it is. In a notebook it is shown inline.

    Raises:
        InputError: an unknown channel, no frames, or a file that cannot be read or written.

    Example:
        >>> import onespp
        >>> sequence = onespp.render("box", frames=1, size=(12, 16), reference_spp=16)
        >>> onespp.report(sequence, channels=["albedo"]).path.name
        'index.html'
    """
    from onespp.denoise.report.html import write_report

    path = sequence.folder / "scores.json"
    scores = read_scores(path) if path.exists() else score(sequence)
    names = None if channels is None else list(channels)
    with writing(sequence.folder, "report"), caller().progress() as follow:
        return Report(write_report(sequence, scores, names, follow, caller().command()))


@public
def metrics() -> dict[str, str]:
    """The measures of error by name, and their definitions.

    Example:
        >>> import onespp
        >>> onespp.metrics()["smape"]
        'mean(|a - b| / (|a| + |b| + 0.01)), linear'
    """
    return {name: metric.about for name, metric in MEASURES.items()}
