"""One run, one kind of kill -9 at given moments, and what a witness from outside says of it.

The witness is the ring itself, held open from outside: its head counts the rows that the loop put,
and the rows are still in it when every process of the run is dead. What the files hold, and what
`rig recover` says is missing, is compared with it; the logger is never asked.
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
from rig.recording.runs.account import TickAccount
from rig.recording.runs.create import BusyError
from rig.recording.runs.recover import Recovery, recover

SUPERVISOR, ALL = "supervisor", "all"
PAIRS = {  # killed one right after the other
    "supervisor, logger": (SUPERVISOR, "logger"),
    "logger, supervisor": ("logger", SUPERVISOR),
}
LOOP_SURVIVES = (SUPERVISOR, *PAIRS)  # whose death leaves the loop to itself
MODULES = {"loop": LOOP, "logger": LOGGER}
DT = 0.001  # s
LOGGER_KILLS = 4  # in one run
ENVIRONMENT_MARK = "WEC_RIG_KILLED"  # in the environment of every process of a run


class Kill(NamedTuple):
    """What to do to a run."""

    target: str  # loop, logger, supervisor, all, or one of `PAIRS`
    starting: bool  # the first moment counts from the start of the process, else from tick 0
    moments: tuple[float, ...]  # s; of a logger several, each from the last one's restart


class KillOutcome(NamedTuple):
    """What a killed run left, by the witness."""

    kill: Kill
    rows_put: int  # rows that the loop put into the ring
    rows_lost: int  # of them, rows that are nowhere in the files
    seconds_lost: float  # of rows lost; with the loop killed, from the last row to the kill
    stop_seconds: float  # s from the supervisor's kill until every process had ended; else 0
    failures: tuple[str, ...]  # claims that do not hold, in words


def draw_kills(
    rng: random.Random, kills: int, targets: tuple[str, ...], latest: float
) -> list[Kill]:
    """Runs with so many kills in all, up to ``latest`` s after tick 0; a quarter while starting up.

    A logger is killed several times in one run; its supervisor restarts it five times at most.
    """
    made: list[Kill] = []
    while (left := kills - sum(len(kill.moments) for kill in made)) > 0:
        who = rng.choice(targets)
        count = min(left, rng.randint(1, LOGGER_KILLS)) if who == "logger" else 1
        moments = tuple(rng.uniform(0.0, latest) for _ in range(count))
        made.append(Kill(who, rng.random() < 0.25, moments))
    return made


def run_kills(
    folder: Path, todo: list[Kill], *, real_clock: bool, workers: int
) -> list[KillOutcome]:
    """Do all this, shared among so many workers; each does its share one run after the other."""
    campaign = write_campaign_file(folder, 120.0 if real_clock else 1200.0)

    def share(number: int) -> list[KillOutcome]:
        place = folder / f"worker{number}"
        return [
            run_and_kill(campaign, place, kill, real_clock=real_clock)
            for kill in todo[number::workers]
        ]

    with ThreadPoolExecutor(workers) as pool:
        return [fate for fates in pool.map(share, range(workers)) for fate in fates]


class RingObserver:
    """Looks on from outside."""

    def __init__(self, run: LiveRun) -> None:
        self._run = run
        self.ring: RingReader | None = None
        self.tick_zero_time = float("inf")  # when tick 0 was due, monotonic s

    def observe(self, until: float) -> None:
        """Look until then; the ring is held from the moment it is there."""
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
        """Ticks that are due by the real clock now."""
        return max(0.0, (time.monotonic() - self.tick_zero_time) / DT)

    @property
    def rows_put(self) -> int:
        """Rows the loop has put so far."""
        return self.ring.head if self.ring else 0

    def newest_rows(self, row_type: type = WaveBotRow) -> Any:
        """The newest rows the loop put, as records."""
        dtype = mcap_file.row_dtype(leaves(row_type))
        return np.frombuffer(self.ring.remaining_rows(), dtype) if self.ring else np.empty(0, dtype)


def run_and_kill(campaign: Path, folder: Path, kill: Kill, *, real_clock: bool) -> KillOutcome:
    """Start a run in ``folder``, execute ``kill`` in it, and compare its record with the ring.

    On the real clock the host's one real-time place must be free again at the end.
    """
    token = uuid.uuid4().hex
    runs, env = folder / token[:8], {ENVIRONMENT_MARK: token}
    with live_run(campaign, runs, real_clock=real_clock, env=env) as run:
        witness = RingObserver(run)
        try:
            if not kill.starting:
                run.wait_started()
            due, stopping = _kill_and_wait(run, witness, kill, token)
        except TimeOutError as error:
            return KillOutcome(kill, 0, 0, 0.0, 0.0, (str(error),))
        run.process.wait()
        wrong = [*_leftover_processes(run, token), *_held_locks(runs, run.process.pid)]
        return _compare_with_ring(witness, runs, kill, due, stopping, wrong, real_clock)


def _kill_and_wait(
    run: LiveRun, witness: RingObserver, kill: Kill, token: str
) -> tuple[float, float]:
    """Kill and see the run to its end; gives the tick due at the kill, and how long the end took.

    A process that is not there yet is killed in its very first moments.
    """
    for moment in kill.moments:
        witness.observe(time.monotonic() + moment)
        if kill.target in MODULES:
            run.pid(MODULES[kill.target])
        witness.observe(0.0)
        _kill(run, kill.target)
    due, at = witness.due_ticks(), time.monotonic()
    if kill.target in (*LOOP_SURVIVES, ALL):
        run.process.wait()
        _leftover_processes(run, token)
        return due, time.monotonic() - at if kill.target != ALL else 0.0
    if kill.target == "logger":
        witness.observe(time.monotonic() + 0.3)
        run.stop()
    wait_until(lambda: run.process.poll() is not None, "the end of the run")
    witness.observe(0.0)
    return due, 0.0


def _kill(run: LiveRun, who: str) -> None:
    ours = run.children()
    if who in PAIRS:
        both = {SUPERVISOR: run.process.pid, "logger": ours.get(LOGGER)}
        _kill_pids([both[each] for each in PAIRS[who]])
        return
    pids: list[int | None] = [run.process.pid] if who in (SUPERVISOR, ALL) else []
    pids += [pid for module, pid in ours.items() if who == ALL or MODULES.get(who) == module]
    _kill_pids(pids)


def _kill_pids(pids: list[int | None]) -> None:
    for pid in pids:
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def living_processes(run: LiveRun, token: str) -> list[int]:
    """Living processes that a run had as children, or that carry its mark, whoever their parent.

    One that is ending loses its mark before it gives back its locks.
    """
    found = [pid for pid in run.known_children if is_running(pid)]
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            if f"{ENVIRONMENT_MARK}={token}".encode() in environment.split(b"\0"):
                found.append(int(entry.name))
    return found


def _leftover_processes(run: LiveRun, token: str) -> list[str]:
    try:
        wait_until(lambda: not living_processes(run, token), "the end of every process")
    except TimeOutError:
        return [f"processes left over: {living_processes(run, token)}"]
    return []


def _held_locks(runs: Path, supervisor: int) -> list[str]:
    wrong = []
    try:
        acquire((REALTIME_WIRE,), "a benchmark").close()
    except BusyError as error:
        if f"process {supervisor}," in str(error):  # else another run has come since
            wrong.append(str(error))
    for folder in _run_folders(runs):
        try:
            with create.lock_run(folder):
                pass
        except BusyError as error:
            wrong.append(str(error))
    return wrong


def _run_folders(runs: Path) -> list[Path]:
    return [path for path in runs.iterdir() if path.is_dir()]


class RecordComparison(NamedTuple):
    """Recovered record of a run, and the rows in its ring."""

    in_ring: Any  # the newest rows the loop put, as records
    saved: Any  # all rows of the record, as records
    lost: int  # rows put that are nowhere in the files
    failures: tuple[str, ...]  # claims that do not hold


def compare_record_with_ring(
    witness: RingObserver, runs: Path, row_type: type, *, every_tick: bool = False
) -> RecordComparison:
    """Recover the run in ``runs`` and compare its record with its ring.

    ``every_tick``: the loop put each tick from 0 on, and may have put more rows than a ring holds,
    as on the virtual clock.
    """
    truth, put = witness.newest_rows(row_type), witness.rows_put
    wrong = list[str]()
    made: Recovery | None = None
    try:
        for folder in _run_folders(runs):
            made = recover(folder, None, datetime.now(UTC))
    except (RunError, OSError, BusyError) as error:
        # Nothing was written: right only if nothing was ever put.
        wrong += [f"not recovered: {error}"] if put else []
    blocks = list(mcap_file.blocks(mcap_file.scan(made.output))) if made else []
    saved = np.concatenate(blocks) if blocks else truth[:0]
    ticks = np.arange(put) if every_tick else truth["tick"]
    lost = np.setdiff1d(ticks, saved["tick"])
    wrong += _ring_differences(truth, saved, ticks, None if every_tick else put)
    if made is not None:
        wrong += _account_errors(made.account, lost)
    return RecordComparison(truth, saved, len(lost), tuple(wrong))


def _compare_with_ring(
    witness: RingObserver,
    runs: Path,
    kill: Kill,
    due: float,
    stopping: float,
    wrong: list[str],
    real_clock: bool,
) -> KillOutcome:
    truth, saved, lost, claims = compare_record_with_ring(
        witness, runs, WaveBotRow, every_tick=not real_clock
    )
    wrong += claims
    if kill.target in LOOP_SURVIVES and len(truth):
        wrong += _drive_errors(truth[-1])
    seconds = lost * DT
    if real_clock and kill.target in ("loop", ALL) and len(saved):
        seconds = max(seconds, (due - int(saved["tick"][-1])) * DT)
    return KillOutcome(kill, witness.rows_put, lost, seconds, stopping, tuple(wrong))


def _ring_differences(truth: Any, saved: Any, ticks: Any, put: int | None) -> list[str]:
    """What the files hold otherwise than the ring."""
    wrong = []
    if put is not None and put != len(truth):
        wrong.append("the ring was too small to witness this run")
    if len(np.unique(saved["tick"])) != len(saved):
        wrong.append("a tick is there twice")
    if len(np.setdiff1d(saved["tick"], ticks)):
        wrong.append("the files hold ticks that were never put")
    _, ours, theirs = np.intersect1d(saved["tick"], truth["tick"], return_indices=True)
    if saved[ours].tobytes() != truth[theirs].tobytes():
        wrong.append("rows differ from those in the ring")
    return wrong


def _account_errors(told: TickAccount, lost: Any) -> list[str]:
    """What `rig recover` says of missing ticks otherwise than the witness."""
    final = told.end_report is not None and told.end_report.final
    known = -1 if told.last_known is None else told.last_known
    stated = np.concatenate(
        [np.empty(0, np.int64), *(np.arange(gap.first, gap.last + 1) for gap in told.gaps)]
    )
    wrong = []
    expected = lost if final else lost[lost <= known]
    if told.lost != len(expected):
        wrong.append(f"{told.lost} lost ticks are stated, {len(expected)} are lost")
    if len(np.setdiff1d(expected, stated)):
        wrong.append("lost ticks outside the stated ranges")
    if final and told.complete != (len(lost) == 0):
        wrong.append("whole and not whole are mistaken")
    return wrong


def _drive_errors(last: Any) -> list[str]:
    """What the plant itself still had on when the loop had ended."""
    if last["safety.mode"] != STOP_0 or last["heave.command.enable"] != 0:
        return ["the loop did not end in a stop"]
    return ["the drive was still on"] if last["heave.sense.enabled"] != 0 else []
