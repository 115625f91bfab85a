"""The house as a drawing: every folder a room, every import between two rooms an arrow down.

    python docs/draw_architecture.py > architecture.svg

Read from the imports of the source files by `ast`, so that it shows what is there: nothing is
imported, and no list of rooms is kept. `docs/conf.py` puts it into the architecture page.

A room is a folder. Where a folder has folders inside, its own files are two rooms: those that use
what is in the folders stand above them, the others below (`render/job` above the tracer,
`render/frame` below). An arrow from a to b that another way from a to b implies is left out of the
drawing (`reduced`); the table of `rooms_table` has all of them.

Layout: rooms on layers (the longest way down), long arrows broken at the layers they cross, the
order within a layer by barycentres, places by pulling every room towards its neighbours.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from pathlib import Path
from statistics import fmean

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("scenes", "render", "denoise")
NAME = "onespp"

LONGEST_TITLE = 21  # letters
ROOM_WIDTH, LINE, MARGIN, GAP, LAYER_GAP, DUMMY = 158, 13, 8, 16, 44, 6
LETTERS = 27     # of file names in a line of a room
SWEEPS = 24


@dataclass
class Room:
    """A folder, or the upper or lower part of its own files.

    Attributes:
        title: path of the folder.
        files: names of the files, without `.py`. lines: of code and text in them, together.
        about: the first sentence of the folder's docstring.
        below: keys of the rooms whose files it imports.
    """

    title: str
    files: list[str] = field(default_factory=list)
    lines: int = 0
    about: str = ""
    below: set[str] = field(default_factory=set)


def modules(root: Path = ROOT) -> dict[str, Path]:
    """Dotted name (without the project's own name in front) -> file, of all that is shipped."""
    found = {}
    for path in [*root.glob(f"{NAME}.py"), *root.glob(f"{NAME}/**/*.py"),
                 *(p for package in PACKAGES for p in root.glob(f"{package}/**/*.py"))]:
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(name: str, path: Path, known: Iterable[str]) -> set[str]:
    """Modules out of `known` that a module imports, wherever in its text."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    wanted = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            wanted += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[:len(package.split(".")) + 1 - node.level]
            start = ".".join([*(base if node.level else []), *filter(None, [node.module])])
            wanted += [f"{start}.{alias.name}" for alias in node.names]
    return {module for name_ in wanted if (module := _module_of(name_, known))} - {name}


def _module_of(dotted: str, known: Iterable[str]) -> str | None:
    """The longest known module that a dotted name begins with."""
    parts = dotted.split(".")
    if parts[0] == NAME and len(parts) > 1 and parts[1] in PACKAGES:
        parts = parts[1:]
    for length in range(len(parts), 0, -1):
        if (name := ".".join(parts[:length])) in known:
            return name
    return None


def rooms(root: Path = ROOT) -> dict[str, Room]:
    """Key -> room, with what each imports."""
    paths = modules(root)
    uses = {name: imports(name, path, paths) for name, path in paths.items()}
    paths = {name: path for name, path in paths.items() if path.name != "__main__.py"
             and (path.name != "__init__.py" or uses[name])}
    folder_of = {name: path.parent if path.parent != root else root / NAME
                 for name, path in paths.items()}
    key_of = {}
    for name, folder in folder_of.items():
        title = folder.relative_to(root).as_posix()
        inner = {other for other, at in folder_of.items() if folder in at.parents}
        key_of[name] = f"{title}^" if inner & _reached(name, uses, inner) else title
    found: dict[str, Room] = {}
    for name, path in paths.items():
        title = key_of[name].rstrip("^")
        room = found.setdefault(key_of[name], Room(title, about=_about(root / title)))
        text = path.read_text("utf-8")
        room.files.append(path.stem if path.name != "__init__.py" else "(package)")
        room.lines += text.count("\n")
        room.below |= {key_of[used] for used in uses[name] if used in key_of}
    for key, room in found.items():
        room.files.sort()
        room.below.discard(key)
    return found


def _reached(name: str, uses: Mapping[str, set[str]], goal: set[str]) -> set[str]:
    """Modules of `goal` that can be reached by imports; the search does not go past them."""
    seen, open_ = set(), [name]
    while open_:
        for used in uses[open_.pop()] - seen:
            seen.add(used)
            if used not in goal and used.split(".")[0] == name.split(".")[0]:
                open_.append(used)
    return seen & goal


def _about(folder: Path) -> str:
    init = folder / "__init__.py"
    text = ast.get_docstring(ast.parse(init.read_text("utf-8"))) if init.exists() else None
    return " ".join((text or "").split("\n\n")[0].split())


def below_all(rooms: Mapping[str, Room]) -> dict[str, set[str]]:
    """Room -> all rooms that it depends on, by whatever way."""
    found = {key: set(room.below) for key, room in rooms.items()}
    for middle in rooms:
        for below in found.values():
            if middle in below:
                below |= found[middle]
    return found


def circles(rooms: Mapping[str, Room]) -> list[tuple[str, str]]:
    """Pairs of rooms that import each other, by whatever way."""
    below = below_all(rooms)
    return sorted((a, b) for a in rooms for b in rooms
                  if a < b and a in below[b] and b in below[a])


def layers(rooms: Mapping[str, Room]) -> dict[str, int]:
    """Room -> the length of the longest way down from it; rooms of a circle share a layer."""
    below = below_all(rooms)
    group = {a: frozenset({a} | {b for b in below[a] if a in below[b]}) for a in rooms}
    level: dict[str, int] = {}

    def place(key: str) -> int:
        if key not in level:
            out = {b for a in group[key] for b in rooms[a].below} - group[key]
            level.update(dict.fromkeys(group[key], 1 + max(map(place, sorted(out)), default=-1)))
        return level[key]

    for key in sorted(rooms):
        place(key)
    return level


def reduced(rooms: Mapping[str, Room]) -> list[tuple[str, str]]:
    """The arrows that no longer way implies; all of them within a circle."""
    below = below_all(rooms)
    return [(a, b) for a in sorted(rooms) for b in sorted(rooms[a].below)
            if not any(b in below[c] and a not in below[c] for c in rooms[a].below - {b})]


# A point of the drawing is a room's key, or (a, b, layer) where the arrow from a to b crosses one.
Point = str | tuple[str, str, int]


def arrange(rooms: Mapping[str, Room]) -> tuple[list[list[Point]], dict[Point, float],
                                               list[list[Point]]]:
    """Points on each layer (the lowest first), their x, and the arrows as lists of points."""
    level = layers(rooms)
    rows: list[list[Point]] = [[] for _ in range(1 + max(level.values(), default=0))]
    for key in sorted(rooms):
        rows[level[key]].append(key)
    ways: list[list[Point]] = []
    for a, b in reduced(rooms):
        crossed: list[Point] = [(a, b, k) for k in range(level[a] - 1, level[b], -1)]
        for k, point in zip(range(level[a] - 1, level[b], -1), crossed):
            rows[k].append(point)
        ways.append([a, *crossed, b])
    near: dict[Point, list[Point]] = {point: [] for row in rows for point in row}
    for way in ways:
        for p, q in pairwise(way):
            near[p].append(q)
            near[q].append(p)
    where = {point: float(i) for row in rows for i, point in enumerate(row)}
    for sweep in range(SWEEPS):
        for k in (range(len(rows)) if sweep % 2 else reversed(range(len(rows)))):
            row = rows[k]
            centre = {p: fmean([where[q] for q in near[p]] or [where[p]]) for p in row}
            row.sort(key=centre.__getitem__)
            where.update({p: i / max(1, len(row) - 1) for i, p in enumerate(row)})
    x = {p: i * (ROOM_WIDTH + GAP) / 2 for row in rows for i, p in enumerate(row)}
    for _ in range(SWEEPS):
        for row in rows:
            _pull(row, {p: fmean([x[q] for q in near[p]] or [x[p]]) for p in row}, x)
    return rows, x, ways


def _width(point: Point) -> float:
    return ROOM_WIDTH if isinstance(point, str) else DUMMY


def _pull(row: list[Point], wish: dict[Point, float], x: dict[Point, float]) -> None:
    """Each point to where it wants to be, as far as the order and the widths of the row let it."""
    blocks: list[tuple[float, list[Point]]] = []  # (x of the first, points side by side)
    for point in row:
        members, start = [point], wish[point]
        while blocks and blocks[-1][0] + _offsets([*blocks[-1][1], members[0]])[-1] > start:
            members = blocks.pop()[1] + members
            start = fmean(wish[p] - offset for p, offset in zip(members, _offsets(members)))
        blocks.append((start, members))
    for start, members in blocks:
        x.update({p: start + offset for p, offset in zip(members, _offsets(members))})


def _offsets(points: list[Point]) -> list[float]:
    offsets = [0.0]
    for p, q in pairwise(points):
        offsets.append(offsets[-1] + (_width(p) + _width(q)) / 2 + GAP)
    return offsets


def _short(title: str) -> str:
    """A path that fits into a room's width; of a long one its last part, with its folder's colour
    and place to tell the rest."""
    return title if len(title) <= LONGEST_TITLE else f"…/{title.rpartition('/')[2]}"


def text_of(room: Room) -> list[str]:
    """A room's lines of file names."""
    found, line = [], ""
    for name in room.files:
        if line and len(line) + 1 + len(name) > LETTERS:
            found.append(line)
            line = ""
        line = f"{line} {name}" if line else name
    return [*found, line]


def svg(rooms: Mapping[str, Room]) -> str:
    """The drawing, without an empty line in it, for light and dark pages."""
    rows, x, ways = arrange(rooms)
    height = {key: 2 * MARGIN + LINE * (2 + len(text_of(room))) for key, room in rooms.items()}
    y, top = {}, 4.0
    for row in reversed(rows):
        tallest = max(height[p] for p in row if isinstance(p, str))
        y.update(dict.fromkeys(row, top))
        top += tallest + LAYER_GAP
    left = min(x[p] - _width(p) / 2 for p in x) - 4
    right = max(x[p] + _width(p) / 2 for p in x) + 4
    up = {pair for a, b in circles(rooms) for pair in ((a, b), (b, a))}
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" class="house" role="img" '
             f'viewBox="{left:.0f} 0 {right - left:.0f} {top - LAYER_GAP + 8:.0f}" '
             f'style="max-width: {right - left:.0f}px">',
             f"<title>{len(rooms)} rooms and the imports between them, downwards</title>",
             f"<style>{STYLE}</style>",
             '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" '
             'markerHeight="6" orient="auto">',
             '<path class="head" d="M0 0L8 4L0 8z"/></marker></defs>']
    for way in ways:
        points = [(x[p], y[p]) for p in way]
        path = f"M{points[0][0]:.0f} {y[way[0]] + height[str(way[0])]:.0f}"
        for p, q in pairwise(way):
            start = y[p] + (height[p] if isinstance(p, str) else
                            max(height[r] for r in rooms if y[r] == y[p]))
            if not isinstance(p, str):
                path += f"V{start:.0f}"
            middle = (start + y[q]) / 2
            path += f"C{x[p]:.0f} {middle:.0f} {x[q]:.0f} {middle:.0f} {x[q]:.0f} {y[q]:.0f}"
        wrong = " wrong" if (way[0], way[-1]) in up else ""
        lines.append(f'<path class="way {_kind(rooms, way[0])}{wrong}" d="{path}" '
                     'marker-end="url(#head)"/>')
    for key, room in rooms.items():
        lines += _drawn(room, x[key] - ROOM_WIDTH / 2, y[key], height[key])
    return "\n".join([*lines, "</svg>"])


