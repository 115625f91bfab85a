"""The parts of the documentation that are made from the code, each as Markdown text.

A page says `<!-- from-code: NAME -->` where `PARTS[NAME]()` goes; `docs/conf.py` puts it there when
the pages are built. Parameters are read from the docstrings of the methods' dataclasses, where an
attribute ends with its unit and its range in brackets:

    radius: half width of the square window [pixels, 1 to 64]; each value compiles a kernel.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import click
from draw_architecture import imports, modules, rooms, rooms_table, svg

import onespp
from onespp.cli import app
from onespp.denoise.catalog import METHODS, PEERS, build
from onespp.denoise.methods.outliers import RemoveOutliers
from onespp.denoise.metrics.table import MEASURES
from onespp.denoise.score.causes import CAUSES, HISTORIES
from onespp.render.channels import CHANNELS
from onespp.scenes import catalog
from onespp.scenes.hard import HARD

HEADER = re.compile(r"^(Sources?|Departures|Symbols)\b.*:", re.M)
SOURCES = re.compile(r"^Sources?:(.*?)(?:\n\n|\Z)", re.M | re.S)
WORK = re.compile(r"GAMES202|[A-Z][\w, .-]{0,60}? \d{4}\b")
DOI = r"doi:(10\.[^\s,;)]*[^\s,;).:])"
RANGE = re.compile(r"^(?:(?:above|at least) )?[-+.\deE]+(?: to [-+.\deE]+)?$")


@dataclass(frozen=True)
class Parameter:
    """A parameter as its docstring tells it; `unit` and `range` are "" where it does not."""

    name: str
    default: Any
    unit: str
    range: str
    about: str


def attributes(cls: type) -> dict[str, str]:
    """Name -> what the `Attributes:` of a dataclass, and of those that it extends, say of it."""
    names = "|".join(sorted((f.name for f in fields(cls)), key=len, reverse=True))
    start = re.compile(rf"(?:(?<=\s)|^)((?:{names})(?:, (?:{names}))*): ")
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        section = re.search(r"^Attributes:(.*?)(?=^\S|\Z)", inspect.cleandoc(
            base.__dict__.get("__doc__") or ""), re.M | re.S)
        pieces = start.split(" ".join(section[1].split())) if section else []
        for heads, text in zip(pieces[1::2], pieces[2::2]):
            found.update(dict.fromkeys(heads.split(", "), text.strip()))
    return found


def parameters(method: Any) -> list[Parameter]:
    """Those of a method, then those of its parts (dataclasses that it holds)."""
    about, own, parts = attributes(type(method)), [], []
    for f in fields(method):
        value = getattr(method, f.name)
        if is_dataclass(value):
            parts += parameters(value)
        else:
            own.append(_parameter(f.name, value, about.get(f.name, "")))
    return [*own, *parts]


def _parameter(name: str, value: Any, text: str) -> Parameter:
    found = re.search(r"\s*\[([^\]]*)\]", text)
    unit, _, range_ = (found[1] if found else "").rpartition(", ")
    if found and not RANGE.match(range_):
        unit, range_ = found[1], ""
    about = text.replace(found[0], "", 1) if found else text
    if isinstance(value, bool):
        range_ = "true, false"
    return Parameter(name, value, "" if unit == "1" else unit, range_, about)


def markdown_of(docstring: str) -> str:
    """A module's docstring without its first line, words before a colon bold, DOIs linked."""
    text = inspect.cleandoc(docstring).partition("\n")[2].strip("\n")
    text = re.sub(r"^(Sources?|Departures[^:\n]*|Symbols|Form|Order):", r"**\1:**", text,
                  flags=re.M)
    return re.sub(DOI, r"[doi:\1](https://doi.org/\1)", text)


def cited(name: str) -> str:
    """The works that a method's module names as its sources, in short; what a peer is.

    Of a piece between semicolons that begins with authors and a year, or with the course.
    """
    if name in PEERS:
        return PEERS[name].about.removesuffix(".")
    found = SOURCES.search(sys.modules[METHODS[name].__module__].__doc__ or "")
    works = []
    for piece in " ".join(found[1].split()).split("; ") if found else ():
        if work := WORK.match(piece):
            doi = re.search(DOI, piece)
            works.append(f"[{work[0]}](https://doi.org/{doi[1]})" if doi else work[0])
    return "; ".join(works) or "ours"


