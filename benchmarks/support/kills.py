"""Kill (SIGKILL) processes of a rehearsal at given moments, and compare its record with its ring.

The ring is held open from outside: its head counts the rows that the loop put, and the rows remain
in it when every process of the run is dead. The files, and the missing ticks that `rig recover`
states, are compared with it, independently of the logger.
"""

import os
import random
import signal
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.support.live_run import (
    LOGGER,
    LOOP,
    LiveRun,
    TimeOutError,
    is_running,
    live_run,
    wait_until,
)
from benchmarks.support.recorded import write_campaign_file
from rig.kinds.wavebot.tick import WaveBotRow
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.realtime.safety import STOP_0
from rig.recording.ring import RingReader
from rig.recording.row_layout import leaves
from rig.recording.runs import RunError, create, mcap_file
from rig.recording.runs.create import BusyError
from rig.recording.runs.recover import Recovery, recover
from rig.recording.runs.state import TickAccount

SUPERVISOR, ALL = "supervisor", "all"
PAIRS = {  # killed one right after the other
    "supervisor, logger": (SUPERVISOR, "logger"),
    "logger, supervisor": ("logger", SUPERVISOR),
}
LOOP_SURVIVES = (SUPERVISOR, *PAIRS)  # targets whose death leaves the loop running alone
MODULES = {"loop": LOOP, "logger": LOGGER}
DT = 0.001  # s
LOGGER_KILLS = 4  # in one run
ENVIRONMENT_MARK = "WEC_RIG_KILLED"  # in the environment of every process of a run


class Kill(NamedTuple):
    """Kills in one run."""

    target: str  # loop, logger, supervisor, all, or one of `PAIRS`
    starting: bool  # the first moment counts from the start of the process, else from tick 0
    moments: tuple[float, ...]  # s; of a logger several, each from the last one's restart


class KillOutcome(NamedTuple):
    """Outcome of a killed run, by comparison with its ring."""

    kill: Kill
    rows_put: int  # by the loop, into the ring
    rows_lost: int  # of them, missing from the files
    seconds_lost: float  # of rows lost; with the loop killed, from the last row to the kill
    stop_seconds: float  # s from the supervisor's kill until every process had ended; else 0
    failures: tuple[str, ...]  # messages of failed checks


def draw_kills(
    rng: random.Random, kills: int, targets: tuple[str, ...], latest: float
) -> list[Kill]:
    """Return runs with ``kills`` kills in total, at random moments up to ``latest`` s after tick 0.

    A quarter of the runs are killed while they start. A logger is killed several times in one run;
    its supervisor restarts it at most five times.
    """
    drawn: list[Kill] = []
    while (left := kills - sum(len(kill.moments) for kill in drawn)) > 0:
        target = rng.choice(targets)
        count = min(left, rng.randint(1, LOGGER_KILLS)) if target == "logger" else 1
        moments = tuple(rng.uniform(0.0, latest) for _ in range(count))
        drawn.append(Kill(target, rng.random() < 0.25, moments))
    return drawn


def run_kills(
    folder: Path, kills: list[Kill], *, real_clock: bool, workers: int
) -> list[KillOutcome]:
    """Execute all kills, distributed over ``workers`` threads that do one run after the other."""
    campaign = write_campaign_file(folder, 120.0 if real_clock else 2400.0)

    def share(number: int) -> list[KillOutcome]:
        place = folder / f"worker{number}"
        return [
            run_and_kill(campaign, place, kill, real_clock=real_clock)
            for kill in kills[number::workers]
        ]

    with ThreadPoolExecutor(workers) as pool:
        return [fate for fates in pool.map(share, range(workers)) for fate in fates]


class RingObserver:
    """Observer of a run's ring from outside the run."""

    def __init__(self, run: LiveRun) -> None:
        self._run = run
        self.ring: RingReader | None = None
        self.tick_zero_time = float("inf")  # s, monotonic, when tick 0 was due

    def observe(self, until: float) -> None:
        """Observe until a time (s, monotonic), and hold the ring as soon as it exists."""
        while True:
            self.ring = self.ring or self._run.try_ring()
            newest = self.ring.latest() if self.ring else None
            if newest is not None:
                tick = int(np.frombuffer(newest[:8], "<i8")[0])
                self.tick_zero_time = min(self.tick_zero_time, time.monotonic() - tick * DT)
            left = until - time.monotonic()
            if left <= 0.0:
                return
            time.sleep(min(0.003, left))

    def due_ticks(self) -> float:
        """Return the number of ticks due by the real clock now."""
        return max(0.0, (time.monotonic() - self.tick_zero_time) / DT)

    @property
    def rows_put(self) -> int:
        """Number of rows that the loop has put so far."""
        return self.ring.head if self.ring else 0

    @property
    def rows_dropped(self) -> int:
        """Number of rows that the loop could not put into the full ring so far."""
        return self.ring.dropped if self.ring else 0

    def newest_rows(self, row_type: type = WaveBotRow) -> Any:
        """Return the rows that are still in the ring, as records."""
        dtype = mcap_file.row_dtype(leaves(row_type))
        return np.frombuffer(self.ring.remaining_rows(), dtype) if self.ring else np.empty(0, dtype)


