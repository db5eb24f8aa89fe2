"""`rig run FILE`: run a campaign or session to its end, and analyse it."""

import math
import sys
import time
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rig.analysis.run_products import RunProducts
from rig.analysis.stop_reason import LostTicks, describe_ending, find_stop
from rig.cli.check import examine, print_problems
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import RUNS, TASK_HELP, Json, Realtime, Rig, Runs, Sim
from rig.cli.output import FAILED, FAULT, LOST, OK, STOPPED, fail, input_errors, print_json
from rig.config.problems import Problem, error_text
from rig.execution.task import RunResult, run_task
from rig.host import disk
from rig.kinds import KindError, RigKind
from rig.kinds.interface import Checked, Display, Products, Tasks
from rig.kinds.rig_file import kind_of_task
from rig.presentation.phrases import clock_text
from rig.processes.run_types import ExecutionMode, Outcome
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import Reason, ReasonTable
from rig.realtime.safety import STOP_2, Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import RunError, create
from rig.wires.job import WiringError

if TYPE_CHECKING:
    from rig.kinds.interface import Display
    from rig.processes.run_types import Snapshot


_LINE_INTERVAL_S = 10.0  # s between lines where there is no terminal
_MODE_LABELS = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def _loss_text(snapshot: "Snapshot") -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


class RunPanel:
    """Draws snapshots: a live panel on a terminal, a line every 10 s elsewhere.

    The rig's position, motion and power are those of its kind's room `display`.
    """

    def __init__(
        self, title: str, mode: str, plan: Any, display: "Display", *, quiet: bool
    ) -> None:
        self._title, self._mode, self._plan, self._display = title, mode, plan, display
        self._quiet = quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live_display = self._console.is_terminal and not quiet
        self._start_time = time.monotonic()
        self._last_line_time = self._start_time
        self._last_row = NO_ROW
        self._measured: dict[str, float | int] = {}  # newest row in a measured window
        self._printed_notice = ""
        self.notice = ""  # the pending request to the run, e.g. after Ctrl-C

    def __enter__(self) -> "RunPanel":
        if self._live_display:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live_display:
            self._live.stop()

    def __call__(self, snapshot: "Snapshot") -> None:
        """Draw the current state of the run."""
        if self._quiet:
            return
        if snapshot.row.get("power.samples", 0) > 0:
            self._measured = snapshot.row
        if not self._live_display and self.notice != self._printed_notice:
            self._printed_notice = self.notice
            print(self.notice, file=sys.stderr, flush=True)
        if not snapshot.row:
            return
        if self._live_display:
            self._live.update(self._panel(snapshot), refresh=True)
            return
        now, row = time.monotonic(), int(snapshot.row["plan.row"])
        if now - self._last_line_time >= _LINE_INTERVAL_S or (
            row != self._last_row and now - self._last_line_time >= 1.0
        ):
            self._last_line_time, self._last_row = now, row
            print(self._line(snapshot), file=sys.stderr, flush=True)

    def _panel(self, snapshot: "Snapshot") -> Group:
        row = snapshot.row
        elapsed, total = float(row["time"]), self._display.total_duration(self._plan, row)
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self._display.plan_position(self._plan, row))
        mode = Mode(int(row["safety.mode"]))
        state = Text(mode.name, style="green" if mode < STOP_2 else "bold red")
        if int(row["safety.reason"]) != Reason.NONE:
            state.append(f"  {snapshot.reason}", style="bold red")
        table.add_row("mode", state)
        for label, text in self._display.detail_lines(self._plan, row, self._measured):
            table.add_row(label, text)
        table.add_row("time", self._time_text(snapshot))
        health = f"{_loss_text(snapshot)}, {snapshot.unsaved_rows} rows not yet on disk"
        table.add_row("health", health)
        heading = Text(f"{self._title}   ", style="bold")
        heading.append(_MODE_LABELS.get(self._mode, self._mode.upper()), style="black on yellow")
        bar = Table.grid()
        bar.add_row(ProgressBar(total=total, completed=min(elapsed, total), width=72))
        parts: list[Text | Table] = [heading, bar, table]
        for text in (snapshot.problem, self.notice):
            if text:
                parts.append(Text(text, style="bold red"))
        return Group(*parts)

    def _time_text(self, snapshot: "Snapshot") -> str:
        elapsed = float(snapshot.row["time"])
        planned = self._display.total_duration(self._plan, snapshot.row)
        total = max(elapsed, planned)  # the stop at the end is not in the plan
        speed = elapsed / max(time.monotonic() - self._start_time, 1e-3)
        return (
            f"{clock_text(elapsed)} of {clock_text(total)} rig time, "
            f"{clock_text((total - elapsed) / max(speed, 1e-6))} left at {speed:.1f} x real time"
        )

    def _line(self, snapshot: "Snapshot") -> str:
        position = " ".join(self._display.plan_position(self._plan, snapshot.row))
        motion = self._display.short_text(self._plan, snapshot.row, self._measured)
        return f"{self._time_text(snapshot)}  {position}  {motion}  {_loss_text(snapshot)}" + (
            f"  {snapshot.problem}" if snapshot.problem else ""
        )


