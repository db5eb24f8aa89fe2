"""Threads run every case once, keep finished cases when interrupted, and take few at a time."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from rig.sweeps import InterruptedSweepError
from rig.sweeps.cases import Case, Outcome
from rig.sweeps.executors import thread_executor


def make_cases(count: int) -> list[Case]:
    return [Case(number, 0, number) for number in range(count)]


def run_case(case: Case, should_continue: Callable[[], bool]) -> Outcome:
    return Outcome(case.number, ({"row": case.row},), 1.0, "")


def test_every_case_runs_once_for_any_number_of_threads() -> None:
    for jobs in (1, 3):
        outcomes = list(thread_executor(jobs)(make_cases(50), run_case))
        assert sorted(outcome.case for outcome in outcomes) == list(range(50))
        assert all(outcome.rows[0]["row"] == outcome.case for outcome in outcomes)
    assert list(thread_executor(2)([], run_case)) == []


def test_cases_are_taken_as_they_run() -> None:
    """Only a few cases are in memory, however many there are."""
    submitted = 0

    def endless() -> Iterator[Case]:
        nonlocal submitted
        while True:
            submitted += 1
            yield Case(submitted, 0, 0)

    running = thread_executor(2)(endless(), run_case)
    for count in range(100):
        next(running)
        assert submitted <= count + 8
    running.close()


def test_interrupt_yields_finished_cases_and_stops_running_ones() -> None:
    """Case 2 runs until it is stopped; case 3 sends Ctrl-C after case 2 has started."""
    started = threading.Event()

    def interruptible(case: Case, should_continue: Callable[[], bool]) -> Outcome:
        if case.number == 2:
            started.set()
            while should_continue():
                time.sleep(0.001)
            raise InterruptedSweepError
        if case.number == 3:
            started.wait()
            os.kill(os.getpid(), signal.SIGINT)
        return run_case(case, should_continue)

    outcomes: list[int] = []
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        for outcome in thread_executor(2)(make_cases(1000), interruptible):
            outcomes.append(outcome.case)
    assert {0, 1} <= set(outcomes)
    assert 2 not in outcomes
    assert len(outcomes) < 1000  # the rest did not run


def test_exception_of_a_case_ends_the_sweep() -> None:
    """Failures of cases are outcomes; any other exception is a fault of the program."""

    def failing(case: Case, should_continue: Callable[[], bool]) -> Outcome:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        list(thread_executor(2)(make_cases(3), failing))
