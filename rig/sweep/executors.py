"""Who runs the cases of a sweep: threads of this process; a cluster takes the same seam.

An executor takes cases and what runs one, and gives outcomes as they come, in any order. When it is
interrupted it first gives what is done.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from threading import Event
from typing import Protocol

from rig.sweep import InterruptedSweepError
from rig.sweep.cases import Case, Outcome

_AHEAD = 2  # cases handed out for each one that runs: nobody waits, and memory stays flat


class Work(Protocol):
    """Runs one case; raises `InterruptedWalkError` when told not to go on."""

    def __call__(self, case: Case, go_on: Callable[[], bool]) -> Outcome:
        """What the case gave."""
        ...


Executor = Callable[[Iterable[Case], Work], Iterator[Outcome]]


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0))


def threads(jobs: int) -> Executor:
    """So many threads at a time; compiled code runs beside Python."""

    def run(cases: Iterable[Case], work: Work) -> Iterator[Outcome]:
        stop, waiting = Event(), iter(cases)
        pending: set[Future[Outcome]] = set()

        def go_on() -> bool:
            return not stop.is_set()

        with ThreadPoolExecutor(jobs) as pool:
            try:
                while True:
                    while len(pending) < _AHEAD * jobs and (case := next(waiting, None)):
                        pending.add(pool.submit(work, case, go_on))
                    if not pending:
                        return
                    done, pending = wait(pending, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield future.result()
            except KeyboardInterrupt:
                _end(stop, pending)
                wait(pending)
                yield from _finished(pending)
                raise
            finally:
                _end(stop, pending)

    return run


def _end(stop: Event, pending: Iterable[Future[Outcome]]) -> None:
    stop.set()
    for future in pending:
        future.cancel()


def _finished(futures: Iterable[Future[Outcome]]) -> Iterator[Outcome]:
    for future in futures:
        if not future.cancelled() and not isinstance(future.exception(), InterruptedSweepError):
            yield future.result()