def table(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A Markdown table; `|` in a cell is escaped."""
    def line(cells: Iterable[object]) -> str:
        return "| " + " | ".join(str(cell).replace("|", r"\|") for cell in cells) + " |"

    heads = list(heads)
    return "\n".join([line(heads), line(["---"] * len(heads)), *map(line, rows)])


def parameter_table(method: Any) -> str:
    def typed(value: Any) -> str:
        return str(value).lower() if isinstance(value, bool) else str(value)

    return table(("parameter", "default", "range", "unit", "meaning"),
                 ((f"`{p.name}`", f"`{typed(p.default)}`", p.range, p.unit, p.about)
                  for p in parameters(method)))


def first_sentence(cls: type) -> str:
    return " ".join(inspect.cleandoc(cls.__doc__ or "").split("\n\n")[0].split())


def method_list() -> str:
    return table(("name", "what it is", "channels it needs"),
                 ((f"[`{name}`](#method-{name})", first_sentence(method),
                   ", ".join(f"`{c}`" for c in build(name).needs))
                  for name, method in METHODS.items()))


def methods() -> str:
    """A section for each method: summary, the module's header (paper, departures), parameters."""
    sections = [_section(f"method-{name}", f"`{name}`", method, build(name))
                for name, method in METHODS.items()]
    stage = _section("method-outliers", "Outlier removal, before any method", RemoveOutliers,
                     RemoveOutliers())
    return "\n\n".join([*sections, stage])


def _section(anchor: str, title: str, cls: type, method: Any) -> str:
    module = sys.modules[cls.__module__].__doc__ or ""
    return "\n\n".join([f"({anchor})=\n### {title}", first_sentence(cls), markdown_of(module),
                        parameter_table(method)])


def shared() -> str:
    """A section for each module that methods are built of and that has symbols or a source."""
    paths = modules()
    seen = {cls.__module__.removeprefix("onespp.") for cls in (*METHODS.values(), RemoveOutliers)}
    own, open_, sections = frozenset(seen), sorted(seen), []
    while open_:
        name = open_.pop(0)
        used = sorted(imports(name, paths[name], paths) - seen)
        seen.update(used)
        open_ += [u for u in used if u.startswith("denoise.")]
        text = ast.get_docstring(ast.parse(paths[name].read_text("utf-8"))) or ""
        if name not in own and HEADER.search(text):
            sections.append(f"### `{name.replace('.', '/')}.py`\n\n{text.splitlines()[0]}\n\n"
                            f"{markdown_of(text)}")
    return "\n\n".join(sections)


def peers() -> str:
    return table(("name", "what it is", "parameters"),
                 ((f"`{name}`", peer.about, ", ".join(
                     f"`{p.name}={p.default}`" for p in parameters(peer.make())))
                  for name, peer in PEERS.items()))


def channels() -> str:
    return table(
        ("group", "channel", "in the EXR file", "stored as", "background",
         "meaning, space and unit"),
        ((c.group.name.lower(), f"`{c.name}`", " ".join(f"`{name}`" for name in c.exr),
          c.stored.value.strip(), f"{c.background:g}", c.about)
         for c in CHANNELS.values()))


def metrics() -> str:
    return table(
        ("measure", "key", "unit", "better", "takes", "definition"),
        ((m.label, f"`{m.name}`", m.unit, "higher" if m.higher_is_better else "lower",
          {"linear": "linear radiance", "srgb": "display values", "step": "two frames",
           "flip": "linear radiance" if m.name == "flip_hdr" else "display values"}[m.space],
          m.about) for m in MEASURES.values()))


def causes() -> str:
    return table(("class", "pixels where"),
                 ((f"`{name}`", about) for name, about in CAUSES.items()))


def histories() -> str:
    return ", ".join(f"{name}" for name in HISTORIES)


def scenes() -> str:
    made = [(name, catalog.load(name)) for name in catalog.SCENES]
    return table(("scene", "what it is", "frames", "size", "shapes", "path segments", "moves"),
                 ((f"`{name}`", s.about, s.frames, f"{s.width}x{s.height}", len(s.shapes),
                   f"up to {s.max_depth}", ", ".join(s.moving) or "nothing") for name, s in made))


def hard_scenes() -> str:
    made = [(hard, hard.make()) for hard in HARD.values()]
    return table(("scene", "what it isolates", "sudden change at frame", "only diffuse"),
                 ((f"`{s.name}`", s.about, "" if h.event is None else h.event,
                   "yes" if h.diffuse else "no") for h, s in made))


def commands() -> str:
    """Every command with its arguments and options, as `--help` has them."""
    sections = []
    for path, command in walk(app):
        context = click.Context(command, info_name=f"onespp {path}")
        arguments = [p.make_metavar(context) for p in command.params
                     if isinstance(p, click.Argument)]
        rows = [tuple(found) for p in command.params if isinstance(p, click.Option)
                and (found := p.get_help_record(context))]
        sections.append("\n\n".join([
            f"### `onespp {path}`",
            *([f"`{' '.join(['onespp', path, *arguments])}`"] if arguments else []),
            " ".join((command.help or "").split()),
            table(("option", "what it does"), ((f"`{a}`", b.replace("[", r"\["))
                                               for a, b in rows)) if rows else "No options."]))
    return "\n\n".join(sections)


def library() -> str:
    """The functions of `import onespp`, and frames of arrays, as their docstrings have them."""
    functions = {name: found for name in sorted(onespp.__all__)
                 if not isinstance(found := _function(name), type)}
    functions["Frame.from_arrays"] = onespp.Frame.from_arrays
    return "\n\n".join(_function_section(name, f) for name, f in functions.items())


def clips() -> str:
    """The reader of data sets, as its docstring has it."""
    return _function_section("Clips", onespp.Clips)


def _function(name: str) -> Any:
    found = getattr(onespp, name)  # packages that are functions, too
    return onespp._public(name) if inspect.ismodule(found) else found


def _function_section(name: str, function: Callable[..., Any]) -> str:
    """Name, signature, and the docstring: its sections as they stand, its example apart."""
    text, _, example = inspect.cleandoc(function.__doc__ or "").partition("Example:\n")
    about, _, details = text.partition("\n\n")
    signature = re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(inspect.signature(function)))
    return "\n\n".join([
        f"### `onespp.{name}`", f"```text\n{name}{_broken(signature)}\n```", about,
        *([f"```text\n{details.strip()}\n```"] if details.strip() else []),
        f"```pycon\n{inspect.cleandoc(example).strip()}\n```"])