EXIT_CODES = """\
Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig \
requires; 2 bad input; 3 stopped by the operator; 4 the rig tripped; 5 a process died or rows \
were lost."""
_MAX_WARNINGS = 5
_NAMES: dict[str, type[IntEnum]] = {"safety.mode": Mode, "plan.phase": Phase}
_FLAGS: dict[str, type[IntFlag]] = {
    "command.limited": LimitFlag,
    "warned": WarningFlag,
}  # of every axis
_EXIT_CODES = {"complete": OK, "stopped": STOPPED, "fault": FAULT}


class RunOptions(NamedTuple):
    """Options of a run apart from the campaign or session file."""

    rig: Path | None = None  # replaces the rig that the file names
    realtime: bool = False
    emulated: bool = False  # --sim


def command(
    task: Annotated[Path, typer.Argument(metavar="FILE", help=TASK_HELP)],
    realtime: Realtime = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a campaign or session, and analyse it.

    The rig file decides the kind of rig. A rig file without wiring runs as a
    rehearsal on the simulated plant. A rig file with wiring runs on the rig's
    devices.
    """
    return run_named("run", task, runs, RunOptions(rig, realtime, sim), as_json=as_json)


def run_named(
    command_name: str,
    name: Path,
    runs: Path,
    options: RunOptions,
    *,
    as_json: bool,
    folders: tuple[str, ...] = (CAMPAIGNS, SESSIONS),
    kind: RigKind | None = None,
) -> int:
    """Run the campaign or session that a person names, and return the exit code.

    ``folders`` are those of the shipped files to search; ``kind``: the kind of rig that it must
    have, else that of its rig file.
    """
    with input_errors(command_name, as_json=as_json):
        path, rig = input_file(name, *folders), rig_file(options.rig)
        kind = kind or kind_of_task(path, rig)
        tasks: Tasks = kind.room("tasks")
        display: Display = kind.room("display")
    report = examine(tasks, path, rig)
    checked, plan = report.checked, report.plan
    if checked is None or plan is None:
        return print_problems(report, as_json=as_json)
    if not as_json:
        print_warnings(report.warnings, path)
        # A full disk stops the rig.
        if shortage := disk.space_shortage(runs, plan.duration, 1.0 / plan.dt):
            print(f"warning: {shortage}", file=sys.stderr)
    title = f"{checked.file.name} on {checked.rig.name}"
    try:
        mode = _execution_mode(tasks, checked, options)
        with RunPanel(title, mode.name, plan, display, quiet=as_json) as view:
            ended = run_task(tasks.execution_task(checked, plan), runs, view, mode)
    except WiringError as error:
        return fail(command_name, error, as_json=as_json)
    except (create.BusyError, OSError, RunError) as error:
        return fail(command_name, error, as_json=as_json, code=FAILED)
    products = _analyse(kind, ended, len(plan.rows), quiet=as_json)
    trouble = "; ".join(filter(None, (ended.save_error, products.trouble)))
    outcome, lost = ended.outcome, lost_ticks(ended)
    if as_json:
        record = {
            **outcome._asdict(),
            "last_row": row_as_json(outcome.last_row, ended.reasons),
            **products.results,
            "lost_ticks": lost and lost._asdict(),
            "folder": str(ended.folder),
            "products": [str(file) for file in products.files],
            "trouble": trouble,
            "warnings": [warning.as_dict() for warning in report.warnings],
        }
        print_json(record)
    else:
        print_end(ended, products.text, lost)
        _print_folder(ended, products.files, trouble)
    return exit_code(outcome, trouble)


def print_warnings(warnings: tuple[Problem, ...], path: Path) -> None:
    """Print the warnings of `rig check`, for an operator who did not run it before."""
    for warning in warnings[:_MAX_WARNINGS]:
        print(f"warning: {warning.text()}", file=sys.stderr)
    if len(warnings) > _MAX_WARNINGS:
        remaining = len(warnings) - _MAX_WARNINGS
        print(f"and {remaining} more warnings; rig check {path} lists all", file=sys.stderr)


def _execution_mode(tasks: Tasks, checked: Checked, options: RunOptions) -> ExecutionMode:
    """Return the execution mode.

    A rig with wiring runs on its devices or, with --sim, on emulated devices. A rig without wiring
    runs as a rehearsal.
    """
    if checked.rig.wiring is not None:
        return tasks.wired_mode(checked, emulated=options.emulated)
    if options.emulated:
        raise WiringError(
            f"{checked.rig.name} has no wiring, so no devices can be emulated; leave out --sim"
        )
    return tasks.rehearsal_mode(checked, real_clock=options.realtime)


def _analyse(kind: RigKind, ended: RunResult, planned_rows: int, *, quiet: bool) -> RunProducts:
    """Write the products of a run and the number of its complete rows."""
    try:
        room: Products = kind.room("products")
    except KindError as error:
        return RunProducts((), {}, trouble=str(error))
    folder, outcome = ended.folder, ended.outcome
    if outcome.ticks == 0:
        return room.NO_PRODUCTS
    if not quiet:
        print(f"{room.PROGRESS} ...", file=sys.stderr, flush=True)
    try:
        products = room.after_run(folder, outcome)
    except KeyboardInterrupt:
        trouble = f"interrupted; `rig plot {folder}` writes the products"
        return room.NO_PRODUCTS._replace(trouble=trouble)
    rows_done = products.rows_done
    if rows_done is None:  # all rows, or those before the one in which the run stopped
        complete = outcome.status == "complete"
        rows_done = planned_rows if complete else max(0, int(outcome.last_row.get("plan.row", 0)))
    try:
        create.write_rows_done(folder, rows_done)
    except (OSError, ValueError) as error:
        return products._replace(trouble=products.trouble or error_text(error))
    return products


def lost_ticks(ended: RunResult) -> LostTicks | None:
    """Return the ticks that the host lost before a trip, where they may be its cause."""
    try:
        return find_stop(ended.folder, {"status": ended.outcome.status}).lost
    except (RunError, OSError):
        return None  # the analysis has already reported the error in the record


def exit_code(outcome: Outcome, trouble: str) -> int:
    """Return the command's exit code; ``trouble`` is a failure after the run (empty: none)."""
    if outcome.status == "crashed" or outcome.dropped or outcome.unsaved:
        return LOST
    if trouble or outcome.status == "refused" or (outcome.moved and outcome.status == "complete"):
        return FAILED
    return _EXIT_CODES[outcome.status]


def row_as_json(row: dict[str, float | int], reasons: ReasonTable) -> dict[str, Any]:
    """Return a row as JSON values.

    Coded numbers become names, flags become lists of names, NaN and infinity become null.
    """
    values: dict[str, Any] = {}
    for name, value in row.items():
        if name == "safety.reason":
            values[name] = reasons.name(int(value)) if int(value) in reasons else value
        elif name in _NAMES:
            values[name] = {int(code): code.name for code in _NAMES[name]}.get(int(value), value)
        elif flags := _flag_type(name):
            values[name] = [flag.name for flag in flags if int(value) & flag]
        else:
            values[name] = value if math.isfinite(value) else None
    return values


def _flag_type(name: str) -> type[IntFlag] | None:
    endings = (flags for end, flags in _FLAGS.items() if f".{name}".endswith(f".{end}"))
    return next(endings, None)


def print_end(ended: RunResult, summary: str, lost: LostTicks | None) -> None:
    """Print the summary, and on standard error how the run ended, but not twice on one screen."""
    outcome = ended.outcome
    status = {
        "status": outcome.status,
        "reason": outcome.reason,
        "reason_text": ended.reasons.text(outcome.reason),
    }
    ending = describe_ending(status, lost).description
    if summary:
        print(summary)
    already_printed = ending in summary and (
        sys.stdout.isatty() or outcome.status not in ("crashed", "refused")
    )
    if not already_printed:
        print(f"\n{ending}.", file=sys.stderr)


def _print_folder(ended: RunResult, products: tuple[Path, ...], trouble: str) -> None:
    """Print lost rows, the messages of the run, and the paths of folder and products."""
    outcome = ended.outcome
    if outcome.dropped or outcome.unsaved:
        lost = f"{outcome.dropped} rows dropped, {outcome.unsaved} rows not saved"
        print(f"\nlost: {lost}", file=sys.stderr)
    for message in (*outcome.messages, outcome.died, outcome.moved, trouble):
        if message:
            print(f"\n{message}", file=sys.stderr)
    print(f"\n{ended.folder}/")
    for product in products:
        print(f"  {product.name}")
