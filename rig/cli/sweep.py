"""`rig sweep FILE --over KEY=V1,V2,...`."""

import re
import sys
import time
from pathlib import Path
from typing import Annotated, Any, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from rig.api.sweep_run import SweepRun, find_executor
from rig.cli import calibration_dates
from rig.cli.input_files import CAMPAIGNS, SESSIONS, find_run, input_file
from rig.cli.options import RUNS, TASK_HELP, Json, PictureFormat, PictureStyle, Runs
from rig.cli.output import FAILED, OK, STOPPED, fail, input_errors, print_json
from rig.config.problems import error_text
from rig.presentation.phrases import clock_text
from rig.recording.runs import run_info
from rig.recording.runs.create import BusyError
from rig.sweeps import sweep
from rig.sweeps.campaigns import LEAD_IN
from rig.sweeps.cases import Outcome
from rig.sweeps.simulator import Simulator

EXIT_CODES = """\
Exit codes: 0 every case gave its results; 1 some cases could not run, or the result could not be \
written; 2 bad input; 3 interrupted (run the same command again to continue)."""
_ADDRESS = r"(tcp|tls)://[^/\s]+:\d{1,5}"
_COMPILE_NOTICE = "compiling the loop, about a minute, once on this machine ..."
_MAX_REASONS = 5
_LINE_INTERVAL_S = 10.0  # s between lines where there is no terminal


