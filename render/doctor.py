"""What will run on this machine, in words: Python, LLVM, CUDA, threads, and what to do."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from onespp.render.host.memory import BASE_BYTES, BYTES_PER_PIXEL, free_memory

from .errors import InputError
from .host import backend
from .trials import TRIALS, Trial, TrialError, attempt

PACKAGES = ("mitsuba", "drjit", "OpenEXR", "numpy")


@dataclass(frozen=True)
class Finding:
    """One line of the diagnosis. `state` is 'ok', 'note' (works, but) or 'bad' (will not run)."""

    subject: str
    state: str
    text: str


def examine() -> Iterator[Finding]:
    """Look at everything that a command needs; never raises, never crashes the process.

    Libraries are tried in processes of their own (`trials.py`).
    """
    for look in (_python, _packages, _llvm, _cuda, _threads, _memory, _text, _kernel_cache,
                 _trials):
        try:
            yield from look()
        except Exception as error:  # a diagnosis must outlive what it diagnoses
            yield Finding(look.__name__.strip("_"), "bad", f"{type(error).__name__}: {error}")


def _python() -> Iterator[Finding]:
    ok = sys.version_info >= (3, 10)
    advice = "" if ok else "; onespp needs 3.10 or newer"
    yield Finding("Python", "ok" if ok else "bad",
                  f"{platform.python_version()} at {sys.executable}, {platform.platform()}{advice}")


def _packages() -> Iterator[Finding]:
    for name in PACKAGES:
        try:
            yield Finding(name, "ok", importlib.metadata.version(name))
        except importlib.metadata.PackageNotFoundError:
            yield Finding(name, "bad",
                          f"not installed: run `{sys.executable} -m pip install {name}`")


def _llvm() -> Iterator[Finding]:
    try:
        llvm = backend.require_llvm()
    except InputError as error:
        yield Finding("LLVM", "bad", str(error))
        return
    yield Finding("LLVM", "ok", ".".join(map(str, llvm.version or ())) + f" at {llvm.path}")


def _cuda() -> Iterator[Finding]:
    if backend.has_cuda():
        yield Finding("CUDA", "ok", "a device and driver were found; used by default")
    else:
        yield Finding("CUDA", "note", "no device or driver: kernels run on the CPU")


def _threads() -> Iterator[Finding]:
    affinity = getattr(os, "sched_getaffinity", None)
    allowed = len(affinity(0)) if affinity else os.cpu_count()
    slow = "; rendering and denoising take turns with all else" if allowed == 1 else ""
    yield Finding("threads", "note" if slow else "ok",
                  f"{allowed} processor{'s' * (allowed != 1)} allowed{slow}")


def _memory() -> Iterator[Finding]:
    free = free_memory()
    if free is None:
        yield Finding("memory", "note", "how much is free cannot be told here")
        return
    fits = int(max(0, free - BASE_BYTES) / BYTES_PER_PIXEL) ** 0.5
    text = f"{free / 2**20:.0f} MiB free, enough for frames of about {fits:.0f}x{fits:.0f} pixels"
    if not fits:
        text = f"{free / 2**20:.0f} MiB free: {BASE_BYTES >> 20} MiB are needed"
    yield Finding("memory", "ok" if fits > 256 else "note", text)


def _text() -> Iterator[Finding]:
    """File names and output outside ASCII."""
    names, output = sys.getfilesystemencoding(), sys.stdout.encoding or "none"
    try:
        "é日".encode(names)
        "├é日".encode(output)
    except (UnicodeError, LookupError):
        yield Finding("text", "note", f"file names are {names}, output is {output}, so letters "
                      "outside ASCII are shown as '?': set LC_ALL=C.UTF-8 or PYTHONUTF8=1")
        return
    yield Finding("text", "ok", f"file names are {names}, output is {output}")


def _kernel_cache() -> Iterator[Finding]:
    chosen = os.environ.get("DRJIT_CACHE_DIR")
    if not chosen and sys.platform != "win32" and not os.environ.get("HOME"):
        yield Finding("kernel cache", "note",
                      "HOME is not set: kernels are compiled anew in every process; set it, or "
                      "DRJIT_CACHE_DIR to a folder of yours")
        return
    folder = Path(chosen or Path.home() / ".drjit").absolute()
    nearest = next(p for p in (folder, *folder.parents) if p.exists())
    try:
        with tempfile.TemporaryFile(dir=nearest):
            yield Finding("kernel cache", "ok", str(folder))
    except OSError:
        yield Finding("kernel cache", "note",
                      f"{folder} cannot be written: kernels are compiled anew in every process; "
                      "set DRJIT_CACHE_DIR to a folder of yours")


def _trials() -> Iterator[Finding]:
    """Every library, tried on something small; those that need not be there, where they are."""
    there = {name: trial for name, trial in TRIALS.items() if not trial.without or _has(trial)}
    with ThreadPoolExecutor(2) as pool:
        tried = {name: pool.submit(attempt, name) for name in there}
        for name, trial in TRIALS.items():
            try:
                said = tried[name].result() if name in tried else ""
            except TrialError as error:
                yield Finding(name, "note" if trial.without else "bad",
                              f"{error}" + (f"; {trial.without}" if trial.without else ""))
            else:
                yield Finding(name, "ok", said) if said else Finding(
                    name, "note", f"not installed: {trial.without}; if you want it, run "
                    f"`{sys.executable} -m pip install {trial.package}`")


def _has(trial: Trial) -> bool:
    try:
        importlib.metadata.version(trial.package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
