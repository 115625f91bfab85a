"""The writer behind: order, how far behind, errors and interrupts."""

from __future__ import annotations

import threading
import time

import pytest

from onespp.render.errors import InputError
from onespp.render.files.behind import writing_behind

PATIENCE = 60.0  # seconds, after which what waits for the other thread fails


def test_calls_are_in_order_and_done_at_the_end():
    done = []

    def write(i: int) -> None:
        time.sleep(0.002 * (i % 3))
        done.append(i)

    with writing_behind() as hand_over:
        for i in range(20):
            hand_over(write, i)
            assert len(done) >= i  # all before this one: two are in memory at most
    assert done == list(range(20))


def test_the_next_is_made_while_one_is_written():
    made, seen = threading.Event(), []
    with writing_behind() as hand_over:
        hand_over(lambda: seen.append(made.wait(PATIENCE)))
        made.set()
    assert seen == [True]


def fail() -> None:
    raise InputError("the disk is full")


@pytest.mark.parametrize(("acts", "taken"), [
    ([fail, pytest.fail, pytest.fail], 1), ([fail], 1), ([time.monotonic, fail], 2)])
def test_an_error_is_raised_by_the_next_call_or_at_the_end(acts, taken):
    handed = []

    def act() -> None:
        with writing_behind() as hand_over:
            for i, call in enumerate(acts):
                hand_over(call)
                handed.append(i)

    with pytest.raises(InputError, match="the disk is full"):
        act()
    assert handed == list(range(taken))


def test_an_interrupt_loses_nothing_that_was_handed_over():
    interrupted, done = threading.Event(), []

    def write() -> None:
        assert interrupted.wait(PATIENCE)
        done.append(1)

    def act() -> None:
        with writing_behind() as hand_over:
            hand_over(write)
            interrupted.set()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        act()
    assert done == [1]
