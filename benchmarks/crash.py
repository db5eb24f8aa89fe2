"""kill -9 of logger, loop and supervisor at random moments: which rows are gone."""

import os
import random
import signal
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader

from benchmarks.support.live import LOGGER, LOOP, LiveRun, live_run, running, wait_until
from benchmarks.support.recorded import campaign_file
from benchmarks.support.result import Result, figure
from rig.runs import RunError, join, open_run
from rig.runs.folder import files

SECONDS_LOST = 1.0
DT = 0.001
KILLS_A_RUN = 4  # of the logger; its supervisor restarts it five times at most
DICE = 20_240_601  # the moments of the kills follow from it

Env = dict[str, str] | None


class Loss(NamedTuple):
    """What one run lost to kill -9."""

    rows: int  # put into the ring and not in the joined file
    seconds: float  # those rows, or from the last logged tick to the kill where that is more
    whole: bool  # joined and read by our reader and the stock one, each tick once
    kills: int


def kill_logger(campaign: Path, runs: Path, moments: list[float], env: Env = None) -> Loss:
    """Kill the logger again and again in one run; the loop goes on."""
    with live_run(campaign, runs, real_clock=True, env=env) as run:
        run.wait_started()
        for wait in moments:
            pid = run.pid(LOGGER)
            time.sleep(wait)
            os.kill(pid, signal.SIGKILL)
            _wait_gone(pid)
        run.pid(LOGGER)  # the next one is up
        time.sleep(0.3)
        run.stop()
        run.wait_ended()
        return _loss(run, len(moments), None)


def kill_loop(campaign: Path, runs: Path, moment: float, env: Env = None) -> Loss:
    """Kill the loop once; supervisor and logger bring the run to an end."""
    with live_run(campaign, runs, real_clock=True, env=env) as run:
        run.wait_started()
        loop = run.pid(LOOP)
        zero = _watch(run, moment)
        os.kill(loop, signal.SIGKILL)
        due = (time.monotonic() - zero) / DT
        run.wait_ended()
        return _loss(run, 1, due)


def kill_supervisor(campaign: Path, runs: Path, moment: float, env: Env = None) -> Loss:
    """Kill the supervisor once; the loop notices and stops, the logger saves what is left."""
    with live_run(campaign, runs, real_clock=True, env=env) as run:
        run.wait_started()
        left = [run.pid(LOOP), run.pid(LOGGER)]
        time.sleep(moment)
        run.process.kill()
        run.process.wait()
        for pid in left:
            _wait_gone(pid)
        return _loss(run, 1, None)


def kill_all(campaign: Path, runs: Path, moment: float, env: Env = None) -> Loss:
    """Kill all three at once: what was in the ring only is gone with them."""
    with live_run(campaign, runs, real_clock=True, env=env) as run:
        run.wait_started()
        rest = [run.pid(LOGGER), run.pid(LOOP)]
        zero = _watch(run, moment)
        run.process.kill()
        due = (time.monotonic() - zero) / DT
        for pid in rest:
            os.kill(pid, signal.SIGKILL)
        run.process.wait()
        for pid in rest:
            _wait_gone(pid)
        return _loss(run, 1, due)


def _wait_gone(pid: int) -> None:
    wait_until(lambda: not running(pid), f"the end of process {pid}")


def _watch(run: LiveRun, seconds: float) -> float:
    """Look on for a while; gives when tick 0 was, on the monotonic clock."""
    end, zero = time.monotonic() + seconds, float("inf")
    while time.monotonic() < end:
        peek = run.peek()
        zero = min(zero, peek.at - peek.tick * DT)
        time.sleep(0.003)
    return zero


def _loss(run: LiveRun, kills: int, due: float | None) -> Loss:
    """Join what is left and count it against what the loop put into the ring.

    ``due``: the tick that was due by the clock when the loop was killed.
    """
    out = run.folder.parent / f"{run.folder.name}_joined.mcap"
    put = run.ring.head + run.ring.dropped
    try:
        joined = join(files(run.folder), out)
    except RunError:  # the logger was killed before it had written the head of its file
        return Loss(put, max(put, due or 0.0) * DT, False, kills)
    data = open_run(out, fields=["tick", "timing.skipped"])
    ticks, skipped = data["tick"].values, data["timing.skipped"].values
    with out.open("rb") as file:
        told = make_reader(file).get_summary()
    counted = told.statistics.message_count if told and told.statistics else -1
    rows = put - len(ticks)
    last = int(ticks[-1]) if len(ticks) else -1
    seconds = rows * DT
    if due is not None:
        seconds = max(seconds, (due - last) * DT)
    # A period that the loop skipped and counted has no row; any other absent tick is a loss.
    absent = joined.missing - (int(skipped[-1] - skipped[0]) if len(skipped) else 0)
    once = len(set(ticks.tolist())) == len(ticks) == joined.rows == counted
    return Loss(rows, seconds, once and absent == 0 and not joined.damage, kills)


def losses(folder: Path, kills: int, latest: float) -> dict[str, list[Loss]]:
    """``kills`` of each process, each within ``latest`` seconds of its start or the last kill."""
    campaign, dice = campaign_file(folder, 120.0), random.Random(DICE)

    def moment() -> float:
        return dice.uniform(0.1, latest)

    found: dict[str, list[Loss]] = {"logger": []}
    for first in range(0, kills, KILLS_A_RUN):
        moments = [moment() for _ in range(min(KILLS_A_RUN, kills - first))]
        found["logger"].append(kill_logger(campaign, folder / f"logger{first}", moments))
    for name, kill in (("loop", kill_loop), ("supervisor", kill_supervisor), ("all", kill_all)):
        found[name] = [kill(campaign, folder / f"{name}{i}", moment()) for i in range(kills)]
    return found


def measure(short: bool) -> Result:
    """Kill each of the three processes, and all at once, at random moments of real-time runs."""
    kills, latest = (2, 0.8) if short else (20, 2.5)
    with tempfile.TemporaryDirectory() as scratch:
        found = losses(Path(scratch), kills, latest)
    figures = []
    for name, those in found.items():
        killed = f"{name} killed"
        seconds = [loss.seconds for loss in those]
        broken = sum(not loss.whole for loss in those)
        figures += [
            figure(killed, "times", sum(loss.kills for loss in those)),
            figure(f"{killed}: rows lost", "rows a run", [loss.rows for loss in those]),
            figure(f"{killed}: time lost", "s", seconds, at_most=SECONDS_LOST, judge="worst"),
            figure(f"{killed}: joined files not whole", "files", broken, at_most=0),
        ]
    return Result(
        "crash",
        "kill -9 at random moments of runs at 1 kHz on the real clock, parts joined and read back",
        f"{kills} kills of each process and {kills} of all three at once; the logger up to "
        f"{KILLS_A_RUN} times in one run",
        tuple(figures),
        (
            "time lost with the loop counts from the last logged tick to the kill",
            "all killed: the ring dies with its processes, what the logger flushed last is left",
        ),
    )
