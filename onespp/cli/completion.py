"""Completion in bash, zsh and fish, and the command that prints what sets it up.

A shell asks at every TAB, so that this loads click alone: not the commands, not NumPy, not Dr.Jit.
What there is to complete, commands with their options, scenes, methods with their parameters, is in
`words.json`; `pytest tests/cli/test_completion.py --regenerate` writes it anew, and the same test
holds that it is what the commands and catalogues say. Sequences are looked for where one types.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class, shell_complete

VARIABLE = "_ONESPP_COMPLETE"
WORDS = Path(__file__).parent / "words.json"
SHELLS = ("bash", "zsh", "fish")
_DEPTH, _MOST = 3, 200  # how far and how many sequences are looked for


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
def completion(shell: str) -> None:
    """Print the script that makes SHELL complete commands, scenes, methods and folders.

    bash: add eval "$(onespp completion bash)" to ~/.bashrc; zsh likewise to ~/.zshrc; fish: onespp
    completion fish > ~/.config/fish/completions/onespp.fish
    """
    kind = get_completion_class(shell)
    assert kind is not None
    click.echo(kind(completion, {}, "onespp", VARIABLE).source())


def complete() -> int:
    """Answer the shell that set `_ONESPP_COMPLETE`; the exit code."""
    words = json.loads(WORDS.read_text(encoding="utf-8"))
    app = click.Group("onespp", commands=[
        click.Command(name, params=[_parameter(words, **p) for p in command["parameters"]],
                      short_help=command["help"]) for name, command in words["commands"].items()])
    return shell_complete(app, {}, "onespp", VARIABLE, os.environ[VARIABLE])


def _parameter(words: dict[str, Any], names: list[str], kind: str | list[str],
               many: bool = False, flag: bool = False) -> click.Parameter:
    offer = partial(_offer, words, kind)
    if not names[0].startswith("-"):
        return click.Argument(names, nargs=-1 if many else 1, required=False, shell_complete=offer)
    if flag:
        return click.Option(names, is_flag=True)
    return click.Option(names, multiple=many, shell_complete=offer)


def _offer(words: dict[str, Any], kind: str | list[str], context: click.Context,
           _: click.Parameter, typed: str) -> list[CompletionItem]:
    """What `typed` may become; where no word of ours begins so, the shell's own files."""
    if kind == "sequence":
        found = [CompletionItem(name) for name in _sequences(typed)]
        return found or [CompletionItem(typed, type="dir")]
    if kind in ("file", "dir"):
        return [CompletionItem(typed, type=kind)]
    listed = kind in ("channel", "method")
    before, comma, last = typed.rpartition(",") if listed else ("", "", typed)
    names = kind if isinstance(kind, list) else _WORDS[kind](words, context) if kind else ()
    found = [n for n in names if n.startswith(last) and n not in before.split(",")]
    if kind in ("method", "scene") and not found:
        found = [n for n in _installed(f"onespp.{kind}s") if n.startswith(last)]
        if not found:
            return [CompletionItem(typed, type="file")]
    return [CompletionItem(before + comma + name) for name in found]


def _installed(group: str) -> list[str]:
    """Names that other packages add; asked last, for it takes as long as all the rest."""
    from importlib.metadata import entry_points

    return [point.name for point in entry_points(group=group)]


def _methods(words: dict[str, Any], _: click.Context) -> list[str]:
    return [*words["methods"], "all", "oidn"]


def _parameters(words: dict[str, Any], context: click.Context) -> list[str]:
    """Of the methods on the line before; of all where none is."""
    said = context.params.get("methods") or context.params.get("method") or ()
    named = [said] if isinstance(said, str) else said
    methods = [name for name in named if name in words["methods"]] or words["methods"]
    return sorted({p for name in methods for p in words["methods"][name]})


def _settings(words: dict[str, Any], context: click.Context) -> list[str]:
    return [f"{name}=" for name in _parameters(words, context)]


def _of(key: str) -> Callable[[dict[str, Any], click.Context], list[str]]:
    return lambda words, _: words[key]


_WORDS: dict[str, Callable[[dict[str, Any], click.Context], Any]] = {
    "method": _methods, "scene": _of("scenes"), "parameter": _parameters, "setting": _settings,
    "hard": _of("hard"), "channel": _of("channels"), "device": _of("devices")}


def _sequences(typed: str) -> list[str]:
    """Folders with a sequence in them whose name begins as `typed`, as the shell would write it."""
    head, start = os.path.split(typed)
    found: list[str] = []

    def look(folder: str, depth: int, start: str = "") -> None:
        try:
            entries = sorted(e.name for e in os.scandir(folder or ".") if e.is_dir())
        except OSError:
            return
        for name in entries:
            if len(found) < _MOST and name.startswith(start) and (start or name[0] != "."):
                path = os.path.join(folder, name)
                if os.path.exists(os.path.join(path, "manifest.json")):
                    found.append(path)
                elif depth:
                    look(path, depth - 1)

    look(head, _DEPTH - 1, start)
    return found
