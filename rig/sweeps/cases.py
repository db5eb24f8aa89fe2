"""The cases of a sweep and their outcomes.

A case has one value of every parameter. It is a row of the campaign: power on, tare, a lead-in of
its own, then the row. Cases are independent, so they may run in any order and anywhere. In a
sequential sweep, and for a session, a case is the whole task, row after row as on the rig.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from threading import Lock
from typing import Any, NamedTuple

from rig.sweeps import InterruptedSweepError
from rig.sweeps.parameters import ParameterValues, TaskFiles
from rig.sweeps.simulator import Simulator
from rig.sweeps.task import SweepParameter, SweepTask

_OPEN_VARIANTS = 4  # variants with tables in memory at a time


class Case(NamedTuple):
    """One run of the compiled loop."""

    number: int  # from 0, rows changing fastest
    variant: int  # number of the combination of values
    row: int  # of the task's plan; `ALL_ROWS`: all rows in sequence


class Outcome(NamedTuple):
    """The result of a case."""

    case: int
    rows: tuple[dict[str, Any], ...]  # results of each row by name
    seconds: float  # simulated
    failed: str  # reason of a failure; empty on success


class SweepRequest(NamedTuple):
    """A sweep as plain values, which can be sent to other processes."""

    campaign: str  # path of the campaign or session
    parameters: tuple[SweepParameter, ...]
    sequential: bool
    lead_in: float  # s


class Cases:
    """The cases of a sweep; several threads may run them."""

    def __init__(self, request: SweepRequest, base: SweepTask, files: TaskFiles) -> None:
        """Number the cases by the rows of ``base``, the task without parameter values."""
        self.request = request
        self.base = base
        self.shape = tuple(len(parameter.values) for parameter in request.parameters)
        self._files = files
        self._opening = Lock()
        self._variant = lru_cache(_OPEN_VARIANTS)(self._open)

    def __len__(self) -> int:
        return math.prod(self.shape) * len(self.base.case_rows)

    def __iter__(self) -> Iterator[Case]:
        pairs = itertools.product(range(math.prod(self.shape)), self.base.case_rows)
        return (Case(number, variant, row) for number, (variant, row) in enumerate(pairs))

    def parameter_values(self, variant: int) -> ParameterValues:
        """Return the values of a combination; those of the last parameter change fastest."""
        products = itertools.product(*(each.values for each in self.request.parameters))
        values = next(itertools.islice(products, variant, None))
        return tuple(zip(self.request.parameters, values, strict=True))

    def simulator(self) -> Simulator:
        """Return the simulator of the first combination of values."""
        with self._opening:
            return self._variant(0).simulator

    def run(self, case: Case, should_continue: Callable[[], bool] = lambda: True) -> Outcome:
        """Run a case; a failed outcome has the reason. Raises `InterruptedSweepError`."""

        def check() -> None:
            if not should_continue():
                raise InterruptedSweepError

        try:
            with self._opening:  # two threads must not open the same variant
                task = self._variant(case.variant)
            rows, seconds = task.run(case.row, self.base, check)
        except InterruptedSweepError:
            raise
        except Exception as error:  # noqa: BLE001  the other cases still run
            return Outcome(case.number, (), 0.0, str(error) or type(error).__name__)
        return Outcome(case.number, rows, seconds, "")

    def _open(self, variant: int) -> SweepTask:
        task = self._files.open(self.parameter_values(variant))
        _ = task.simulator  # before other threads use it
        return task
