"""Calls in processes of their own: several at once, each in a fresh Python, and none of them can
end this one.

A process reads its calls, a line of JSON each, and answers likewise. It ends with its input, so
with the process that started it, however that ends. Whatever else it says is kept for the log.

Not by `concurrent.futures`, whose pool is broken for all calls when one process is killed, and
whose fresh processes import the caller's program again.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import IO, Any

from onespp.render.errors import InputError

_SECONDS_BETWEEN_LOOKS = 0.1
_LAST_WORDS = 2000  # bytes of what a process said before it died


class CallFailed(InputError):
    """A call raised something, or its process died; `log` has all that is known of it."""

    def __init__(self, sentence: str, log: str = "") -> None:
        super().__init__(sentence)
        self.log = log


def calls(function: str, arguments: Sequence[Sequence[Any]], processes: int,
          look: Callable[[], None] = lambda: None) -> Iterator[tuple[int, Any]]:
    """Call a function for each of some arguments, in processes of this Python.

    Args:
        function: "module:name"; arguments and results are what JSON has.
        look: called all the while; may raise KeyboardInterrupt, which ends the processes.

    Returns:
        The numbers of the calls and their results, as they end: a `CallFailed` where one failed.
    """
    waiting, answers = deque(enumerate(arguments)), queue.Queue()
    alive: list[subprocess.Popen[str]] = []
    threads = [threading.Thread(target=_serve, args=(function, waiting, answers, alive),
                                daemon=True) for _ in range(min(processes, len(arguments)))]
    for thread in threads:
        thread.start()
    try:
        for _ in arguments:
            while True:
                look()
                with contextlib.suppress(queue.Empty):
                    yield answers.get(timeout=_SECONDS_BETWEEN_LOOKS)
                    break
    finally:
        waiting.clear()
        for thread in threads:
            while thread.is_alive():
                for process in [*alive]:
                    process.kill()
                thread.join(_SECONDS_BETWEEN_LOOKS)


def call(function: str, *arguments: Any, look: Callable[[], None] = lambda: None) -> Any:
    """The result of one call; raises its `CallFailed`."""
    ((_, result),) = calls(function, [arguments], 1, look)
    if isinstance(result, CallFailed):
        raise result
    return result


def _serve(function: str, waiting: deque[tuple[int, Sequence[Any]]],
           answers: queue.Queue[tuple[int, Any]], alive: list[subprocess.Popen[str]]) -> None:
    """A thread: gives a process its calls, and starts another where it has died."""
    with tempfile.TemporaryFile() as said:
        process: subprocess.Popen[str] | None = None
        while True:
            try:
                number, arguments = waiting.popleft()
            except IndexError:
                break
            if process is None:
                process = _started(said)
                alive.append(process)
            try:
                answers.put((number, _answer(process, function, arguments)))
            except (OSError, ValueError):  # there was none
                answers.put((number, _death(process.wait(), said)))
                process = None
        if process is not None:
            process.communicate()  # ends its input


def _started(said: IO[bytes]) -> subprocess.Popen[str]:
    path = os.pathsep.join(filter(None, sys.path))
    return subprocess.Popen(
        [sys.executable, "-c", f"from {__name__} import serve; serve()"], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, encoding="utf-8",
        env={**os.environ, "PYTHONPATH": path})


def _answer(process: subprocess.Popen[str], function: str, arguments: Sequence[Any]) -> Any:
    """OSError or ValueError where the process died."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps([function, *arguments]) + "\n")
    process.stdin.flush()
    said = json.loads(process.stdout.readline())
    if "result" in said:
        return said["result"]
    return CallFailed(said["error"], said["log"])


def _death(code: int, said: IO[bytes]) -> CallFailed:
    said.seek(max(0, said.seek(0, os.SEEK_END) - _LAST_WORDS))
    log = said.read().decode(errors="replace")
    if code == -getattr(signal, "SIGKILL", 9):
        return CallFailed("its process was killed, as systems do where memory runs out", log)
    name = f"signal {-code}" if code < 0 else f"code {code}"
    return CallFailed(f"its process ended with {name}", log)


def serve() -> None:
    """What a process does: answer calls until its input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's is for the one that started this
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever a library prints is no answer
    for line in sys.stdin:
        function, *arguments = json.loads(line)
        module, name = function.split(":")
        try:
            said = {"result": getattr(importlib.import_module(module), name)(*arguments)}
        except Exception as error:
            said = {"error": str(error) if isinstance(error, InputError) else
                    " ".join(repr(error).split())[:300], "log": traceback.format_exc()}
        print(json.dumps(said), file=answers, flush=True)
