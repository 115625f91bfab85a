"""README.md of a data set: what is in it, for those who meet the folder without us."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from .plan import SPLITS, Plan

_MOST_ROWS = 200


def card(plan: Plan, versions: Mapping[str, str], draws: Mapping[int, Mapping[str, Any]],
         entries: Mapping[int, tuple[str, str, int]]) -> str:
    """The card, in Markdown: equal data sets have equal cards.

    Args:
        draws: number -> what was drawn. entries: number -> (split, digest, bytes).
    """
    size = sum(entry[2] for entry in entries.values())
    frames = len(entries) * plan.frames
    truth = (f"{plan.reference_spp} samples a pixel" if plan.reference_spp else
             f"to {plan.reference_error:g} dB" if plan.reference_error else "none")
    about = [plan.about[:1].upper() + plan.about[1:] + "."] if plan.about else []
    parts = [f"# {plan.name}", *about,
             f"Animated scenes at one sample a pixel, rendered by onespp: {len(entries)} of "
             f"{plan.sequences} sequences of {plan.frames} frames of {plan.width}x{plan.height} "
             f"pixels, {frames} frames in {size / 2**20:.1f} MiB "
             f"({size / max(frames * plan.seeds * plan.width * plan.height, 1):.1f} bytes a pixel "
             "and render).",
             _table([("split", "sequences", "frames"), *(
                 (name, count, count * plan.frames) for name in SPLITS
                 if (count := sum(entry[0] == name for entry in entries.values())))]),
             _table([("what", "value"), ("licence", plan.licence or "not stated"),
                     ("noisy renders of a frame", plan.seeds), ("references", truth),
                     ("channels", plan.channels),
                     ("radiance and guides", "half" if plan.half else "float"),
                     ("seed", plan.seed), ("hash of the plan", plan.key),
                     *((f"version of {name}", text) for name, text in versions.items())]),
             "## Split", _split(plan),
             "## What was drawn", *(_counted(title, counts) for title, counts in _counts(draws)),
             "## To read it", "```python\nimport onespp\n\nclips = onespp.Clips(\"THIS FOLDER\", "
             f"frames={min(8, plan.frames)}, crop={min(plan.width, plan.height, 128)})\n```",
             "`dataset.json` has the whole plan. Each `sequence.json` says what was drawn, and has "
             "the SHA-256 of every file; `onespp dataset --verify` compares them.",
             "## Sequences", _rows(entries)]
    return "\n\n".join(parts) + "\n"


def _split(plan: Plan) -> str:
    out = {name: kinds for name, kinds in vars(plan.held_out).items() if kinds}
    if not out:
        return "By scene, spread evenly over the numbers; nothing is held out."
    said = "; ".join(f"{name} {', '.join(kinds)}" for name, kinds in out.items())
    return (f"By scene, spread evenly over the numbers. Held out for the test split: {said}. "
            "There each thing is of a held-out object or a held-out material, and each place of a "
            "held-out family, where there are any; elsewhere none is.")


def _counts(draws: Mapping[int, Mapping[str, Any]]) -> list[tuple[str, Counter[str]]]:
    found = list(draws.values())
    things = [thing for draw in found for thing in draw["things"]]
    return [*((title, Counter(str(draw[key]) for draw in found)) for title, key in (
        ("families", "family"), ("lights", "light"), ("cameras", "camera"))),
        *((title, counts) for title, counts in [("files", Counter(
            str(draw["file"]) for draw in found if "file" in draw))] if counts),
        *((title, Counter(str(thing[key]) for thing in things)) for title, key in (
            ("objects", "object"), ("materials", "material"), ("motions", "motion")))]


def _counted(title: str, counts: Counter[str]) -> str:
    return f"{title}: " + ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))


def _rows(entries: Mapping[int, tuple[str, str, int]]) -> str:
    shown = sorted(entries.items())[:_MOST_ROWS]
    rows = [("number", "split", "bytes", "digest"),
            *((n, split, size, f"`{digest[:16]}`") for n, (split, digest, size) in shown)]
    more = len(entries) - len(shown)
    return _table(rows) + (f"\n\nand {more} more, see `dataset.json`" if more else "")


def _table(rows: list[tuple[Any, ...]]) -> str:
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])
