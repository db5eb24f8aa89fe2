"""One run, one kind of kill -9 at given moments, and what a witness from outside says of it.

The witness is the ring itself, held open from outside: its head counts the rows that the loop put,
and the rows are still in it when every process of the run is dead. What the files hold, and what
`rig recover` says is missing, is compared with it; the logger is never asked.
"""

import fcntl
import os
import random
import signal
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.support.live import (
    LOGGER,
    LOOP,
    LiveRun,
    TimeOutError,
    live_run,
    running,
    wait_until,
)
from benchmarks.support.recorded import campaign_file
from rig.record import leaves
from rig.ring import Reader
from rig.runs import RunError, create, mcap_file
from rig.runs.account import Account
from rig.runs.recover import Recovery, recover
from rig.safety import STOP_0
from rig.wavebot import WaveBotRow

SUPERVISOR, ALL = "supervisor", "all"
NAMES = {"loop": LOOP, "logger": LOGGER}
DT = 0.001  # s
LOGGER_KILLS = 4  # in one run
MARK = "WEC_RIG_KILLED"  # in the environment of every process of a run
_DTYPE = mcap_file.row_dtype(leaves(WaveBotRow))


class Kill(NamedTuple):
    """What to do to a run."""

    who: str  # loop, logger, supervisor, all
    starting: bool  # the first moment counts from the start of the process, else from tick 0
    moments: tuple[float, ...]  # s; of a logger several, each from the last one's restart


class Fate(NamedTuple):
    """What a killed run left, by the witness."""

    kill: Kill
    put: int  # rows that the loop put into the ring
    lost: int  # of them, rows that are nowhere in the files
    seconds: float  # of rows lost; with the loop killed, from the last row to the kill
    stopping: float  # s from the supervisor's kill until every process had ended; else 0
    wrong: tuple[str, ...]  # claims that do not hold, in words


def plans(dice: random.Random, kills: int, whom: tuple[str, ...], latest: float) -> list[Kill]:
    """Runs with so many kills in all, up to ``latest`` s after tick 0; a quarter while starting up.

    A logger is killed several times in one run; its supervisor restarts it five times at most.
    """
    made: list[Kill] = []
    while (left := kills - sum(len(kill.moments) for kill in made)) > 0:
        who = dice.choice(whom)
        count = min(left, dice.randint(1, LOGGER_KILLS)) if who == "logger" else 1
        moments = tuple(dice.uniform(0.0, latest) for _ in range(count))
        made.append(Kill(who, dice.random() < 0.25, moments))
    return made


def soak(folder: Path, todo: list[Kill], *, real_clock: bool, workers: int) -> list[Fate]:
    """Do all this, shared among so many workers; each does its share one run after the other."""
    campaign = campaign_file(folder, 120.0 if real_clock else 1200.0)

    def share(number: int) -> list[Fate]:
        place = folder / f"worker{number}"
        return [
            killed(campaign, place, kill, real_clock=real_clock) for kill in todo[number::workers]
        ]

    with ThreadPoolExecutor(workers) as pool:
        return [fate for fates in pool.map(share, range(workers)) for fate in fates]


class _Witness:
    """Looks on from outside."""

    def __init__(self, run: LiveRun) -> None:
        self._run = run
        self.ring: Reader | None = None
        self.zero = float("inf")  # when tick 0 was due, monotonic s

    def look(self, until: float) -> None:
        """Look until then; the ring is held from the moment it is there."""
        while True:
            self.ring = self.ring or self._run.try_ring()
            newest = self.ring.latest() if self.ring else None
            if newest is not None:
                tick = int(np.frombuffer(newest[:8], "<i8")[0])
                self.zero = min(self.zero, time.monotonic() - tick * DT)
            left = until - time.monotonic()
            if left <= 0.0:
                return
            time.sleep(min(0.003, left))

    def due(self) -> float:
        """Ticks that are due by the real clock now."""
        return max(0.0, (time.monotonic() - self.zero) / DT)

    def rows(self) -> Any:
        """The newest rows the loop put, as records."""
        return np.frombuffer(self.ring.kept(), _DTYPE) if self.ring else np.empty(0, _DTYPE)


def killed(campaign: Path, folder: Path, kill: Kill, *, real_clock: bool) -> Fate:
    """Start a run in ``folder``, kill in it what ``kill`` says, and hold what is left against it.

    On the real clock, runs of one ``folder`` share a real-time place of their own: that the next
    one starts shows that the one before has left it.
    """
    token = uuid.uuid4().hex
    runs, place = folder / token[:8], folder / "place"
    place.mkdir(parents=True, exist_ok=True)
    env = {MARK: token, "TMPDIR": str(place)}
    with live_run(campaign, runs, real_clock=real_clock, env=env) as run:
        witness = _Witness(run)
        try:
            if not kill.starting:
                run.wait_started()
            due, stopping = _strike(run, witness, kill, token)
        except TimeOutError as error:
            return Fate(kill, 0, 0, 0.0, 0.0, (str(error),))
        run.process.wait()
        wrong = [*_left_over(run, token), *_locked(runs, place)]
        return _held_against(witness, runs, kill, due, stopping, wrong, real_clock)


