"""Speed against error: one point a method, up and to the left is better."""

from __future__ import annotations

from pathlib import Path

from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from onespp.denoise.metrics.table import HEADLINE
from onespp.denoise.score.scorecard import INPUT, Scores
from onespp.render.files.atomic import replacing

FAR = 8.0  # dB; a floor further above the best method would flatten what is to be compared
_GAP = 20  # pixels of a name from the axis, which names on the right may move
_GREY, _INK = "#8a8f98", "#22252b"


def pareto_front(points: dict[str, tuple[float, float]]) -> list[str]:
    """Names of the (ms, dB) points that no other point beats in both, fastest first."""
    front: list[str] = []
    for name in sorted(points, key=lambda n: (points[n][0], -points[n][1])):
        if not front or points[name][1] > points[front[-1]][1]:
            front.append(name)
    return front


def plot_speed_against_error(scores: Scores, path: Path) -> bool:
    """Write the plot as a PNG; if no method has both a time and an error, remove an old one.

    Returns:
        whether there was anything to plot.
    """
    points = {name: (ms, db) for name, method in scores.methods.items()
              if (ms := method.ms_per_frame) and (db := method[HEADLINE.name]) is not None}
    if not points:
        path.unlink(missing_ok=True)
        return False
    layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.12)  # inches
    figure = Figure(figsize=(9, 5.4), dpi=160, layout=layout)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _style(axes, scores)
    _levels(axes, scores, max(db for _, db in points.values()))
    front = pareto_front(points)
    axes.plot(*zip(*(points[n] for n in front)), color=_GREY, lw=1.4, zorder=2,
              drawstyle="steps-post", label="Pareto front")
    low, high = min(ms for ms, _ in points.values()), max(ms for ms, _ in points.values())
    axes.set_xlim(low / 2, high * 3)
    axes.margins(y=0.1)
    colours = colormaps["tab10"].colors
    turns = [scores.methods[name].interleaved for name in points]
    for i, (ms, db) in enumerate(points.values()):
        hollow = any(turns) and not turns[i]
        axes.scatter(ms, db, s=70 if hollow else 95, color="white" if hollow else colours[i % 10],
                     edgecolor=colours[i % 10] if hollow else "white", lw=2.2 if hollow else 1.2,
                     zorder=4)
    axes.set_xlabel(f"ms per frame (log scale), {times_are(turns)}", color=_INK)
    _label(figure, axes, points)
    with replacing(path) as part:
        figure.savefig(part, format="png", facecolor="white")
    return True


def times_are(in_turns: list[bool]) -> str:
    """How times were measured, for methods that were or were not timed in turns."""
    if all(in_turns):
        return "medians of times measured in turns"
    if not any(in_turns):
        return "medians after the first, of each method's own run"
    return "measured in turns (filled) or medians of their own runs (hollow)"


def _style(axes, scores: Scores) -> None:
    width, height = scores.size
    axes.set_title(f"{scores.scene}: speed against error", loc="left", color=_INK, fontsize=14,
                   fontweight="bold", pad=24, parse_math=False)  # a scene may be called a$b_$
    spp, reference = (n or "unknown" for n in (scores.spp, scores.reference_spp))
    axes.text(0, 1.02, f"{len(scores.frames)} frames, {width}x{height}, {spp} spp, "
              f"reference {reference} spp", transform=axes.transAxes,
              color=_GREY, fontsize=10)
    axes.set_xscale("log")
    axes.set_ylabel(f"{HEADLINE.label} in {HEADLINE.unit} ({scores.tone_map})", color=_INK)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(colors=_INK, which="both")
    axes.grid(color="#e6e8eb", lw=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _levels(axes, scores: Scores, best: float) -> None:
    """Horizontal lines for the input and for what the reference's noise allows."""
    def line(db: float, style: tuple[int, tuple[int, int]], text: str) -> None:
        axes.axhline(db, color=_GREY, lw=1.2, ls=style, zorder=1)
        axes.annotate(text, (1, db), xycoords=("axes fraction", "data"), xytext=(0, 3),
                      textcoords="offset points", ha="right", color=_GREY, fontsize=9.5)

    noisy = scores.methods[INPUT][HEADLINE.name] if INPUT in scores.methods else None
    if noisy is not None:
        line(noisy, (0, (6, 3)), f"input, {noisy:.1f} dB")
    floor = scores.headline_floor
    if floor is None:
        return
    if floor < best + FAR:
        line(floor, (0, (1, 2)), f"reference's noise floor, {floor:.1f} dB")
    else:
        axes.text(1, 1.02, f"reference's noise floor: {floor:.1f} dB", ha="right", color=_GREY,
                  fontsize=10, transform=axes.transAxes)


def _label(figure: Figure, axes, points: dict[str, tuple[float, float]]) -> None:
    """Name the points, each in the first place around it that is still free, moved to the right
    where it would lie across the axis."""
    places = [(0, 9, "center", "bottom"), (11, 0, "left", "center"), (0, -9, "center", "top"),
              (-11, 0, "right", "center"), (9, 9, "left", "bottom"), (9, -9, "left", "top"),
              (-9, 9, "right", "bottom"), (-9, -9, "right", "top")]
    figure.draw_without_rendering()  # so that extents are known
    taken = []
    for x, y in axes.transData.transform(list(points.values())):
        taken.append((x - 12, y - 12, x + 12, y + 12))
    for name, (ms, db) in points.items():
        text = None
        for dx, dy, ha, va in places:
            if text:
                text.remove()
            text = axes.annotate(f"{name}  {db:.1f}", (ms, db), xytext=(dx, dy), ha=ha, va=va,
                                 textcoords="offset points", color=_INK, fontsize=10.5, zorder=5,
                                 path_effects=[withStroke(linewidth=3.5, foreground="white")])
            box = text.get_window_extent(figure.canvas.get_renderer())
            across = max(axes.bbox.x0 + _GAP - box.x0, 0)
            if across:
                text.set_position((dx + across * 72 / figure.dpi, dy))
                box = box.translated(across, 0)
            if not any(box.x0 < x1 and x0 < box.x1 and box.y0 < y1 and y0 < box.y1
                       for x0, y0, x1, y1 in taken):
                break
        taken.append((box.x0, box.y0, box.x1, box.y1))
