"""A sweep from its checked inputs to its dataset and pictures, for the command and Python alike."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np

from rig.sweeps import executors, sweep
from rig.sweeps.cases import Outcome
from rig.sweeps.result_cache import JOURNAL_FILE, load_report, store_report
from rig.sweeps.simulator import Simulator
from rig.sweeps.task import FAILED

if TYPE_CHECKING:
    import xarray


class SweepView(Protocol):
    """A display of the progress of a sweep."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def begin(self, already_finished: int) -> None:
        """Begin with the number of cases that an earlier start of the sweep has finished."""

    def update(self, outcome: Outcome) -> None:
        """Count one more case."""


class SweepRun:
    """A checked sweep: its cases, the dataset it writes, and the pictures of it."""

    def __init__(
        self,
        opened: sweep.Sweep,
        out: Path | None,
        measured: Path | None,
        *,
        redraw: bool = False,
    ) -> None:
        """``out``: the NetCDF to write, else one in the folder of the sweep.

        ``measured``: a run to draw over the rows of a campaign; ``redraw``: draw a finished sweep
        anew.
        """
        self._opened, self._measured = opened, measured
        self._redraw = redraw or measured is not None
        self.path = out or opened.folder / sweep.RESULT_FILE
        self._table: xarray.Dataset | None = None
        self._stored: dict[str, Any] | None = None

    def compute(
        self,
        executor: executors.Executor,
        view: SweepView,
        notice: Callable[[str], None],
        prepare: Callable[[Simulator], None] | None,
    ) -> None:
        """Run the cases that are not finished, and write the dataset.

        ``prepare`` compiles the loop first; None where workers do. Raises BusyError if another
        process runs the same sweep, OSError, ValueError or ArithmeticError if a case or the file
        fails; finished cases are kept.
        """
        opened = self._opened
        with sweep.lock_folder(opened):
            remaining, damaged = sweep.count_remaining(opened)
            if damaged:
                journal = f"{opened.folder}/{JOURNAL_FILE}"
                notice(f"left out {damaged} bytes of {journal}: not a complete case")
            if not (remaining or self._redraw):
                self._stored = load_report(opened.folder, self.path)
            if self._stored is not None:
                view.begin(len(opened.cases))
                return
            if remaining and prepare is not None:
                prepare(opened.cases.simulator())
            with view:
                self._table = sweep.run(opened, executor, view.update, view.begin)
            sweep.write_dataset(self._table, self.path)

    def result(self, notice: Callable[[str], None]) -> dict[str, Any]:
        """Return the results as JSON values, after drawing the pictures of a new dataset."""
        if self._table is None:
            return dict(self._stored or {})
        opened = self._opened
        notice("drawing ...")
        pictures = opened.tasks.write_pictures(self._table, opened.folder, self._measured)
        result = _as_dict(opened, self.path, pictures, self._table)
        store_report(opened.folder, self.path, self._measured, [self.path, *pictures], result)
        return result


def find_executor(
    opened: sweep.Sweep, jobs: int | None, scheduler: str | None
) -> executors.Executor:
    """Return what runs the cases: threads of this machine, or a Dask cluster (``scheduler``)."""
    if scheduler is None:
        return executors.thread_executor(jobs or executors.available_processors())
    from rig.sweeps.cluster import cluster_executor

    return cluster_executor(scheduler, opened.cases.request, opened.digest)


def _as_dict(
    opened: sweep.Sweep, result: Path, pictures: list[Path], table: "xarray.Dataset"
) -> dict[str, Any]:
    state, reasons_of_cases = table["state"].values, table["incomplete_reason"].values
    names, counts = np.unique(state.astype(str), return_counts=True)
    reasons = sorted({str(text) for text in reasons_of_cases[state == FAILED]})
    return {
        "status": "failed cases" if reasons else "complete",
        "folder": str(opened.folder),
        "result": str(result),
        "pictures": [str(picture) for picture in pictures],
        opened.tasks.result_noun: dict(zip(names.tolist(), counts.tolist(), strict=True)),
        "failed": reasons,
        **opened.tasks.summary(table),
    }