def _broken(signature: str) -> str:
    """A long signature with a parameter a line."""
    if len(signature) < 80:
        return signature
    inside, _, result = signature[1:].rpartition(")")
    return "(\n    " + re.sub(r", (?=\*?\*?\w+(?::|,|$)|\*,)", ",\n    ", inside) + f"){result}"


def walk(group: click.Group, before: str = "") -> list[tuple[str, click.Command]]:
    """(path of names, command) of all commands below a group."""
    found: list[tuple[str, click.Command]] = []
    for name, command in group.commands.items():
        path = f"{before} {name}".strip()
        if not isinstance(command, click.Group) or command.invoke_without_command:
            found.append((path, command))
        if isinstance(command, click.Group):
            found += walk(command, path)
    return found


def architecture() -> str:
    return f"```{{raw}} html\n{svg(rooms())}\n```"


PARTS: dict[str, Callable[[], str]] = {
    "architecture": architecture, "rooms": lambda: rooms_table(rooms()),
    "method-list": method_list, "methods": methods, "shared": shared, "peers": peers,
    "channels": channels, "metrics": metrics, "causes": causes, "histories": histories,
    "library": library, "clips": clips, "scenes": scenes, "hard-scenes": hard_scenes,
    "commands": commands,
}


def filled(page: str) -> str:
    """A page's text with what is made from the code in its places; KeyError: no such part."""
    return re.sub(r"<!-- from-code: ([\w-]+) -->", lambda m: PARTS[m[1]](), page)