def _strike(run: LiveRun, witness: _Witness, kill: Kill, token: str) -> tuple[float, float]:
    """Kill and see the run to its end; gives the tick due at the kill, and how long the end took.

    A process that is not there yet is killed in its very first moments.
    """
    for moment in kill.moments:
        witness.look(time.monotonic() + moment)
        if kill.who in NAMES:
            run.pid(NAMES[kill.who])
        witness.look(0.0)
        _kill(run, kill.who)
    due, at = witness.due(), time.monotonic()
    if kill.who in (SUPERVISOR, ALL):
        run.process.wait()
        _left_over(run, token)
        return due, time.monotonic() - at if kill.who == SUPERVISOR else 0.0
    if kill.who == "logger":
        witness.look(time.monotonic() + 0.3)
        run.stop()
    wait_until(lambda: run.process.poll() is not None, "the end of the run")
    witness.look(0.0)
    return due, 0.0


def _kill(run: LiveRun, who: str) -> None:
    ours = run.children()
    pids = [run.process.pid] if who in (SUPERVISOR, ALL) else []
    pids += [pid for module, pid in ours.items() if who == ALL or NAMES.get(who) == module]
    for pid in pids:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


def alive(run: LiveRun, token: str) -> list[int]:
    """Living processes that a run had as children, or that carry its mark, whoever their parent.

    One that is ending loses its mark before it gives back its locks.
    """
    found = [pid for pid in run.known if running(pid)]
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            if f"{MARK}={token}".encode() in environment.split(b"\0"):
                found.append(int(entry.name))
    return found


def _left_over(run: LiveRun, token: str) -> list[str]:
    try:
        wait_until(lambda: not alive(run, token), "the end of every process")
    except TimeOutError:
        return [f"processes left over: {alive(run, token)}"]
    return []


def _locked(runs: Path, place: Path) -> list[str]:
    wrong = []
    lock = place / "wec-rig-realtime.lock"
    if lock.exists():
        with lock.open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                wrong.append("the real-time place is still taken")
    for folder in _folders(runs):
        try:
            with create.hold_run(folder):
                pass
        except create.BusyError as error:
            wrong.append(str(error))
    return wrong


def _folders(runs: Path) -> list[Path]:
    return [path for path in runs.iterdir() if path.is_dir()]


def _held_against(
    witness: _Witness,
    runs: Path,
    kill: Kill,
    due: float,
    stopping: float,
    wrong: list[str],
    real_clock: bool,
) -> Fate:
    truth = witness.rows()
    put = witness.ring.head if witness.ring else 0
    folders = _folders(runs)
    made: Recovery | None = None
    try:
        if folders:
            made = recover(folders[0], None, datetime.now(UTC))
    except (RunError, OSError, create.BusyError) as error:
        # Nothing was written: right only if nothing was ever put.
        wrong += [f"not recovered: {error}"] if put else []
    blocks = list(mcap_file.blocks(mcap_file.scan(made.output))) if made else []
    saved = np.concatenate(blocks) if blocks else np.empty(0, _DTYPE)
    ticks = truth["tick"] if real_clock else np.arange(put)
    lost = np.setdiff1d(ticks, saved["tick"])
    wrong += _differ(truth, saved, ticks, put if real_clock else None)
    if made is not None:
        wrong += _misstated(made.account, lost)
    if kill.who == SUPERVISOR and len(truth):
        wrong += _unsafe(truth[-1])
    seconds = len(lost) * DT
    if real_clock and kill.who in ("loop", ALL) and len(saved):
        seconds = max(seconds, (due - int(saved["tick"][-1])) * DT)
    return Fate(kill, put, len(lost), seconds, stopping, tuple(wrong))


def _differ(truth: Any, saved: Any, ticks: Any, put: int | None) -> list[str]:
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


def _misstated(told: Account, lost: Any) -> list[str]:
    """What `rig recover` says of missing ticks otherwise than the witness."""
    final = told.ending is not None and told.ending.final
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
    if final and told.whole != (len(lost) == 0):
        wrong.append("whole and not whole are mistaken")
    return wrong


def _unsafe(last: Any) -> list[str]:
    """What the plant itself still had on when the loop had ended."""
    if last["safety.mode"] != STOP_0 or last["heave.command.enable"] != 0:
        return ["the loop did not end in a stop"]
    return ["the drive was still on"] if last["heave.sense.enabled"] != 0 else []
