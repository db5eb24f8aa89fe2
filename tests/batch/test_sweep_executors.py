"""Threads run every case once, keep what is done when interrupted, and hand out few at a time."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from rig.sweep import InterruptedSweepError
from rig.sweep.cases import Case, Outcome
from rig.sweep.executors import threads


def cases(count: int) -> list[Case]:
    return [Case(number, 0, number) for number in range(count)]


def done(case: Case, go_on: Callable[[], bool]) -> Outcome:
    return Outcome(case.number, ({"row": case.row},), 1.0, "")


def test_every_case_is_run_once_whatever_the_threads() -> None:
    for jobs in (1, 3):
        found = list(threads(jobs)(cases(50), done))
        assert sorted(outcome.case for outcome in found) == list(range(50))
        assert all(outcome.rows[0]["row"] == outcome.case for outcome in found)
    assert list(threads(2)([], done)) == []


def test_cases_are_asked_for_as_they_are_run() -> None:
    """However many there are, few are held: memory does not grow with their number."""
    asked = 0

    def endless() -> Iterator[Case]:
        nonlocal asked
        while True:
            asked += 1
            yield Case(asked, 0, 0)

    running = threads(2)(endless(), done)
    for given in range(100):
        next(running)
        assert asked <= given + 8
    running.close()


def test_an_interrupt_gives_what_is_done_and_stops_what_runs() -> None:
    """Case 2 goes on until it is told not to; case 3 sends Ctrl-C after it has begun."""
    begun = threading.Event()

    def work(case: Case, go_on: Callable[[], bool]) -> Outcome:
        if case.number == 2:
            begun.set()
            while go_on():
                time.sleep(0.001)
            raise InterruptedSweepError
        if case.number == 3:
            begun.wait()
            os.kill(os.getpid(), signal.SIGINT)
        return done(case, go_on)

    found: list[int] = []
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        for outcome in threads(2)(cases(1000), work):
            found.append(outcome.case)
    assert {0, 1} <= set(found)
    assert 2 not in found
    assert len(found) < 1000  # nobody ran the rest


def test_a_case_that_breaks_its_thread_ends_the_sweep_with_its_error() -> None:
    """Cases tell their own failures; what comes through is a fault of the program."""

    def broken(case: Case, go_on: Callable[[], bool]) -> Outcome:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        list(threads(2)(cases(3), broken))
