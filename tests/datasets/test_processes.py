"""Calls in processes of their own come back, and what ends a process ends nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from onespp.datasets.processes import CallFailed, call, calls


def test_results_come_back_and_a_process_that_dies_is_replaced():
    die = "__import__('os').kill(__import__('os').getpid(), 9)"
    arguments = [["1 + 1"], ["1 / 0"], [die], ["7"]]
    found = dict(calls("builtins:eval", arguments, 1))
    assert (found[0], found[3]) == (2, 7)
    assert str(found[1]) == "ZeroDivisionError('division by zero')"
    assert "Traceback" in found[1].log
    assert "was killed, as systems do where memory runs out" in str(found[2])


def test_what_a_process_says_is_no_answer_but_is_in_the_log():
    assert call("builtins:print", "not JSON") is None
    with pytest.raises(CallFailed, match="ended with code 3") as raised:
        call("builtins:exec", "import os; print('last words', flush=True); os._exit(3)")
    assert raised.value.log == "last words\n"


def test_an_interrupt_ends_the_processes():
    def stop() -> None:
        if time.monotonic() > begun + 0.5:
            raise KeyboardInterrupt

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        call("time:sleep", 60, look=stop)
    assert time.monotonic() < begun + 20


def test_processes_end_with_the_one_that_started_them():
    code = ("import os\nfrom onespp.datasets.processes import calls\n"
            "pids = calls('builtins:eval', [['__import__(\"os\").getpid()'], ['7']], 1)\n"
            "print(next(pids)[1], flush=True)\nos.kill(os.getpid(), 9)")
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    end = time.monotonic() + 10
    while time.monotonic() < end:
        try:
            os.kill(int(done.stdout), 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("a process outlived the one that started it")
