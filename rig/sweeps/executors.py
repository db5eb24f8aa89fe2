"""Executors of the cases of a sweep: threads of this process; a cluster has the same interface.

An executor takes cases and a function that runs one, and yields outcomes in the order in which they
finish. When interrupted, it first yields the finished outcomes.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from threading import Event
from typing import Protocol

from rig.sweeps import InterruptedSweepError
from rig.sweeps.cases import Case, Outcome

_CASES_PER_THREAD = 2  # submitted per thread: no thread waits, and memory use stays constant


class RunCase(Protocol):
    """Function that runs one case.

    It raises `InterruptedSweepError` when ``should_continue`` returns false.
    """

    def __call__(self, case: Case, should_continue: Callable[[], bool]) -> Outcome:
        """Return the outcome of the case."""


Executor = Callable[[Iterable[Case], RunCase], Iterator[Outcome]]


def available_processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def thread_executor(jobs: int) -> Executor:
    """Return an executor with ``jobs`` threads; compiled code releases the GIL."""

    def run(cases: Iterable[Case], run_case: RunCase) -> Iterator[Outcome]:
        stop, waiting = Event(), iter(cases)
        pending: set[Future[Outcome]] = set()

        def should_continue() -> bool:
            return not stop.is_set()

        with ThreadPoolExecutor(jobs) as pool:
            try:
                while True:
                    while len(pending) < _CASES_PER_THREAD * jobs and (case := next(waiting, None)):
                        pending.add(pool.submit(run_case, case, should_continue))
                    if not pending:
                        return
                    done, pending = wait(pending, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield future.result()
            except KeyboardInterrupt:
                _cancel(stop, pending)
                wait(pending)
                yield from _completed_outcomes(pending)
                raise
            finally:
                _cancel(stop, pending)

    return run


def _cancel(stop: Event, pending: Iterable[Future[Outcome]]) -> None:
    stop.set()
    for future in pending:
        future.cancel()


def _completed_outcomes(futures: Iterable[Future[Outcome]]) -> Iterator[Outcome]:
    for future in futures:
        if not future.cancelled() and not isinstance(future.exception(), InterruptedSweepError):
            yield future.result()
