"""A supervisor killed or suspended in a run on real wires: the rig is still brought to rest.

The emulated devices are a process apart, as a rig is: they do not end with the run.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.support.wired_rigs import WIRED, WiredRig, started, wait_gone, wait_powered
from rig.processes.supervisor import POLL
from rig.realtime.safety import STOP_0, STOP_1, Reason
from rig.recording.runs import open_run

pytestmark = pytest.mark.realtime

TIMEOUT = 1.0  # s, supervisor_timeout_s where a rig file does not say otherwise
LOOK = 0.1  # s until the loop has noticed, and its drives have gone off
MARGIN = 0.25  # s of a host with other work


@pytest.fixture(scope="module", params=WIRED)
def on(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[WiredRig]:
    with WIRED[request.param](tmp_path_factory.mktemp("supervisor")) as made:
        yield made


def judge(on: WiredRig, folder: Path, seconds: float, soonest: float, latest: float) -> None:
    """Damped for as long as the rig file says, then off; the record shows why and how long."""
    print(f"no motor had power {seconds:.3f} s later; due {soonest:g} to {latest:g} s")
    assert soonest <= seconds <= latest + MARGIN
    found = open_run(folder, fields=["safety.mode", "safety.reason", on.enabled, on.moves])
    mode = found["safety.mode"].values
    assert found["safety.reason"].values[-1] == Reason.SUPERVISOR_LOST
    assert mode[-1] == STOP_0
    damped = found["time"].values[mode == STOP_1]
    assert on.damping - 0.01 <= damped[-1] - damped[0] <= on.damping + MARGIN
    # Power stayed on while the motion was damped, and something was done with it.
    assert (found[on.enabled].values[mode == STOP_1] == 1).all()
    assert np.ptp(found[on.moves].values[mode == STOP_1]) > 0.0


def test_a_killed_supervisor_leaves_the_whole_stop_to_the_loop(
    on: WiredRig, tmp_path: Path
) -> None:
    with started(on, tmp_path) as run:
        wait_powered(on, run)
        time.sleep(1.0)
        at = time.monotonic()
        run.process.kill()
        gone = on.power_gone(10.0)
        assert gone is not None
        run.process.wait()
        wait_gone(tmp_path)
        judge(on, run.folder, gone - at, on.damping - 0.01, on.damping + LOOK)


def test_a_suspended_supervisor_is_a_controlled_stop(on: WiredRig, tmp_path: Path) -> None:
    with started(on, tmp_path) as run:
        wait_powered(on, run)
        time.sleep(1.0)
        at = time.monotonic()
        run.process.send_signal(signal.SIGSTOP)
        gone = on.power_gone(10.0)
        assert gone is not None
        wait_gone(tmp_path, but=("supervisor",))
        run.process.send_signal(signal.SIGCONT)
        assert run.process.wait(timeout=60) == 4, run.last_words()
        status = json.loads((run.folder / "run.json").read_text())
        assert (status["status"], status["reason"]) == ("fault", "SUPERVISOR_LOST")
        assert status["died"] == ""
        assert status["dropped_rows"] == status["unsaved_rows"] == 0
        due = on.damping + TIMEOUT  # since the last sign of life
        judge(on, run.folder, gone - at, due - POLL - 0.05, due + LOOK)
