"""`rig run FILE`: run a campaign or session to its end, and analyse it."""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from enum import IntEnum, IntFlag
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rig.analysis.certificate import Found, certify, find_certificate
from rig.analysis.run_products import RunProducts
from rig.analysis.stop_reason import LostTicks, describe_ending, find_stop
from rig.campaign import AnyCampaign, CheckReport, resolved_config
from rig.campaign.choosing import adaptive_record, candidate_places
from rig.campaign.resume import Resumption, next_sea
from rig.cli.check import examine, print_problems, with_simulated_rows
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import RUNS, TASK_HELP, Interpreted, Json, Realtime, Rig, Runs, Sim, WithPage
from rig.cli.output import (
    FAILED,
    FAULT,
    INPUT_ERRORS,
    LOST,
    OK,
    STOPPED,
    fail,
    input_errors,
    print_json,
)
from rig.cli.run_panel import RunPanel
from rig.config.problems import Problem, error_text
from rig.config.wiring import WiringError
from rig.execution.attended import attended_task
from rig.execution.choosing_process import ChoosingProcess
from rig.execution.task import RunResult, run_task
from rig.host import disk
from rig.kinds.interface import Checked, Display, Products, Report, Tasks
from rig.kinds.registry import KindError, RigKind
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode, Outcome
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import ReasonTable
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, create

if TYPE_CHECKING:  # the page's server, which most runs do not need
    from rig.page.process import PageOfRun

EXIT_CODES = """\
Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig \
requires; 2 bad input; 3 stopped by the operator or for want of one, or Ctrl-C ended the drawing; \
4 the rig tripped; 5 a process died or rows were lost."""
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
    interpreted: bool = False
    arm: bool = False  # power waits for people
    manual: Path | None = None  # file of a run in manual mode, as a person named it
    unattended: bool = False  # manual mode without the dead man's time
    page: bool = False  # serve the operator's page, too
    kept: Path = Path("kept_rows.yaml")  # campaign with the set points that people keep
    resume: Path | None = None  # run that goes on
    accept_changes: bool = False  # of the files since its begin