def run_and_kill(campaign: Path, folder: Path, kill: Kill, *, real_clock: bool) -> KillOutcome:
    """Start a run in ``folder``, execute ``kill`` in it, and compare its record with the ring.

    On the real clock the host's real-time slot must be free again at the end.
    """
    token = uuid.uuid4().hex
    runs, env = folder / token[:8], {ENVIRONMENT_MARK: token}
    with live_run(campaign, runs, real_clock=real_clock, env=env) as run:
        observer = RingObserver(run)
        try:
            if not kill.starting:
                run.wait_started()
            due, stopping = _kill_and_wait(run, observer, kill, token)
        except TimeOutError as error:
            return KillOutcome(kill, 0, 0, 0.0, 0.0, (str(error),))
        run.process.wait()
        failures = [*_leftover_processes(run, token), *_remaining_locks(runs, run.process.pid)]
        return _compare_with_ring(observer, runs, kill, due, stopping, failures, real_clock)


def _kill_and_wait(
    run: LiveRun, observer: RingObserver, kill: Kill, token: str
) -> tuple[float, float]:
    """Kill and wait for the end of the run.

    Returns the tick due at the kill, and the seconds until all processes had ended. A process that
    does not exist yet is killed as soon as it does.
    """
    for moment in kill.moments:
        observer.observe(time.monotonic() + moment)
        if kill.target in MODULES:
            run.pid(MODULES[kill.target])
        observer.observe(0.0)
        _kill(run, kill.target)
    due, at = observer.due_ticks(), time.monotonic()
    if kill.target in (*LOOP_SURVIVES, ALL):
        run.process.wait()
        _leftover_processes(run, token)
        return due, time.monotonic() - at if kill.target != ALL else 0.0
    if kill.target == "logger":
        observer.observe(time.monotonic() + 0.3)
        run.stop()
    wait_until(lambda: run.process.poll() is not None, "the end of the run")
    observer.observe(0.0)
    return due, 0.0


def _kill(run: LiveRun, target: str) -> None:
    children = run.children()
    if target in PAIRS:
        both = {SUPERVISOR: run.process.pid, "logger": children.get(LOGGER)}
        _kill_pids([both[each] for each in PAIRS[target]])
        return
    pids: list[int | None] = [run.process.pid] if target in (SUPERVISOR, ALL) else []
    pids += [
        pid for module, pid in children.items() if target == ALL or MODULES.get(target) == module
    ]
    _kill_pids(pids)


def _kill_pids(pids: list[int | None]) -> None:
    for pid in pids:
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def living_processes(run: LiveRun, token: str) -> list[int]:
    """Return the running children of a run, and all processes that carry its mark.

    An ending process loses its mark before it releases its locks.
    """
    pids = [pid for pid in run.known_children if is_running(pid)]
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            if f"{ENVIRONMENT_MARK}={token}".encode() in environment.split(b"\0"):
                pids.append(int(entry.name))
    return pids


def _leftover_processes(run: LiveRun, token: str) -> list[str]:
    try:
        wait_until(lambda: not living_processes(run, token), "the end of every process")
    except TimeOutError:
        return [f"processes left over: {living_processes(run, token)}"]
    return []


def _remaining_locks(runs: Path, supervisor: int) -> list[str]:
    failures = []
    try:
        acquire((REALTIME_WIRE,), "a benchmark").close()
    except BusyError as error:
        if f"process {supervisor}," in str(error):  # else another run has come since
            failures.append(str(error))
    for folder in _run_folders(runs):
        try:
            with create.lock_run(folder):
                pass
        except BusyError as error:
            failures.append(str(error))
    return failures


