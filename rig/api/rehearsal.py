"""`rig.rehearse` and `rig.check`: a campaign or session from its file."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.api.campaign_run import CampaignRun, Feedback, OpenedTask, RunOptions, open_task
from rig.api.errors import RigError, public_errors
from rig.api.progress import ProgressOption, Reporter
from rig.api.run import Run
from rig.api.section import Section
from rig.campaign import CheckReport
from rig.config.problems import Problem, problems_text
from rig.config.shipped_files import CAMPAIGNS, RIGS, SESSIONS, find_file
from rig.kinds.interface import Display
from rig.processes.run_types import Snapshot
from rig.realtime.sequence import NO_ROW

if TYPE_CHECKING:
    import pandas

PathLike = str | os.PathLike[str]


def rehearse(
    campaign: PathLike,
    *,
    out: PathLike = "runs",
    rig: PathLike | None = None,
    progress: ProgressOption = True,
    real_time: bool = False,
    interpreted: bool = False,
) -> Run:
    """Rehearse a campaign or session as `rig run` does, and return the run with its results.

    A rig file without wiring runs on the simulated plant, as fast as possible. A rig file with
    wiring runs on emulated devices, in real time, as by `rig run --sim`: this function never powers
    a rig. In the main thread, Ctrl-C (or the interruption of a notebook's cell) stops the run under
    control and returns it; from another thread, `rig request stop` does.

    Args:
        campaign: File (YAML), or the name of a shipped campaign or session.
        out: Folder that holds the runs; the run gets a folder in it.
        rig: Rig file or name of a shipped rig in place of the one that the file names.
        progress: True: a line on standard error; False: nothing; or a function that is called with
            `Progress` several times a second.
        real_time: Use the real clock for a rig without wiring, too.
        interpreted: Run the tick as plain Python, never compiled.

    Returns:
        The run. A trip is no exception: `run.outcome` has the status `fault` and the reason.

    Raises:
        RigError: If a check of the files fails; `problems` lists all of them. Also if the run
            cannot begin, or its results cannot be written.
    """
    with public_errors():
        opened = _open(campaign, rig)
        report, plan = opened.report, opened.report.plan
        if report.checked is None or plan is None:
            raise RigError(problems_text(report.problems), report.problems)
        if isinstance(report, CheckReport) and report.unpredicted:
            opened = _with_simulated_rows(opened)
        rig_path = None if rig is None else _path(rig, RIGS)
        emulated = report.checked.rig.wiring is not None
        options = RunOptions(rig_path, real_time, emulated, interpreted)
        with Reporter(progress, report.checked.file.name) as reporter:
            feedback = Feedback(_open_view(reporter), reporter.notice, lambda text: None)
            done = CampaignRun(opened, Path(out), options, feedback).execute(plan, {})
        if done.failed:
            raise RigError(f"{done.ended.folder}: {done.failed}")
        if not done.ended.outcome.ticks:
            raise RigError(f"{done.ended.folder}: {done.ended.outcome.reason}")
        return Run(done.ended.folder)


class _View:
    """Reports the snapshots of a run."""

    def __init__(self, reporter: Reporter, rows: int, on_start: Callable[[], None]) -> None:
        self.notice, self.part, self.columns = "", "", list[dict[str, Any]]()
        self._reporter, self._rows, self._on_start = reporter, rows, on_start
        self._begun: set[int] = set()  # rows
        self._started = False

    def __call__(self, snapshot: Snapshot) -> None:
        if not snapshot.row:
            return
        if not self._started:
            self._started = True
            self._on_start()
        row = int(snapshot.row.get("plan.row", NO_ROW))
        self._begun |= {row} - {NO_ROW}
        done = len(self._begun) - (row != NO_ROW)
        place = f"row {row} ({len(self._begun)} of {self._rows})"
        if row == NO_ROW:
            place = "after the last row" if self._begun else "before the first row"
        text = self.notice or f"{place}, {float(snapshot.row['time']):.0f} s of rig time"
        self._reporter.show(done, self._rows, text)


def _open_view(reporter: Reporter) -> Any:
    @contextmanager
    def view(
        title: str, mode: str, plan: Any, display: Display, on_start: Callable[[], None]
    ) -> Iterator[_View]:
        yield _View(reporter, len(plan.rows), on_start)

    return view


class Check:
    """The result of a check; in a condition it is True where the campaign can run.

    Attributes:
        ok: Whether the campaign or session can run.
        problems: Reasons why it cannot, each with file, line, key, value and message.
        warnings: What to look at in one that can run.
        summary: Contents of the report: rows, durations, sea, files, predictions.
    """

    def __init__(self, opened: OpenedTask) -> None:
        report = opened.report
        self.ok: bool = report.ok
        self.problems: tuple[Problem, ...] = report.problems
        self.warnings: tuple[Problem, ...] = report.warnings
        self.summary = Section(json.loads(report.to_json()), "check")
        self._text = report.text()

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        return self._text

    @property
    def rows(self) -> "pandas.DataFrame":
        """The predicted rows; simulated ones of a law without prediction; else empty."""
        import pandas

        summary = self.summary.as_dict()
        listed = summary.get("predictions") or summary.get("simulated", [])
        return pandas.json_normalize(listed) if isinstance(listed, list) else pandas.DataFrame()


def check(campaign: PathLike, *, rig: PathLike | None = None) -> Check:
    """Check a campaign or session as `rig check` does; problems are in the result.

    The rows of a law without prediction are simulated, if their loop is compiled on this host.

    Args:
        campaign: File (YAML), or the name of a shipped campaign or session.
        rig: Rig file or name of a shipped rig in place of the one that the file names.

    Raises:
        RigError: If there is no such file, or it names no usable kind of rig.
    """
    with public_errors():
        return Check(_with_simulated_rows(_open(campaign, rig)))


def _open(campaign: PathLike, rig: PathLike | None) -> OpenedTask:
    rig_path = None if rig is None else _path(rig, RIGS)
    return open_task(_path(campaign, CAMPAIGNS, SESSIONS), rig_path)


def _with_simulated_rows(opened: OpenedTask) -> OpenedTask:
    """Return a campaign without prediction with its simulated rows; others unchanged."""
    if not isinstance(opened.report, CheckReport):
        return opened
    from rig.sweeps.simulated_check import with_simulated_rows

    return opened._replace(report=with_simulated_rows(opened.report))


def _path(name: PathLike, *kinds: str) -> Path:
    """Return the path of a file, or of the shipped file of that name."""
    found = find_file(Path(name), *kinds)
    return found if isinstance(found, Path) else found.path
