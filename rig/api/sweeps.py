"""`rig.sweep`: a campaign or session for all values of some parameters."""

import os
from collections.abc import Iterable, Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rig.api.errors import public_errors
from rig.api.pictures import Picture
from rig.api.progress import ProgressOption, Reporter
from rig.api.run_lookup import find_run
from rig.api.section import Section
from rig.api.sweep_run import SweepRun, find_executor
from rig.config.shipped_files import CAMPAIGNS, SESSIONS, find_file
from rig.sweeps.campaigns import LEAD_IN
from rig.sweeps.cases import Outcome
from rig.sweeps.simulator import Simulator
from rig.sweeps.sweep import Sweep, open_sweep

if TYPE_CHECKING:
    import pandas
    import xarray

PathLike = str | os.PathLike[str]
Value = float | int | str


class SweepResult:
    """The result of a sweep.

    Attributes:
        folder: Folder of the sweep; it keeps finished cases, which are never run a second time.
        path: NetCDF file of the table.
        summary: The results of `rig sweep --json`: states, failed cases, best rows.
        failed: Reasons why cases could not run; empty without any.
    """

    def __init__(self, opened: Sweep, path: Path, result: Mapping[str, Any]) -> None:
        self.folder, self.path = opened.folder, path
        self.summary = Section(result, "sweep")
        self.failed: tuple[str, ...] = tuple(result["failed"])
        self._lines = opened.tasks.summary_lines(result, opened.task)
        self._counts = ", ".join(
            f"{count} {state}" for state, count in result[opened.tasks.result_noun].items()
        )
        self._name = opened.task.name

    @cached_property
    def table(self) -> "xarray.Dataset":
        """All results over the parameters and, of a campaign, `row`; units are attributes.

        Inputs are coordinates. `state` and `incomplete_reason` give the state of each case.
        """
        import xarray

        with public_errors(), xarray.open_dataset(self.path, engine="h5netcdf") as stored:
            return stored.load()

    @cached_property
    def best(self) -> "pandas.DataFrame":
        """The row with most absorbed power at each station (W), with its inputs.

        Empty for a session, whose results are constants.
        """
        import pandas

        found = self.summary.as_dict().get("best", {})
        return pandas.DataFrame.from_dict(found, orient="index").rename_axis("station")

    @property
    def pictures(self) -> dict[str, Picture]:
        """The pictures by name; a notebook shows each."""
        paths = map(Path, self.summary.get("pictures", ()))
        return {path.stem: Picture(path) for path in paths if path.suffix == ".png"}

    def __repr__(self) -> str:
        failed = [f"failed: {reason}" for reason in self.failed]
        return "\n".join([f"sweep of {self._name}: {self._counts}", *self._lines, *failed])

    def _repr_html_(self) -> str:
        heading = f"<b>sweep of {escape(self._name)}</b>: {escape(self._counts)}"
        failed = "".join(f"<li>{escape(reason)}</li>" for reason in self.failed)
        table = "" if self.best.empty else self.best.to_html(border=0)
        return f"<div>{heading}{table}{f'<ul>{failed}</ul>' if failed else ''}</div>"


def sweep(
    campaign: PathLike,
    over: Mapping[str, Value | Iterable[Value]] | None = None,
    *,
    out: PathLike = "sweeps",
    sequential: bool = False,
    lead_in: float | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    measured: PathLike | None = None,
    runs: PathLike = "runs",
    progress: ProgressOption = True,
) -> SweepResult:
    """Simulate a campaign's rows, or a session, for all values of some parameters, as `rig sweep`.

    Args:
        campaign: File (YAML), or the name of a shipped campaign or session.
        over: Values by key: of the file (`sea.hs_m`), or `rig.KEY`, `plant.KEY`, `limits.KEY`. All
            combinations are simulated.
        out: Folder that holds the sweeps. The same sweep has the same folder there, and goes on
            where it ended.
        sequential: Run the rows of a campaign in sequence, as in the basin; else each is a case.
        lead_in: Waves before each row of a campaign, s (default 15); more until it settles.
        jobs: Threads; default: one per core.
        scheduler: Address of a Dask cluster, `tcp://HOST:PORT`, in place of threads.
        measured: A run to draw over the rows of a campaign: folder, or its name in ``runs``.
        runs: Folder that holds the runs.
        progress: True: a line on standard error; False: nothing; or a function that is called with
            `Progress`.

    Returns:
        The result; cases that could not run are in its `failed`, not an exception.

    Raises:
        RigError: If the files, a key or a value cannot be used; `problems` lists all of them. Also
            if another process runs the same sweep, or the result cannot be written.
    """
    options = [f"{key}={_values(values)}" for key, values in (over or {}).items()]
    given = {"--sequential": sequential, "--lead-in": lead_in, "--measured": measured}
    with public_errors():
        found = find_file(Path(campaign), CAMPAIGNS, SESSIONS)
        opened = open_sweep(
            found if isinstance(found, Path) else found.path,
            options,
            Path(out),
            sequential=sequential,
            lead_in=LEAD_IN if lead_in is None else lead_in,
            given=[name for name, value in given.items() if value],
        )
        run = SweepRun(
            opened, None, None if measured is None else find_run(Path(measured), Path(runs))
        )
        executor = find_executor(opened, jobs, scheduler)
        with Reporter(progress, opened.task.name) as reporter:

            def prepare(simulator: Simulator) -> None:
                if not simulator.is_compiled():
                    reporter.notice("compiling the loop, about a minute, once on this machine ...")
                simulator.prepare()

            view = _View(reporter, len(opened.cases))
            run.compute(executor, view, reporter.notice, None if scheduler else prepare)
        return SweepResult(opened, run.path, run.result(lambda text: None))


def _values(values: Value | Iterable[Value]) -> str:
    if isinstance(values, str | int | float):
        return str(values)
    return ",".join(map(str, values))


class _View:
    """Reports the finished cases of a sweep."""

    def __init__(self, reporter: Reporter, total: int) -> None:
        self._reporter, self._total, self._done = reporter, total, 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    def begin(self, already_finished: int) -> None:
        self._done = already_finished

    def update(self, outcome: Outcome) -> None:
        self._done += 1
        self._reporter.show(self._done, self._total, f"{self._done} of {self._total} cases")
