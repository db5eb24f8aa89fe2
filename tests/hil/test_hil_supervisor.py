"""A supervisor killed or suspended in a run on real wires: the rig is still brought to rest.

The emulated devices are a separate process, as a rig is: they do not end with the run.
"""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.support.wired_rigs import (
    WiredRig,
    start_run,
    wait_for_end,
    wait_for_power,
)
from rig.processes.supervisor import POLL_INTERVAL_S
from rig.realtime.reasons import Reason
from rig.realtime.safety import STOP_0, STOP_1
from rig.recording.runs import open_run

pytestmark = pytest.mark.realtime

TIMEOUT = 1.0  # s, default of supervisor_timeout_s in a rig file
REACTION = 0.1  # s until the loop has reacted and its drives are off
MARGIN = 0.25  # s of a host with other work


def assert_stopped(
    on: WiredRig, folder: Path, seconds: float, soonest: float, latest: float
) -> None:
    """Assert damping for the rig file's time, then power off, and the same in the record."""
    print(f"no motor had power {seconds:.3f} s later; due {soonest:g} to {latest:g} s")
    assert soonest <= seconds <= latest + MARGIN
    data = open_run(
        folder, fields=["safety.mode", "safety.reason", on.enabled_field, on.moving_field]
    )
    mode = data["safety.mode"].values
    assert data["safety.reason"].values[-1] == Reason.SUPERVISOR_LOST
    assert mode[-1] == STOP_0
    damped = data["time"].values[mode == STOP_1]
    assert on.damping - 0.01 <= damped[-1] - damped[0] <= on.damping + MARGIN
    # Power stayed on while the motion was damped, and the commands were not constant.
    assert (data[on.enabled_field].values[mode == STOP_1] == 1).all()
    assert np.ptp(data[on.moving_field].values[mode == STOP_1]) > 0.0


def test_a_killed_supervisor_leaves_the_whole_stop_to_the_loop(
    wired_rig: WiredRig, tmp_path: Path
) -> None:
    with start_run(wired_rig, tmp_path) as run:
        wait_for_power(wired_rig, run)
        time.sleep(1.0)  # the body or shaft moves by then
        at = time.monotonic()
        run.process.kill()
        power_lost_at = wired_rig.power_off_time(10.0)
        assert power_lost_at is not None
        run.process.wait()
        wait_for_end(tmp_path)
        assert_stopped(
            wired_rig,
            run.folder,
            power_lost_at - at,
            wired_rig.damping - 0.01,
            wired_rig.damping + REACTION,
        )


def test_a_suspended_supervisor_is_a_controlled_stop(wired_rig: WiredRig, tmp_path: Path) -> None:
    with start_run(wired_rig, tmp_path) as run:
        wait_for_power(wired_rig, run)
        time.sleep(1.0)  # the body or shaft moves by then
        at = time.monotonic()
        run.process.send_signal(signal.SIGSTOP)
        power_lost_at = wired_rig.power_off_time(10.0)
        assert power_lost_at is not None
        wait_for_end(tmp_path, except_for=("supervisor",))
        run.process.send_signal(signal.SIGCONT)
        assert run.process.wait(timeout=60) == 4, run.last_output_line()
        status = json.loads((run.folder / "run.json").read_text())
        assert (status["status"], status["reason"]) == ("fault", "SUPERVISOR_LOST")
        assert status["died"] == ""
        assert status["dropped_rows"] == status["unsaved_rows"] == 0
        due = wired_rig.damping + TIMEOUT  # since the last heartbeat
        assert_stopped(
            wired_rig, run.folder, power_lost_at - at, due - POLL_INTERVAL_S - 0.05, due + REACTION
        )
