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
from rig.runs import join, open_run
from rig.runs.folder import files

SECONDS_LOST = 1.0
DT = 0.001
KILLS_A_RUN = 4  # of the logger; its supervisor restarts it five times at most
DICE = 20_240_601  # the moments of the kills follow from it


class Loss(NamedTuple):
    """What one run lost to kill -9."""

    rows: int  # put into the ring and not in the joined file
    seconds: float  # from the last logged tick to the kill, or the rows above, what is more
    readable: bool  # joined, by our reader and by the stock one, each tick once
    kills: int


def kill_logger(campaign: Path, runs: Path, moments: list[float]) -> Loss:
    """Kill the logger again and again in one run; the loop goes on."""
    with live_run(campaign, runs, real_clock=True) as run:
        run.wait_started()
        for wait in moments:
            pid = run.pid(LOGGER)
            wait_until(lambda: run.ring.head > 0, "ticks")
            time.sleep(wait)
            os.kill(pid, signal.SIGKILL)
            wait_until(lambda pid=pid: not running(pid), "the killed logger to be gone")  # type: ignore[misc]
        run.pid(LOGGER)
        time.sleep(0.3)
        run.stop()
        run.wait_ended()
        return _loss(run, len(moments), None)


def kill_loop(campaign: Path, runs: Path, moment: float) -> Loss:
    """Kill the loop once; supervisor and logger bring the run to an end."""
    with live_run(campaign, runs, real_clock=True) as run:
        due = _due(run, run.pid(LOOP), moment)
        run.wait_ended()
        return _loss(run, 1, due)


def kill_supervisor(campaign: Path, runs: Path, moment: float) -> Loss:
    """Kill the supervisor once; the loop notices and stops, the logger saves what is left."""
    with live_run(campaign, runs, real_clock=True) as run:
        run.wait_started()
        left = [run.pid(LOOP), run.pid(LOGGER)]
        time.sleep(moment)
        run.process.kill()
        run.process.wait()
        wait_until(lambda: not any(running(pid) for pid in left), "the orphans' end")
        return _loss(run, 1, None)


def _due(run: LiveRun, pid: int, moment: float) -> float:
    """Kill a process; gives the tick that was due then by the clock."""
    run.wait_started()
    end, zero = time.monotonic() + moment, float("inf")
    while time.monotonic() < end:
        peek = run.peek()
        zero = min(zero, peek.at - peek.tick * DT)
        time.sleep(0.003)
    os.kill(pid, signal.SIGKILL)
    return (time.monotonic() - zero) / DT


def _loss(run: LiveRun, kills: int, due: float | None) -> Loss:
    """Join what is left and count it against what the loop put into the ring."""
    out = run.folder.parent / f"{run.folder.name}_joined.mcap"
    joined = join(files(run.folder), out)
    ticks = open_run(out, fields=["tick"])["tick"].values
    with out.open("rb") as file:
        told = make_reader(file).get_summary()
    counted = told.statistics.message_count if told and told.statistics else -1
    rows = run.ring.head + run.ring.dropped - len(ticks)
    seconds = rows * DT
    if due is not None:
        seconds = max(seconds, (due - int(ticks[-1])) * DT)
    whole = joined.clean and len(set(ticks.tolist())) == len(ticks) == counted
    return Loss(rows, seconds, whole, kills)


def losses(folder: Path, kills: int, dice: random.Random) -> dict[str, list[Loss]]:
    """``kills`` of each process, every one at a moment of its own."""
    campaign = campaign_file(folder, 120.0)

    def moment() -> float:
        return dice.uniform(0.1, 2.5)

    found: dict[str, list[Loss]] = {"logger": [], "loop": [], "supervisor": []}
    left = kills
    while left > 0:
        few = min(left, KILLS_A_RUN)
        left -= few
        runs = folder / f"logger{left}"
        found["logger"].append(kill_logger(campaign, runs, [moment() for _ in range(few)]))
    for i in range(kills):
        found["loop"].append(kill_loop(campaign, folder / f"loop{i}", moment()))
        found["supervisor"].append(kill_supervisor(campaign, folder / f"supervisor{i}", moment()))
    return found


def measure(short: bool) -> Result:
    """Kill each of the three processes at random moments of runs on the real clock."""
    kills = 2 if short else 20
    with tempfile.TemporaryDirectory() as scratch:
        found = losses(Path(scratch), kills, random.Random(DICE))
    figures = []
    for name, those in found.items():
        seconds = [loss.seconds for loss in those]
        figures += [
            figure(f"{name} killed", "times", sum(loss.kills for loss in those)),
            figure("  rows lost", "rows a run", [loss.rows for loss in those]),
            figure("  time lost", "s", seconds, at_most=SECONDS_LOST, judge="worst"),
            figure(
                "  joined files not whole",
                "files",
                sum(not loss.readable for loss in those),
                at_most=0,
            ),
        ]
    return Result(
        "crash",
        "kill -9 at random moments of runs at 1 kHz on the real clock, parts joined and read back",
        f"{kills} kills of each process; the logger up to {KILLS_A_RUN} times in one run",
        tuple(figures),
        ("time lost to a kill of the loop counts from its last logged tick to the kill",),
    )
