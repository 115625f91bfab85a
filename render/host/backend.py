"""Where kernels run: finds an LLVM that Dr.Jit can use, and picks LLVM, CUDA or Metal.

Dr.Jit loads LLVM at run time. With LLVM 15 it aborts the whole process on the first kernel
(an unsupported instruction), which no `except` can catch, so the version is read before Dr.Jit
ever sees the library. `LLVMGetVersion` exists since LLVM 16: a library without it is older.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.abc import MetaPathFinder
from pathlib import Path

from onespp.render.errors import InputError

from .cuda_driver import has_cuda

OLDEST_LLVM = 16
VARIANTS = {"llvm": "llvm_ad_rgb", "cuda": "cuda_ad_rgb", "metal": "metal_ad_rgb"}
"""Device -> Mitsuba's variant. (Metal, on macOS, has not been run by us.)"""
_SET_BY_USER = os.environ.get("DRJIT_LIBLLVM_PATH") or None
_ADVICE = ("install one with `pip install karellen-llvm-core` (Linux x86-64) or your system's "
           "package manager, or set DRJIT_LIBLLVM_PATH to a libLLVM of version 16 or newer")


@dataclass(frozen=True)
class LLVM:
    """A libLLVM on this machine; `version` is None where it is older than 16 or unreadable."""

    path: str
    version: tuple[int, int, int] | None

    @property
    def usable(self) -> bool:
        return self.version is not None and self.version[0] >= OLDEST_LLVM


def llvm_version(path: str) -> tuple[int, int, int] | None:
    """(major, minor, patch) of a libLLVM, None if it cannot be loaded or predates 16."""
    try:
        get_version = ctypes.CDLL(path).LLVMGetVersion
    except (OSError, AttributeError):
        return None
    parts = [ctypes.c_uint() for _ in range(3)]
    get_version(*map(ctypes.byref, parts))
    return parts[0].value, parts[1].value, parts[2].value


def _candidates() -> list[str]:
    """Paths to try: the wheel in this environment first, then the system, newest first."""
    found = []
    for pattern in ("libLLVM.so*", "libLLVM*.dylib", "LLVM-C.dll"):
        found += sorted(map(str, (Path(sys.prefix) / "lib").glob(pattern)), key=len)
    roots = ("/usr/lib", "/usr/lib64", "/usr/local/lib", "/opt/homebrew/opt", "/usr/local/opt")
    patterns = ("llvm*/lib/libLLVM.so*", "llvm*/lib/libLLVM.dylib", "libLLVM.so*", "*/libLLVM.so*",
                "*/libLLVM-*.so*")
    system = [path for root in roots for pattern in patterns for path in Path(root).glob(pattern)]
    found += [str(p) for p in sorted(system, key=_major_in_name, reverse=True)]
    by_linker = ctypes.util.find_library("LLVM")
    return found + ([by_linker] if by_linker else [])


def _major_in_name(path: Path) -> int:
    digits = "".join(c if c.isdigit() else " " for c in str(path)).split()
    return max((int(d) for d in digits if len(d) <= 2), default=0)


@cache
def find_llvm() -> LLVM | None:
    """The LLVM to use, or the best unusable one (so that a message can name it), or None.

    DRJIT_LIBLLVM_PATH, when the user set it, is the only candidate.
    """
    unusable = None
    for path in [_SET_BY_USER] if _SET_BY_USER else _candidates():
        llvm = LLVM(path, llvm_version(path))
        if llvm.usable:
            return llvm
        unusable = unusable or llvm
    return unusable


class _BeforeDrjit(MetaPathFinder):
    """Finds no module: it is asked first for every one, and acts when Dr.Jit's turn has come.

    Python's own hook for it. To look for LLVM at every import of ours instead would load the
    library (100 MB) to read its version, in programs that never compile a kernel.
    """

    def find_spec(self, fullname: str, path: Sequence[str] | None,
                  target: object = None) -> None:
        if fullname in ("drjit", "mitsuba"):
            if self in sys.meta_path:
                sys.meta_path.remove(self)
            prepare()


def prepare_before_drjit() -> None:
    """Have `prepare` called just before Dr.Jit is imported, or now where it has been.

    Raises:
        InputError: as `prepare`.
    """
    if "drjit" in sys.modules:
        prepare()
    else:
        sys.meta_path.insert(0, _BeforeDrjit())


def prepare() -> None:
    """Point Dr.Jit at a usable LLVM. Called before the first import of drjit.

    Raises:
        InputError: Dr.Jit was imported before and has loaded an LLVM that it would crash with, or
            the working directory was removed: Mitsuba's import ends the process there.
    """
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError("the working directory has been removed: change to another one") from None
    if "drjit" in sys.modules and (loaded := _loaded_llvm()) and not loaded.usable:
        raise InputError(f"drjit was imported first and has loaded the LLVM at {loaded.path}, with "
                         "which it would crash: import onespp.render before drjit and mitsuba")
    if _SET_BY_USER is None and (llvm := find_llvm()) and llvm.usable:
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm.path


def _loaded_llvm() -> LLVM | None:
    """The libLLVM in this process, where the system can tell (Linux)."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return None
    paths = {line.split(maxsplit=5)[5] for line in lines if "libLLVM" in line}
    return next((LLVM(path, llvm_version(path)) for path in sorted(paths)), None)


def require_llvm() -> LLVM:
    """The usable LLVM; InputError with advice where there is none."""
    llvm = find_llvm()
    if llvm is None:
        raise InputError(f"no LLVM library was found, which the CPU kernels need: {_ADVICE}")
    if not llvm.usable:
        if _SET_BY_USER and not Path(llvm.path).exists():
            raise InputError(f"DRJIT_LIBLLVM_PATH is {llvm.path}, which is not there: {_ADVICE}")
        raise InputError(f"the LLVM at {llvm.path} is older than {OLDEST_LLVM} or cannot be "
                         f"loaded, and Dr.Jit would crash with it: {_ADVICE}")
    return llvm


@cache
def choose(device: str = "auto") -> str:
    """'cuda', 'llvm' or 'metal' for one of them or 'auto', which is CUDA where it is, else LLVM.

    The environment variable ONESPP_DEVICE replaces 'auto'.

    Raises:
        InputError: the device is unknown or not usable here.
    """
    if device == "auto":
        device = os.environ.get("ONESPP_DEVICE", "auto")
    if device not in ("auto", *VARIANTS):
        raise InputError(f"unknown device '{device}': use auto, llvm, cuda or metal")
    if device == "metal":
        if sys.platform != "darwin":
            raise InputError(f"metal is for macOS, and this is {sys.platform}: use --device llvm")
        return "metal"
    if device == "llvm":
        require_llvm()
        return "llvm"
    if has_cuda():
        return "cuda"
    if device == "cuda":
        raise InputError("no CUDA device was found: use --device llvm")
    require_llvm()
    return "llvm"


def set_threads(count: int | None) -> None:
    """Use `count` CPU threads for kernels (None: all of them)."""
    if count is not None:
        if count < 1:
            raise InputError(f"--threads is {count}: use 1 or more")
        most = max(64, 4 * (os.cpu_count() or 1))
        if count > most:  # the system refuses some number, and then there is no way back
            raise InputError(f"--threads is {count}: use at most {most}, this machine has "
                             f"{os.cpu_count()} processors")
        import drjit as dr

        dr.set_thread_count(count)
