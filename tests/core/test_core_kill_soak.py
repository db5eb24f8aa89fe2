"""kill -9 of loop, logger and supervisor at random moments of whole runs.

Each time: no row is lost (at most one second if all die at once), `rig recover` states exactly the
ticks that are missing, no process is left, the locks are free and the next run starts.
"""

from __future__ import annotations

import os
import random
import secrets
import time
from pathlib import Path

import pytest

from benchmarks.support.kills import PAIRS, SUPERVISOR, KillOutcome, draw_kills, run_kills
from benchmarks.support.live_run import LOGGER, LOOP, is_running, live_run, wait_until
from benchmarks.support.recorded import write_campaign_file
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.recording.runs.create import BusyError

pytestmark = [pytest.mark.realtime, pytest.mark.paired]

SEED = int(os.environ.get("KILL_SEED") or secrets.randbits(32))
KILLS = 3  # in each of the parts on the virtual clock; 300 of them: python -m benchmarks crash


def check_outcomes(fates: list[KillOutcome], kills: int) -> None:
    report = "\n".join(map(str, fates))
    print(f"KILL_SEED={SEED}\n{report}")  # shown on failure
    assert sum(len(fate.kill.moments) for fate in fates) == kills
    assert not [fate for fate in fates if fate.failures]
    assert max(fate.seconds_lost for fate in fates) <= 1.0
    for fate in fates:
        if fate.kill.target != "all":
            assert fate.rows_lost == 0


@pytest.mark.long
@pytest.mark.parametrize("part", range(5))
def test_kills_on_the_virtual_clock(part: int, tmp_path: Path) -> None:
    dice = random.Random(f"{SEED} {part}")
    todo = draw_kills(dice, KILLS, ("loop", "logger", SUPERVISOR, *PAIRS), 1.5)
    check_outcomes(run_kills(tmp_path, todo, real_clock=False, workers=2), KILLS)


@pytest.mark.long
@pytest.mark.parametrize("who", ["loop", "logger", SUPERVISOR, *PAIRS, "all"])
def test_kills_on_the_real_clock(who: str, tmp_path: Path) -> None:
    (kill,) = draw_kills(random.Random(SEED + 1), 1, (who,), 1.5)
    kill = kill._replace(starting=False)
    check_outcomes(run_kills(tmp_path, [kill], real_clock=True, workers=1), 1)


def test_a_stopping_loop_keeps_the_real_time_lock(tmp_path: Path) -> None:
    """The next run must not start while the last loop still has the drive on."""
    campaign = write_campaign_file(tmp_path, 60.0)
    with live_run(campaign, tmp_path / "runs", real_clock=True) as run:
        run.wait_started()
        loop, logger = run.pid(LOOP), run.pid(LOGGER)
        time.sleep(1.3)  # after the tare: the drive is on, and the stop begins with 2 s of damping
        run.process.kill()
        run.process.wait()
        with pytest.raises(BusyError, match="was killed; its loop is coming to a stop"):
            acquire((REALTIME_WIRE,), "next")
        assert is_running(loop)
        wait_until(lambda: not is_running(loop), "the end of the loop")
        acquire((REALTIME_WIRE,), "next").close()
        wait_until(lambda: not is_running(logger), "the end of the logger")