def command(
    task: Annotated[Path, typer.Argument(metavar="FILE", help=TASK_HELP)],
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=V1,V2,...",
            help="Values of a key of the file (sea.hs_m), or of rig.KEY, plant.KEY, limits.KEY; "
            "repeatable.",
        ),
    ] = None,
    sequential: Annotated[
        bool,
        typer.Option("--sequential", help="Run a campaign's rows in sequence, as in the basin."),
    ] = False,
    lead_in: Annotated[
        float | None,
        typer.Option(
            "--lead-in",
            min=5,
            max=3600,
            help="Waves before each row of a campaign, s (default: 15); more until it settles.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", min=1, max=1024, help="Threads (default: one per core)."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="Run on a Dask cluster."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="NetCDF to write (default: sweep.nc in its folder)."),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option("--measured", metavar="RUN", help="Run to draw over the rows of a campaign."),
    ] = None,
    sweeps: Annotated[Path, typer.Option("--sweeps", help="Folder that holds the sweeps.")] = Path(
        "sweeps"
    ),
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Simulate a campaign's rows, or a session, for all values of some parameters, compiled.

    Each row of a campaign is a case of its own; a session is one, with the
    results of its analysis. Cases run on all cores or on a cluster. The
    command keeps finished cases and never runs them again.
    """
    _check_options(jobs, scheduler, out)
    with input_errors("sweep", as_json=as_json):
        measured = find_run(measured, runs) if measured else None
        options = {
            "--sequential": sequential, "--lead-in": lead_in is not None, "--measured": measured,
        }  # fmt: skip
        opened = sweep.open_sweep(
            input_file(task, CAMPAIGNS, SESSIONS),
            parameters or [],
            sweeps,
            sequential=sequential,
            lead_in=LEAD_IN if lead_in is None else lead_in,
            given=[option for option, is_given in options.items() if is_given],
        )
        if measured and "campaign" not in run_info(measured).config:
            raise ValueError(
                f"--measured {measured}: this run has no campaign rows; name another run"
            )
    began = time.monotonic()
    warnings = calibration_dates.warn_of_expired(opened.task, quiet=as_json, swept=opened.swept)
    executor = find_executor(opened, jobs, scheduler)
    view = SweepProgress(opened.folder.name, len(opened.cases), quiet=as_json)
    notice = (lambda text: None) if as_json else _notice
    run = SweepRun(opened, out, measured, redraw=bool(style or picture_format))
    try:
        prepare = None if scheduler else compile_loop  # workers compile for themselves
        run.compute(executor, view, notice, prepare)
    except BusyError as error:
        return fail("sweep", error, as_json=as_json, code=FAILED)
    except KeyboardInterrupt:
        return _report_interrupt(opened.folder, as_json=as_json)
    except (OSError, ValueError, ArithmeticError) as error:
        hint = f"{opened.folder}/ keeps {view.finished_text}, the same command continues"
        failure = RuntimeError(f"{error_text(error)}; {hint}")
        return fail("sweep", failure, as_json=as_json, code=FAILED)
    try:
        with input_errors("sweep", as_json=as_json):
            result = run.result(notice)
    except KeyboardInterrupt:
        return _report_interrupt(opened.folder, as_json=as_json)
    result |= {
        "seconds": round(time.monotonic() - began, 3),
        "running_s": round(view.elapsed, 3),
        "simulated_s": view.simulated,
        "run_now": view.done,
        "warnings": warnings,
    }
    if as_json:
        print_json(result)
    else:
        _print_result(result, opened)
    return FAILED if result["failed"] else OK


def _notice(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _check_options(jobs: int | None, scheduler: str | None, out: Path | None) -> None:
    """Check that the result can be written to ``out``, before hours of work instead of after."""
    if jobs is not None and scheduler is not None:
        raise typer.BadParameter(
            "--jobs sets the threads of this machine; leave it out with --scheduler"
        )
    if scheduler is not None and not re.fullmatch(_ADDRESS, scheduler):
        raise typer.BadParameter(f"--scheduler {scheduler}: no address; write tcp://HOST:PORT")
    if out is None:
        return
    if out.suffix != ".nc":
        raise typer.BadParameter(f"--out {out}: the result is NetCDF; give a name ending in .nc")
    if out.is_dir():
        raise typer.BadParameter(f"--out {out}: is a folder; name a file in it")
    if not out.parent.is_dir():
        raise typer.BadParameter(f"--out {out}: there is no folder {out.parent}; make it first")


def compile_loop(simulator: Simulator) -> None:
    """Compile the loop or read it from the cache; print a notice where this takes long."""
    if not simulator.is_compiled():
        print(_COMPILE_NOTICE, file=sys.stderr, flush=True)
    simulator.prepare()


def _report_interrupt(folder: Path, *, as_json: bool) -> int:
    message = f"interrupted; {folder}/ keeps the finished cases, the same command continues"
    if as_json:
        print_json({"status": "stopped", "message": message, "folder": str(folder)})
    else:
        print(f"\nrig sweep: {message}", file=sys.stderr)
    return STOPPED


def _print_result(result: dict[str, Any], opened: sweep.Sweep) -> None:
    states = result[opened.tasks.result_noun].items()
    counts = ", ".join(f"{count} {state}" for state, count in states)
    run_text = "all cases were finished before"
    if result["run_now"]:
        rate = result["simulated_s"] / result["running_s"]
        run_text = f"the cases took {result['running_s']:.1f} s of it, {rate:.0f} times real time"
    print(f"{counts} in {result['seconds']:.1f} s; {run_text}")
    print("\n".join(opened.tasks.summary_lines(result, opened.task)))
    for reason in result["failed"][:_MAX_REASONS]:
        print(f"failed: {reason}", file=sys.stderr)
    if len(result["failed"]) > _MAX_REASONS:
        print(f"and {len(result['failed']) - _MAX_REASONS} more reasons", file=sys.stderr)
    print(f"\n{result['result']}")
    for picture in result["pictures"]:
        print(picture)


class ProgressBar:
    """Draws a bar on a terminal, prints a line every 10 s elsewhere."""

    def __init__(self, name: str, total: int, *, quiet: bool) -> None:
        console = Console(stderr=True, highlight=False)
        self._quiet = quiet
        self._live_display = console.is_terminal and not quiet
        self._bar = Progress(
            TextColumn(name), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"),
            console=console, transient=True, disable=not self._live_display,
        )  # fmt: skip
        self._task = self._bar.add_task("", total=total, rate="")
        self._last_line_time: float | None = None  # before the first case, which may wait for code

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, done: int, line: str, rate: str = "") -> None:
        """Show the number of finished cases: a bar with their rate, or a line."""
        self._bar.update(self._task, completed=done, rate=rate)
        now = time.monotonic()
        self._last_line_time = self._last_line_time or now
        if self._live_display or self._quiet or now - self._last_line_time < _LINE_INTERVAL_S:
            return
        self._last_line_time = now
        print(line, file=sys.stderr, flush=True)


class SweepProgress(ProgressBar):
    """The progress of a sweep, with its rate and the time left."""

    def __init__(self, name: str, total: int, *, quiet: bool) -> None:
        super().__init__(name, total, quiet=quiet)
        self._total = total
        self._already_finished = self.done = self.failed = 0
        self.simulated = 0.0  # s
        self.elapsed = 0.0  # s, from the first case handed out to the last outcome
        self._start_time = time.monotonic()

    def begin(self, already_finished: int) -> None:
        """Start the clock; ``already_finished`` cases come from an earlier start of the sweep."""
        self._already_finished = already_finished
        self._start_time = self._last_line_time = time.monotonic()
        self._bar.update(self._task, completed=already_finished)
        if already_finished and not self._quiet:
            print(
                f"{already_finished} of {self._total} cases are already finished", file=sys.stderr
            )

    @property
    def finished_text(self) -> str:
        """The number of finished cases as text."""
        return f"{self._already_finished + self.done - self.failed} of {self._total} cases"

    def update(self, outcome: Outcome) -> None:
        """Count one more case."""
        self.done += 1
        self.failed += bool(outcome.failed)
        self.simulated += outcome.seconds
        self.elapsed = max(time.monotonic() - self._start_time, 1e-3)
        done, rate = self._already_finished + self.done, self._rate_text()
        self.show(done, f"{done} of {self._total} cases, {rate}", rate)

    def _rate_text(self) -> str:
        time_left = (self._total - self._already_finished - self.done) * self.elapsed / self.done
        failed = f", {self.failed} failed" if self.failed else ""
        rate, speed_ratio = self.done / self.elapsed, self.simulated / self.elapsed
        return (
            f"{rate:.3g} a second, {speed_ratio:.0f} times real time, "
            f"{clock_text(time_left)} left{failed}"
        )
