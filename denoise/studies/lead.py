"""How far a method is ahead of a peer, as Markdown.

For each scene two scored folders: frames of the plain estimator, which any renderer gives, and of
ours; the peer gets both inputs, the method the second. Everything is read from their scores.json.

The peer `BEST` is, on each of them, the one of `OIDN_FORMS` that has the highest mean PSNR there:
chosen with knowledge of the truth, in its favour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from onespp.denoise.score.method_score import MethodScore
from onespp.denoise.score.scorecard import Scores
from onespp.render.errors import InputError

BEST = "best"
OIDN_FORMS = ("oidn-high", "oidn-split", "temporal-oidn", "temporal-oidn-split")
CAUSES = ("glossy", "disoccluded", "light")


@dataclass(frozen=True)
class Pair:
    """A method and a peer on one scene; `plain` is the peer on the plain input."""

    method: MethodScore
    peer: MethodScore
    plain: MethodScore


def peer_in(scores: Scores, peer: str, where: str) -> str:
    """The method that a peer's name stands for in some scores.

    Raises:
        InputError: the scores, which are those of `where`, lack it.
    """
    forms = OIDN_FORMS if peer == BEST else (peer,)
    there = [form for form in forms if form in scores.methods]
    if not there:
        wanted = " or ".join(f"'{form}'" for form in forms)
        raise InputError(f"the scores of {where} lack {wanted}: denoise by it and score")
    return max(there, key=lambda form: psnr_of(scores.methods[form])) if there[1:] else there[0]


def psnr_of(score: MethodScore, frame: int | None = None) -> float:
    value = score["psnr_srgb"] if frame is None else score.per_frame[frame]["psnr_srgb"]
    if value is None:
        raise InputError("the scores hold no PSNR: score a sequence that has a reference")
    return value


def _worst(pair: Pair) -> float | None:
    leads = [psnr_of(pair.method, i) - psnr_of(pair.peer, i)
             for i in range(1, len(pair.method.per_frame))]
    return min(leads, default=None)


def _ratio(measure: str) -> Callable[[Pair], float | None]:
    def ratio(pair: Pair) -> float | None:
        a, b = pair.method[measure], pair.peer[measure]
        return a / b if a is not None and b else None
    return ratio


def _class_lead(cause: str) -> Callable[[Pair], float | None]:
    def lead(pair: Pair) -> float | None:
        scores = [m.by_cause.get(cause) for m in (pair.method, pair.peer)]
        a, b = (s.psnr_srgb if s else None for s in scores)
        return a - b if a is not None and b is not None else None
    return lead


ROWS: dict[str, tuple[Callable[[Pair], float | None], str]] = {
    "mean PSNR over the peer on plain input, dB": (
        lambda p: psnr_of(p.method) - psnr_of(p.plain), "+.2f"),
    "mean PSNR over the peer on our input, dB": (
        lambda p: psnr_of(p.method) - psnr_of(p.peer), "+.2f"),
    "the same, worst frame after the first, dB": (_worst, "+.2f"),
    "the same, first frame, dB": (lambda p: psnr_of(p.method, 0) - psnr_of(p.peer, 0), "+.2f"),
    "FLIP, share of the peer's": (_ratio("flip"), ".2f"),
    "flicker, share of the peer's": (_ratio("flicker"), ".2f"),
    **{f"PSNR over the peer on {cause} pixels, dB": (_class_lead(cause), "+.2f")
       for cause in CAUSES},
    "energy off by": (lambda p: p.method["energy_error"], ".2%"),
}


Figures = dict[str, dict[str, "float | None"]]
"""Row of the table -> scene -> value."""


def measure(method: str, peer: str, scenes: dict[str, tuple[Scores, Scores]]) -> Figures:
    """The figures; scenes: name -> scores of plain and of our input.

    Raises:
        InputError: a folder's scores lack the method or the peer.
    """
    pairs = {}
    for name, (plain, ours) in scenes.items():
        if method not in ours.methods:
            raise InputError(f"the scores of {name} lack '{method}': denoise by it and score")
        on_plain, on_ours = (peer_in(scores, peer, name) for scores in (plain, ours))
        pairs[name] = Pair(ours.methods[method], ours.methods[on_ours], plain.methods[on_plain])
    return {row: {name: value(pair) for name, pair in pairs.items()}
            for row, (value, _) in ROWS.items()}


def markdown(method: str, peer: str, scenes: dict[str, tuple[Scores, Scores]]) -> str:
    """The table of what `measure` finds; InputError as there."""
    figures = measure(method, peer, scenes)
    other = "the best form of OIDN" if peer == BEST else f"`{peer}`"
    lines = [f"| `{method}` and {other} | " + " | ".join(scenes) + " |",
             "| --- |" + " --- |" * len(scenes)]
    for row, values in figures.items():
        cells = ["-" if v is None else format(v, ROWS[row][1]) for v in values.values()]
        lines.append(f"| {row} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
