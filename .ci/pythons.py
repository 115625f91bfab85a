"""A short run of everything on each Python that pyproject.toml promises and this machine has.

    make pythons                       # all but the one of .venv, which `make test` tests
    python .ci/pythons.py 3.12 3.13    # these

For each: a fresh environment, the package and what it depends on, a small film rendered, denoised,
scored and reported, exported and imported again, and `onespp doctor`. Interpreters are looked for
as python3.x on PATH, in ~/.pyenv/versions, and by uv where that is installed; none is downloaded.
Packages come by uv, or by pip where there is no uv. Needs nothing but Python.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SECONDS = 300  # for a command
COMMANDS = (
    "run box --frames 0:2 --size 48x48 --reference-spp 16 --method atrous --method onespp --out a",
    "score a --no-pictures",
    "report a",
    "export a --out given",
    "import given --out b",
    "denoise b --method atrous",
    "score b",
    "doctor",
)


class FailedError(Exception):
    """What went wrong, with the output that says why."""


def promised() -> list[str]:
    """The versions in pyproject.toml's classifiers, as 3.12."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return re.findall(r'"Programming Language :: Python :: (3\.\d+)"', text)


def candidates(version: str) -> Iterator[str]:
    """Paths that may be an interpreter of a version, as 3.12."""
    if on_path := shutil.which(f"python{version}"):
        yield on_path
    for folder in sorted((Path.home() / ".pyenv/versions").glob(f"{version}.*"), reverse=True):
        yield str(folder / "bin/python")
    if uv := shutil.which("uv"):
        found = subprocess.run([uv, "python", "find", "--no-python-downloads", "--system", version],
                               capture_output=True, text=True, check=False)
        if found.returncode == 0:
            yield found.stdout.strip()


def find(version: str) -> str | None:
    """An interpreter that runs, is of the version and can make environments; None without."""
    for path in candidates(version):
        try:
            said = subprocess.run(
                [path, "-c", "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"],
                capture_output=True, text=True, timeout=60, check=False)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if said.stdout.strip() == version:
            return path
    return None


def call(words: list[str], folder: Path) -> None:
    """Run a program in a folder; FailedError with all it said where it fails."""
    shown = " ".join([Path(words[0]).name, *words[1:]])
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    try:
        done = subprocess.run(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
                              timeout=SECONDS, env=environment)
    except subprocess.TimeoutExpired:
        raise FailedError(f"`{shown}` did not come to an end in {SECONDS} s") from None
    if done.returncode:
        how = (f"crashed ({signal.Signals(-done.returncode).name})" if done.returncode < 0 else
               f"ended with exit code {done.returncode}")
        raise FailedError(f"`{shown}` {how}:\n{done.stdout}")


def try_out(python: str, folder: Path) -> None:
    """Install into a fresh environment in `folder`, and run the commands there."""
    environment = folder / "venv"
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    if uv := shutil.which("uv"):
        call([uv, "venv", "--quiet", "--python", python, str(environment)], folder)
        call([uv, "pip", "install", "--quiet", "--python", str(programs / "python"),
              "--editable", str(ROOT)], folder)
    else:
        call([python, "-m", "venv", str(environment)], folder)
        call([str(programs / "python"), "-m", "pip", "install", "--quiet",
              "--disable-pip-version-check", "--editable", str(ROOT)], folder)
    for command in COMMANDS:
        call([str(programs / "onespp"), *command.split()], folder)


def main() -> int:
    own = "{}.{}".format(*sys.version_info[:2])
    wanted = sys.argv[1:] or [version for version in promised() if version != own]
    tried, missing, failed = [], [], []
    for version in wanted:
        python = find(version)
        if python is None:
            missing.append(version)
            continue
        started = time.monotonic()
        with tempfile.TemporaryDirectory(prefix=f"onespp-python{version}-",
                                         ignore_cleanup_errors=True) as folder:
            try:
                try_out(python, Path(folder))
            except FailedError as error:
                failed.append(version)
                print(f"Python {version}: {error}", flush=True)
        tried.append(f"{version} ({time.monotonic() - started:.0f} s)")
    print(f"Pythons tried: {', '.join(tried) or 'none'}; failed: {', '.join(failed) or 'none'}; "
          f"not found here: {', '.join(missing) or 'none'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
