"""The run of a campaign or session from its file to its results, for commands and Python alike."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from rig.analysis.certificate import Found, certify, find_certificate
from rig.analysis.run_products import RunProducts
from rig.analysis.stop_reason import LostTicks, find_stop
from rig.campaign import AnyCampaign, CheckReport, resolved_config
from rig.campaign.choosing import adaptive_record, candidate_places
from rig.campaign.resume import Resumption, next_sea
from rig.config.problems import error_text
from rig.config.wiring import WiringError
from rig.execution.attended import attended_task
from rig.execution.choosing_process import ChoosingProcess
from rig.execution.task import RunResult, View, run_task
from rig.kinds.interface import Checked, Display, Products, Report, Tasks
from rig.kinds.registry import KindError, RigKind
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode
from rig.recording.runs import RunError, create

if TYPE_CHECKING:  # the page's server, which most runs do not need
    from rig.page.process import PageOfRun


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


class RunView(View, Protocol):
    """A display of the run that can name the set points which people choose."""

    columns: list[dict[str, Any]]
    part: str  # of the campaign that the plan is, as text after a time; empty: all of it


class OpenView(Protocol):
    """Opens the display of a run."""

    def __call__(
        self, title: str, mode: str, plan: Any, display: Display, on_start: Callable[[], None]
    ) -> AbstractContextManager[RunView]:
        """Return the display; it calls ``on_start`` with the first row of the run."""


class Feedback(NamedTuple):
    """Channels by which a run reports to people."""

    open_view: OpenView
    notice: Callable[[str], None]  # of what people have to know or do
    progress: Callable[[str], None]  # of work that takes a while


class OpenedTask(NamedTuple):
    """A campaign or session with its kind of rig and the report of its check."""

    path: Path
    kind: RigKind
    tasks: Tasks
    display: Display
    report: Report

    @property
    def campaign(self) -> AnyCampaign | None:
        """The campaign; None of a session, and with problems."""
        return self.report.campaign if isinstance(self.report, CheckReport) else None


def open_task(path: Path, rig: Path | None = None, kind: RigKind | None = None) -> OpenedTask:
    """Check a campaign or session that is to run today (UTC).

    ``rig`` replaces the rig that the file names; ``kind``: the kind of rig that it must have, else
    that of its rig file. Problems of the files are in the report. Raises `ConfigError` or
    `KindError` if the file names no usable kind of rig.
    """
    kind = kind or kind_of_task(path, rig)
    tasks: Tasks = kind.room("tasks")
    display: Display = kind.room("display")
    return OpenedTask(path, kind, tasks, display, examine(tasks, path, rig))


def examine(tasks: Tasks, path: Path, rig: Path | None) -> Report:
    """Return the whole report on a campaign or session that is to run today (UTC)."""
    return tasks.examine(path, rig, day=datetime.now(UTC).date())


class CompletedRun(NamedTuple):
    """A run that has ended, with its results."""

    ended: RunResult
    products: RunProducts
    failed: str  # why files could not be written; empty: all were written
    lost: LostTicks | None  # before a trip, where they may be its cause

    @property
    def trouble(self) -> str:
        """Everything that is missing of the results, as text; empty without."""
        return "; ".join(filter(None, (self.failed, self.products.interrupted)))


class CampaignRun:
    """A campaign or session that is about to run: one plan, or one in the sea of each seed."""

    def __init__(
        self,
        opened: OpenedTask,
        runs: Path,
        options: RunOptions,
        feedback: Feedback,
        rehearsed: Found | None = None,
    ) -> None:
        """``rehearsed``: certificate of the campaign, of which the run keeps a copy.

        ValueError for an adaptive campaign without the prediction that it is to start from;
        WiringError for a rig whose wires must not be powered, or that has none to emulate.
        """
        self._opened, self._runs, self._options = opened, runs, options
        self._feedback, self._rehearsed = feedback, rehearsed
        assert opened.report.checked is not None
        self._mode = _execution_mode(opened.tasks, opened.report.checked, options)
        self._adaptive: dict[str, Any] = {}
        if isinstance(opened.report, CheckReport) and not options.manual:
            self._adaptive = adaptive_record(opened.report)
        self._page: PageOfRun | None = None  # of the newest stage
        self._problem = ""  # why the rows of an adaptive campaign were not chosen to the end

    def execute(self, plan: Any, record: Mapping[str, Any]) -> CompletedRun:
        """Run the plan and those that follow it to the end, and analyse the run.

        ``record``: further entries of `plan.json`, of a run that goes on. Raises BusyError, OSError
        or RunError if the run cannot begin.
        """
        opened, options = self._opened, self._options
        importing = Thread(target=_import_products, args=(opened.kind,), name="products")
        if not self._mode.real_clock:
            importing.start()
        ended = self._run(plan, record, options.resume)
        products = (
            RunProducts((), {}, rows_done=0, text="Manual mode: the journal has the set points.")
            if options.manual
            else analyse(opened.kind, ended, len(plan.rows), importing, self._feedback.progress)
        )
        if self._problem:
            trouble = "; ".join(filter(None, (products.trouble, self._problem)))
            products = products._replace(trouble=trouble)
        done = ended.outcome.status == "complete" and not options.manual
        if done and not (products.trouble or products.interrupted):
            if opened.campaign is not None:
                self._feedback.progress("comparing with the limits for the certificate ...")
            products = _with_certificate(products, ended.folder, opened.campaign, options)
        failed = "; ".join(filter(None, (ended.save_error, products.trouble)))
        return CompletedRun(ended, products, failed, lost_ticks(ended))

    def _run(self, plan: Any, record: Mapping[str, Any], resumed: Path | None) -> RunResult:
        """Run a plan and those that follow it; ``resumed``: the run that goes on."""
        ended = self._run_one(plan, record, resumed)
        while (rest := self._next_stage(plan, ended)) is not None:
            plan = rest.plan
            ended = self._run_one(plan, rest.plan_record, ended.folder)
        return ended

    def _run_one(self, plan: Any, record: Mapping[str, Any], resumed: Path | None) -> RunResult:
        opened, options, sea, part = self._opened, self._options, "", ""
        tasks, display, checked = opened.tasks, opened.display, opened.report.checked
        mode = self._mode
        assert checked is not None
        if (campaign := opened.campaign) is not None and len(campaign.file.seeds) > 1:
            checked, sea = campaign._replace(seed=plan.seed), f", seed {plan.seed}"
            seeds = campaign.file.seeds
            part = f" in sea {seeds.index(plan.seed) + 1} of {len(seeds)}"
            mode = _execution_mode(tasks, checked, options)
        mode = mode._replace(interpreted=options.interpreted)
        title = f"{checked.file.name} on {checked.rig.name}{sea}"
        with (  # a page shows one stage
            _page_of_run(
                self._runs, self._page, self._feedback.notice, enabled=options.page
            ) as page,
            self._feedback.open_view(title, mode.name, plan, display, page.started) as view,
            _choosing_process(enabled=bool(self._adaptive)) as choosing,
        ):
            task = attended_task(
                tasks.execution_task(checked, plan),
                checked,
                plan,
                options.manual or opened.path,
                partial(tasks.examine, rig=options.rig),
                options.kept,
                arming=options.arm,
                manual=options.manual is not None,
                unattended=options.unattended,
                places=candidate_places(campaign, plan.rows) if self._adaptive and campaign else {},
            )
            fields = {}
            if (log_fields := getattr(display, "log_fields", None)) is not None:
                fields["log_fields"] = log_fields(checked.rig).as_record()
            task = task._replace(plan=task.plan | dict(record) | fields | self._adaptive)
            began, self._page = partial(_begin, page, self._rehearsed, choosing), page.process
            view.part = part
            if task.people.live is not None:
                view.columns = task.people.live.describe()
            ended = run_task(task, self._runs, view, mode, began, resumed)
            self._problem = choosing.problem if choosing is not None else ""
            return ended

    def _next_stage(self, plan: Any, ended: RunResult) -> Resumption | None:
        """Return the plan in the next sea of a run that has measured in the sea before."""
        campaign, options = self._opened.campaign, self._options
        if campaign is None or options.manual or not _is_complete(ended):
            return None
        if len(campaign.file.seeds) == 1:
            return None
        rest = next_sea(ended.folder, campaign, plan.seed)
        by_itself = campaign.rig.wiring is None or options.emulated or options.arm
        if rest is not None and not by_itself:
            self._feedback.notice(
                f"the rows in the sea of seed {plan.seed} are measured; give the wave maker that "
                f"of seed {rest.plan.seed}, wait for calm water, then: "
                f"rig run --resume {ended.folder}"
            )
            return None
        return rest


def find_rehearsal(
    campaign: AnyCampaign | None, runs: Path, options: RunOptions, notice: Callable[[str], None]
) -> Found | None:
    """Return the certificate of a campaign that is to run on a rig's devices, and report it.

    None for other runs, and without one; ValueError if the rig requires it.
    """
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
        notice(text)
    else:
        notice(found.text())
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
    products: RunProducts, folder: Path, campaign: AnyCampaign | None, options: RunOptions
) -> RunProducts:
    """Write the certificate of a complete rehearsal; return the products with it."""
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
def _page_of_run(
    runs: Path, before: "PageOfRun | None", notice: Callable[[str], None], *, enabled: bool
) -> Iterator[_PageCalls]:
    """Start the operator's page, and yield its calls; once the run starts, report its address.

    ``before``: the page of the stage before, in whose place it comes.

    The run needs the page for nothing: if it cannot start or ends, one line says why.
    """
    page = None
    if enabled:
        from rig.page.process import PageOfRun

        try:
            page = PageOfRun(runs, before)
        except OSError as error:
            notice(f"no page: {error_text(error)}")
    if page is None:
        yield _PageCalls()
        return
    has_started = Event()

    def start() -> None:
        notice(f"page: {page.url}")
        has_started.set()

    def report_failure() -> None:
        text = page.failure()
        has_started.wait()  # a run that is refused has no page
        if text:
            notice(text)

    Thread(target=report_failure, name="page", daemon=True).start()
    try:
        yield _PageCalls(page.run_began, start, page)
    finally:
        page.close()


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


def analyse(
    kind: RigKind,
    ended: RunResult,
    planned_rows: int,
    importing: Thread,
    progress: Callable[[str], None],
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
        progress(f"{room.PROGRESS} ...")
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


def _is_complete(ended: RunResult) -> bool:
    """Return whether a plan ran to its end, and its record has every tick."""
    outcome = ended.outcome
    trouble = outcome.died or outcome.dropped or outcome.unsaved or outcome.moved
    return outcome.status == "complete" and not (trouble or ended.save_error)