def command(
    task: Annotated[Path | None, typer.Argument(metavar="FILE", help=TASK_HELP)] = None,
    realtime: Realtime = False,
    rig: Rig = None,
    sim: Sim = False,
    interpreted: Interpreted = False,
    arm: Annotated[
        bool, typer.Option("--arm", help="Switch power on only when an operator has armed the run.")
    ] = False,
    page: WithPage = False,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="RUN",
            help="Go on with a campaign that ended early: measure the rows that it lacks, in the"
            " same run. FILE may be left out.",
        ),
    ] = None,
    accept_changes: Annotated[
        bool,
        typer.Option(
            "--accept-changes",
            help="With --resume: go on although files have changed; the record names the changes.",
        ),
    ] = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a campaign or session, and analyse it.

    The rig file decides the kind of rig. A rig file without wiring runs as a
    rehearsal on the simulated plant. A rig file with wiring runs on the rig's
    devices.
    """
    options = RunOptions(
        rig, realtime, sim, interpreted, arm, page=page, accept_changes=accept_changes
    )
    if resume is not None:
        from rig.cli.resume import named_files

        try:
            run, task, rig = named_files(resume, runs, task, rig)
        except (create.BusyError, *INPUT_ERRORS) as error:
            return fail("run", error, as_json=as_json)
        options = options._replace(resume=run, rig=rig)
    if task is None or (accept_changes and resume is None):
        missing = ValueError("give a FILE, or --resume RUN (which --accept-changes needs)")
        return fail("run", missing, as_json=as_json)
    return run_named("run", task, runs, options, as_json=as_json)


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
        options = options._replace(rig=rig)
        kind = kind or kind_of_task(path, rig)
        tasks: Tasks = kind.room("tasks")
        display: Display = kind.room("display")
    report = examine(tasks, path, rig)
    checked, plan = report.checked, report.plan
    if checked is None or plan is None:
        return print_problems(report, as_json=as_json)
    plan_record: Mapping[str, Any] = {}
    if options.resume is not None:
        from rig.cli.resume import rest_of_run

        with input_errors(command_name, as_json=as_json):
            rest = rest_of_run(report, options.resume, accept_changes=options.accept_changes)
            plan, plan_record = rest.plan, rest.plan_record
    if checked.rig.wiring is not None:  # a rehearsal finds a trip by itself
        report = with_simulated_rows(report)
    with input_errors(command_name, as_json=as_json):
        rehearsed = _rehearsal_of(report, runs, options)
    if not as_json:
        print_warnings(() if options.manual else report.warnings, path)
        # A full disk stops the rig.
        if shortage := disk.space_shortage(runs, plan.duration, 1.0 / plan.dt):
            print(f"warning: {shortage}", file=sys.stderr)
    try:
        mode = _execution_mode(tasks, checked, options)
        importing = Thread(target=_import_products, args=(kind,), name="products")
        if not mode.real_clock:
            importing.start()
        with input_errors(command_name, as_json=as_json):
            stages = _Stages(tasks, display, report, path, runs, options, rehearsed, quiet=as_json)
        ended = stages.run(plan, plan_record, options.resume)
    except WiringError as error:
        return fail(command_name, error, as_json=as_json)
    except (create.BusyError, OSError, RunError) as error:
        return fail(command_name, error, as_json=as_json, code=FAILED)
    products = (
        RunProducts((), {}, rows_done=0, text="Manual mode: the journal has the set points.")
        if options.manual
        else _analyse(kind, ended, len(plan.rows), importing, quiet=as_json)
    )
    if stages.problem:
        products = products._replace(
            trouble="; ".join(filter(None, (products.trouble, stages.problem)))
        )
    done = ended.outcome.status == "complete" and not options.manual
    if done and not (products.trouble or products.interrupted):
        products = _with_certificate(products, ended.folder, report, options)
    failed = "; ".join(filter(None, (ended.save_error, products.trouble)))
    trouble = "; ".join(filter(None, (failed, products.interrupted)))
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
    return exit_code(outcome, failed, interrupted=bool(products.interrupted))


class _Stages:
    """The plans of a run, executed one after the other: one, or one in the sea of each seed."""

    def __init__(
        self,
        tasks: Tasks,
        display: Display,
        report: Report,
        path: Path,
        runs: Path,
        options: RunOptions,
        rehearsed: Found | None,
        *,
        quiet: bool,
    ) -> None:
        """``rehearsed``: certificate of the campaign, of which the run keeps a copy.

        ValueError for an adaptive campaign without the prediction that it is to start from.
        """
        self._adaptive: dict[str, Any] = {}
        if isinstance(report, CheckReport) and not options.manual:
            self._adaptive = adaptive_record(report)
        self._tasks, self._display, self._report = tasks, display, report
        self._path, self._runs, self._options = path, runs, options
        self._rehearsed, self._quiet = rehearsed, quiet
        self._page: PageOfRun | None = None  # of the newest stage
        self.problem = ""  # why the rows of an adaptive campaign were not chosen to the end

    def run(self, plan: Any, record: Mapping[str, Any], resumed: Path | None) -> RunResult:
        """Run a plan and those that follow it; ``record``, ``resumed``: of a run that goes on."""
        ended = self._run_one(plan, record, resumed)
        while (rest := self._next_stage(plan, ended)) is not None:
            plan = rest.plan
            ended = self._run_one(plan, rest.plan_record, ended.folder)
        return ended

    def _run_one(self, plan: Any, record: Mapping[str, Any], resumed: Path | None) -> RunResult:
        tasks, options, checked, sea = self._tasks, self._options, self._report.checked, ""
        assert checked is not None
        if (campaign := self._campaign) is not None:
            checked = campaign._replace(seed=plan.seed)
            sea = f", seed {plan.seed}" if len(campaign.file.seeds) > 1 else ""
        mode = _execution_mode(tasks, checked, options)._replace(interpreted=options.interpreted)
        title = f"{checked.file.name} on {checked.rig.name}{sea}"
        with (  # a page shows one stage
            _page_of_run(self._runs, self._page, enabled=options.page) as page,
            RunPanel(
                title, mode.name, plan, self._display, page.started, quiet=self._quiet
            ) as view,
            _choosing_process(enabled=bool(self._adaptive)) as choosing,
        ):
            task = attended_task(
                tasks.execution_task(checked, plan),
                checked,
                plan,
                options.manual or self._path,
                partial(tasks.examine, rig=options.rig),
                options.kept,
                arming=options.arm,
                manual=options.manual is not None,
                unattended=options.unattended,
                places=candidate_places(campaign, plan.rows) if self._adaptive and campaign else {},
            )
            fields = {}
            if (log_fields := getattr(self._display, "log_fields", None)) is not None:
                fields["log_fields"] = log_fields(checked.rig).as_record()
            task = task._replace(plan=task.plan | dict(record) | fields | self._adaptive)
            began, self._page = partial(_begin, page, self._rehearsed, choosing), page.process
            if task.people.live is not None:
                view.columns = task.people.live.describe()
            ended = run_task(task, self._runs, view, mode, began, resumed)
            self.problem = choosing.problem if choosing is not None else ""
            return ended

    @property
    def _campaign(self) -> AnyCampaign | None:
        return self._report.campaign if isinstance(self._report, CheckReport) else None

    def _next_stage(self, plan: Any, ended: RunResult) -> Resumption | None:
        """Return the plan in the next sea of a run that has measured in the sea before."""
        campaign, options = self._campaign, self._options
        if campaign is None or options.manual or exit_code(ended.outcome, ended.save_error) != OK:
            return None
        if len(campaign.file.seeds) == 1:
            return None
        rest = next_sea(ended.folder, campaign, plan.seed)
        by_itself = campaign.rig.wiring is None or options.emulated or options.arm
        if rest is not None and not by_itself:
            print(
                f"the rows in the sea of seed {plan.seed} are measured; give the wave maker that "
                f"of seed {rest.plan.seed}, wait for calm water, then: "
                f"rig run --resume {ended.folder}",
                file=sys.stderr,
            )
            return None
        return rest


def _rehearsal_of(report: Report, runs: Path, options: RunOptions) -> Found | None:
    """Return the certificate of a campaign that is to run on a rig's devices, and print it.

    None for other runs, and without one; ValueError if the rig requires it.
    """
    campaign = report.campaign if isinstance(report, CheckReport) else None
    if campaign is None or not campaign.points or options.manual is not None:
        return None
    if campaign.rig.wiring is None or options.emulated:
        return None
    found = find_certificate(runs, json.loads(resolved_config(campaign)))
    if found is None:
        text = f"no rehearsal of this campaign is in {runs}/; rig run FILE --sim rehearses it"
        if campaign.file.adaptive is not None:
            text = (
                f"no rehearsal of all candidates of this campaign is in {runs}/; rehearse the same "
                "campaign without `adaptive`"
            )
        if campaign.rig.operator.rehearsal == "required":
            raise ValueError(f"{text}, and {campaign.rig.name} requires one (operator.rehearsal)")
        print(text, file=sys.stderr)
    else:
        print(found.text(), file=sys.stderr)
    return found


@contextmanager
def _choosing_process(*, enabled: bool) -> Iterator[ChoosingProcess | None]:
    """Yield the process that chooses the rows of an adaptive campaign; None for other runs."""
    with closing(ChoosingProcess()) as process:
        yield process if enabled else None


def _begin(
    page: "_PageCalls", rehearsed: Found | None, choosing: ChoosingProcess | None, folder: Path
) -> None:
    if rehearsed is not None:
        rehearsed.write(folder)
    if choosing is not None:
        choosing.begin(folder)
    page.run_began(folder)


def _with_certificate(
    products: RunProducts, folder: Path, report: Report, options: RunOptions
) -> RunProducts:
    """Write the certificate of a complete rehearsal; return the products with it."""
    campaign = report.campaign if isinstance(report, CheckReport) else None
    if campaign is None or (campaign.rig.wiring is not None and not options.emulated):
        return products
    try:
        path = certify(folder)
    except (RunError, OSError) as error:
        return products._replace(trouble=f"no certificate of the rehearsal: {error_text(error)}")
    return products if path is None else products._replace(files=(*products.files, path))


class _PageCalls(NamedTuple):
    """Calls by which a page follows its run; without a page they do nothing."""

    run_began: Callable[[Path], None] = lambda folder: None
    started: Callable[[], None] = lambda: None  # the first row is there: the run is not refused
    process: "PageOfRun | None" = None


@contextmanager
def _page_of_run(runs: Path, before: "PageOfRun | None", *, enabled: bool) -> Iterator[_PageCalls]:
    """Start the operator's page, and yield its calls; once the run starts, print its address.

    ``before``: the page of the stage before, in whose place it comes.

    The run needs the page for nothing: if it cannot start or ends, one line says why.
    """
    page = None
    if enabled:
        from rig.page.process import PageOfRun

        try:
            page = PageOfRun(runs, before)
        except OSError as error:
            print(f"no page: {error_text(error)}", file=sys.stderr)
    if page is None:
        yield _PageCalls()
        return
    has_started = Event()

    def start() -> None:
        print(f"page: {page.url}", file=sys.stderr, flush=True)
        has_started.set()

    def report_failure() -> None:
        text = page.failure()
        has_started.wait()  # a run that is refused has no page
        if text:
            print(text, file=sys.stderr, flush=True)

    Thread(target=report_failure, name="page", daemon=True).start()
    try:
        yield _PageCalls(page.run_began, start, page)
    finally:
        page.close()


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


def _import_products(kind: RigKind) -> None:
    """Import the room of the results, which takes a second; errors appear when it is used."""
    with suppress(Exception):
        kind.room("products")


def _analyse(
    kind: RigKind, ended: RunResult, planned_rows: int, importing: Thread, *, quiet: bool
) -> RunProducts:
    """Write the products of a run and the number of its complete rows.

    ``importing``: the thread that imports the room of the products, if it was started.
    """
    folder, outcome = ended.folder, ended.outcome
    products = RunProducts((), {})
    try:
        if importing.ident is not None:
            importing.join()
        room: Products = kind.room("products")
        products = room.NO_PRODUCTS
        if outcome.ticks == 0:
            return products
        if not quiet:
            print(f"{room.PROGRESS} ...", file=sys.stderr, flush=True)
        products = room.after_run(folder, outcome)
    except KindError as error:
        return products._replace(trouble=str(error))
    except KeyboardInterrupt:
        left_out = f"pictures are not complete: draw them with `rig plot {folder}`"
        products = products._replace(interrupted=left_out)
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


def exit_code(outcome: Outcome, trouble: str, *, interrupted: bool = False) -> int:
    """Return the command's exit code.

    ``trouble`` is a failure after the run (empty: none); ``interrupted``: Ctrl-C ended the drawing.
    """
    if outcome.status == "crashed" or outcome.died or outcome.dropped or outcome.unsaved:
        return LOST
    if trouble or outcome.status == "refused" or (outcome.moved and outcome.status == "complete"):
        return FAILED
    if interrupted and outcome.status == "complete":
        return STOPPED
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