def _kind(rooms: Mapping[str, Room], key: Point) -> str:
    package = rooms[str(key)].title.split("/")[0]
    return package if package in PACKAGES else "top"


def _drawn(room: Room, x: float, y: float, height: float) -> list[str]:
    package = room.title.split("/")[0]
    count = f"{len(room.files)} file{'s' * (len(room.files) > 1)}, {room.lines} lines"
    texts = [("title", _short(room.title)), ("count", count), *(("file", t) for t in text_of(room))]
    return [f'<g class="room {package if package in PACKAGES else "top"}">',
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{ROOM_WIDTH}" height="{height}" rx="5"/>',
            *(f'<text class="{kind}" x="{x + MARGIN:.0f}" '
              f'y="{y + MARGIN + LINE * (i + 0.8):.0f}">{escape(text)}</text>'
              for i, (kind, text) in enumerate(texts)),
            "</g>"]


STYLE = """
.house { width: 100%; height: auto; font-family: system-ui, sans-serif; color: inherit; }
.house text { fill: currentColor; } .house .title { font-size: 11.5px; font-weight: 600; }
.house .count { font-size: 9.5px; opacity: 0.65; } .house .file { font-size: 9.5px; }
.house rect { fill-opacity: 0.14; stroke-width: 1.2; }
.house .way { fill: none; stroke-width: 1.2; opacity: 0.75; } .house .head { fill: #808890; }
.house .scenes rect { fill: #2a9d57; stroke: #2a9d57; } .house .way.scenes { stroke: #2a9d57; }
.house .render rect { fill: #2f7fd1; stroke: #2f7fd1; } .house .way.render { stroke: #2f7fd1; }
.house .denoise rect { fill: #d9822b; stroke: #d9822b; } .house .way.denoise { stroke: #d9822b; }
.house .top rect { fill: #808890; stroke: #808890; } .house .way.top { stroke: #808890; }
.house .way.wrong { stroke: #d11; stroke-dasharray: 4 3; opacity: 1; }
""".strip()


def rooms_table(rooms: Mapping[str, Room]) -> str:
    """All rooms and all arrows, as Markdown, from the top down."""
    level = layers(rooms)
    titles = {key: f"`{room.title}`" + (" (upper files)" if key.endswith("^") else "")
              for key, room in rooms.items()}
    lines = ["| folder | what it is for | files | lines | imports |",
             "| --- | --- | --- | --- | --- |"]
    for key in sorted(rooms, key=lambda k: (-level[k], k)):
        room = rooms[key]
        below = ", ".join(titles[k] for k in sorted(room.below, key=lambda k: (-level[k], k)))
        lines.append(f"| {titles[key]} | {room.about.replace('|', '/')} | {len(room.files)} | "
                     f"{room.lines} | {below or 'nothing of ours'} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(svg(rooms()))
