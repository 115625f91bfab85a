"""How far a method is ahead of the best form of OIDN wherever that is to hold, as Markdown.

A case is a scene with its frames as they are rendered, or plain ones (exported to the layout of
GAMES202 and imported again: colour, guides and matrices alone). On each, the lead is the method's
mean PSNR over that of the best of some peers, the best by that very number; flicker is its share of
the same peer's. Classes of pixels are pooled over all cases that are not plain: squared errors
weighed by pixels, and against the peer that is best in the class.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from onespp.denoise.score.scorecard import INPUT, Scores
from onespp.render.errors import InputError

from .lead import OIDN_FORMS, psnr_of

PLAIN_PEERS = ("oidn-high", "temporal-oidn")
CLASSES: tuple[str, ...] = ("static", "moving", "disoccluded", "light", "edge", "glossy")
CLASS_LEAD = 1.0  # dB


@dataclass(frozen=True)
class Group:
    """Cases with one target: least mean and least single lead in dB, largest share of flicker.

    scenes: names; plain: their frames are exported and imported. None: not asked for.
    """

    title: str
    scenes: tuple[str, ...]
    plain: bool = False
    mean: float | None = None
    least: float | None = None
    flicker: float | None = None

    @property
    def peers(self) -> tuple[str, ...]:
        return PLAIN_PEERS if self.plain else OIDN_FORMS


def groups(kept: Sequence[str], hard: Sequence[str]) -> tuple[Group, ...]:
    """What is asked for; kept: scenes that nothing was tuned on. hard: scenes that break things."""
    return (Group("box", ("box",), least=2.5, flicker=0.5),
            Group("room", ("room",), least=2.0, flicker=0.5),
            Group("kept scenes", tuple(kept), mean=2.0, least=0.5, flicker=0.6),
            Group("hard scenes", tuple(hard), mean=2.0, least=0.0),
            Group("plain frames", ("box", "room", *kept[:6]), plain=True, least=1.0))


@dataclass(frozen=True)
class Lead:
    """A method and the best peer in a case, dB; flicker: the method's share of that peer's."""

    scene: str
    method: float
    peer_name: str
    peer: float
    flicker: float | None
    floor: float | None

    @property
    def ahead(self) -> float:
        return self.method - self.peer


def lead(scene: str, scores: Scores, method: str, peers: Iterable[str]) -> Lead:
    """The lead in one case.

    Raises:
        InputError: the scores lack the method or a peer, or have no PSNR.
    """
    for name in (method, *peers):
        if name not in scores.methods:
            raise InputError(f"the scores of {scene} lack '{name}': denoise by it and score")
    best = max(peers, key=lambda name: psnr_of(scores.methods[name]))
    ours, other = (scores.methods[name]["flicker"] for name in (method, best))
    share = ours / other if ours is not None and other else None
    return Lead(scene, psnr_of(scores.methods[method]), best, psnr_of(scores.methods[best]), share,
                scores.headline_floor)


def class_leads(cases: Iterable[Scores], method: str,
                peers: Sequence[str]) -> dict[str, tuple[float, str, float]]:
    """Class -> (lead in dB, best peer, share of all pixels), pooled over cases."""
    error: dict[str, dict[str, float]] = {
        name: dict.fromkeys(CLASSES, 0.0) for name in (method, *peers)}
    pixels: dict[str, float] = dict.fromkeys(CLASSES, 0.0)
    everything = 0.0
    for scores in cases:
        size = scores.size[0] * scores.size[1] * max(len(scores.frames) - 1, 0)
        everything += size
        for name, total in error.items():
            for cause in CLASSES:
                found = scores.methods[name].by_cause.get(cause)
                if found is not None and found.psnr_srgb is not None:
                    total[cause] += found.pixels * size * 10 ** (-found.psnr_srgb / 10)
                    pixels[cause] += found.pixels * size * (name == method)
    leads = {}
    for cause in CLASSES:
        if pixels[cause] and error[method][cause]:
            best = min(peers, key=lambda name: error[name][cause])
            ratio = error[best][cause] / error[method][cause]
            leads[cause] = (10 * math.log10(ratio) if ratio else -math.inf, best,
                            pixels[cause] / everything)
    return leads


def figures(method: str, found: Mapping[Group, Mapping[str, Scores]]) -> dict[str, object]:
    """What `markdown` shows, unrounded: cases of each group, and classes of pixels."""
    split = [s for group, scored in found.items() if not group.plain for s in scored.values()]
    return {
        "method": method,
        "groups": {group.title: [{**asdict(one), "ahead": one.ahead} for one in (
            lead(scene, scores, method, group.peers) for scene, scores in scored.items())]
            for group, scored in found.items()},
        "classes": {cause: {"ahead": ahead, "peer": best, "share": share} for cause, (
            ahead, best, share) in class_leads(split, method, OIDN_FORMS).items()}}


def markdown(method: str, found: Mapping[Group, Mapping[str, Scores]]) -> str:
    """A table of cases, one of targets, and one of classes of pixels."""
    cases = ["| scene | floor, dB | input | `" + method + "` | best form of OIDN | lead, dB | "
             "flicker, share |", "| --- |" + " --- |" * 6]
    targets = ["| target | wanted | found | |", "| --- | --- | --- | --- |"]
    split: list[Scores] = []
    for group, scored in found.items():
        leads = []
        for scene, scores in scored.items():
            one = lead(scene, scores, method, group.peers)
            leads.append(one)
            label = f"{scene}, plain" if group.plain else scene
            cases.append(
                f"| {label} | {_number(one.floor, '.1f')} "
                f"| {psnr_of(scores.methods[INPUT]):.2f} | {one.method:.2f} "
                f"| {one.peer:.2f} `{one.peer_name}` | {one.ahead:+.2f} "
                f"| {_number(one.flicker, '.2f')} |")
        targets += _targets(group, leads)
        if not group.plain:
            split += scored.values()
    classes = class_leads(split, method, OIDN_FORMS)
    targets += [f"| {cause} pixels ({share:.1%} of all), pooled: lead over `{best}` "
                f"| {CLASS_LEAD:+.1f} dB | {ahead:+.2f} dB | {_verdict(ahead >= CLASS_LEAD)} |"
                for cause, (ahead, best, share) in classes.items()]
    return "\n".join([*cases, "", *targets])


def _targets(group: Group, leads: Sequence[Lead]) -> list[str]:
    """Rows of the table of targets."""
    if not leads:
        return []
    ahead = [one.ahead for one in leads]
    flicker = [one.flicker for one in leads if one.flicker is not None]
    worst = min(leads, key=lambda one: one.ahead)
    rows = []
    if group.mean is not None:
        mean = float(np.mean(ahead))
        rows.append((f"{group.title}: mean lead", f"{group.mean:+.1f} dB", f"{mean:+.2f} dB",
                     mean >= group.mean))
    if group.least is not None:
        where = f" (`{worst.scene}`)" if leads[1:] else ""
        rows.append((f"{group.title}: least lead", f"{group.least:+.1f} dB",
                     f"{worst.ahead:+.2f} dB{where}", worst.ahead >= group.least))
    if group.flicker is not None and flicker:
        share = float(np.mean(flicker))
        rows.append((f"{group.title}: flicker, mean share", f"{group.flicker}", f"{share:.2f}",
                     share <= group.flicker))
    return [f"| {what} | {wanted} | {value} | {_verdict(held)} |"
            for what, wanted, value, held in rows]


def _verdict(held: bool) -> str:
    return "held" if held else "**missed**"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