def _run_folders(runs: Path) -> list[Path]:
    return [path for path in runs.iterdir() if path.is_dir()]


class RecordComparison(NamedTuple):
    """Recovered record of a run, compared with the rows in its ring."""

    in_ring: Any  # the rows that are still in the ring, as records
    saved: Any  # all rows of the record, as records
    lost: int  # rows that were put and are missing from the files
    failures: tuple[str, ...]  # messages of failed checks


def compare_record_with_ring(
    observer: RingObserver, runs: Path, row_type: type, *, every_tick: bool = False
) -> RecordComparison:
    """Recover the run in ``runs`` and compare its record with its ring.

    ``every_tick``: the loop executed each tick from 0 on, and may have put more rows than a ring
    holds, as on the virtual clock. A loop that is to stop and gets no room for two seconds counts
    the rows that it does not put.
    """
    in_ring, put = observer.newest_rows(row_type), observer.rows_put
    failures = list[str]()
    recovery: Recovery | None = None
    try:
        for folder in _run_folders(runs):
            recovery = recover(folder, None, datetime.now(UTC))
    except (RunError, OSError, BusyError) as error:
        # Nothing was written, which is correct only if no row was put.
        failures += [f"not recovered: {error}"] if put else []
    blocks = list(mcap_file.blocks(mcap_file.scan(recovery.output))) if recovery else []
    saved = np.concatenate(blocks) if blocks else in_ring[:0]
    ticks = np.arange(put + observer.rows_dropped) if every_tick else in_ring["tick"]
    lost = np.setdiff1d(ticks, saved["tick"])
    failures += _ring_differences(in_ring, saved, ticks, None if every_tick else put)
    if recovery is not None:
        failures += _account_errors(recovery.account, lost)
    return RecordComparison(in_ring, saved, len(lost), tuple(failures))


def _compare_with_ring(
    observer: RingObserver,
    runs: Path,
    kill: Kill,
    due: float,
    stopping: float,
    failures: list[str],
    real_clock: bool,
) -> KillOutcome:
    in_ring, saved, lost, claims = compare_record_with_ring(
        observer, runs, WaveBotRow, every_tick=not real_clock
    )
    failures += claims
    if kill.target in LOOP_SURVIVES and len(in_ring):
        failures += _drive_errors(in_ring[-1])
    seconds = lost * DT
    if real_clock and kill.target in ("loop", ALL) and len(saved):
        seconds = max(seconds, (due - int(saved["tick"][-1])) * DT)
    return KillOutcome(kill, observer.rows_put, lost, seconds, stopping, tuple(failures))


def _ring_differences(in_ring: Any, saved: Any, ticks: Any, put: int | None) -> list[str]:
    """Return the differences of the files from the ring, as messages."""
    failures = []
    if put is not None and put != len(in_ring):
        failures.append("the ring was too small for a comparison of this run")
    if len(np.unique(saved["tick"])) != len(saved):
        failures.append("the files have a tick twice")
    if len(np.setdiff1d(saved["tick"], ticks)):
        failures.append("the files have ticks that were not put")
    _, i_saved, i_ring = np.intersect1d(saved["tick"], in_ring["tick"], return_indices=True)
    if saved[i_saved].tobytes() != in_ring[i_ring].tobytes():
        failures.append("rows differ from those in the ring")
    return failures


def _account_errors(account: TickAccount, lost: Any) -> list[str]:
    """Return the errors of the missing ticks that `rig recover` states, as messages."""
    final = account.end_report is not None and account.end_report.final
    known = -1 if account.last_known is None else account.last_known
    stated = np.concatenate(
        [np.empty(0, np.int64), *(np.arange(gap.first, gap.last + 1) for gap in account.gaps)]
    )
    failures = []
    expected = lost if final else lost[lost <= known]
    if account.lost != len(expected):
        failures.append(f"{account.lost} lost ticks are stated, {len(expected)} are lost")
    if len(np.setdiff1d(expected, stated)):
        failures.append("lost ticks outside the stated ranges")
    if final and account.complete != (len(lost) == 0):
        failures.append(f"complete is stated as {account.complete}, {len(lost)} ticks are lost")
    return failures


def _drive_errors(last: Any) -> list[str]:
    """Return messages about a drive that was still enabled when the loop had ended."""
    if last["safety.mode"] != STOP_0 or last["heave.command.enable"] != 0:
        return ["the loop did not end in a stop"]
    return ["the drive was still on"] if last["heave.sense.enabled"] != 0 else []
