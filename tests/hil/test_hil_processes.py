"""Processes that are suspended or killed in a run on real wires, and runs that must not begin."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hil_processes import Kill, child_error_files, restart_and_run, run_emulated

from benchmarks.support.campaigns import SilentView, open_checked
from benchmarks.support.emulated_wavebot import write_campaign_file
from benchmarks.support.live_run import LiveRun, is_running, wait_realtime_free, wait_until
from drivers.canopen.heartbeat import NmtState
from rig.cli.output import LOST
from rig.cli.run import exit_code
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import Trigger, power_off_time, run_when_free
from rig.execution.process_faults import child_with_stderr
from rig.execution.task import RunResult, run_task
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.tasks import execution_task, wired_mode
from rig.kinds.wavebot.tick import WaveBotRow
from rig.processes.wire_locks import REALTIME_WIRE, acquire, wires_in
from rig.realtime.safety import RUN
from rig.recording.row_layout import leaves
from rig.recording.runs.create import BusyError
from rig.recording.runs.mcap_file import row_dtype
from rig.wires.scan import BusActivity, listen

pytestmark = pytest.mark.realtime

WATCHDOG = 0.25  # s, command_deadline_ms of the drives in configs/rigs/wavebot_hil.yaml
MARGIN = 0.15  # s of a host with other work
TRIES = 3


def run_until_triggered(run: Any, trigger: Any) -> tuple[RunResult, Any]:
    """Run until the trigger has acted; on a loaded host a run may end before and is repeated."""
    for _ in range(TRIES):
        armed = trigger()
        result = run(armed)
        if armed.time is not None:
            return result, armed
        print(f"ended before the trigger: {result.outcome.reason}")
    raise AssertionError("no run reached its trigger")


def test_a_suspended_loop_leaves_the_drives_to_their_watchdog(on: EmulatedRig) -> None:
    measured: dict[str, Any] = {}

    def suspend() -> float:
        loop = child_with_stderr("loop.stderr")
        on.control.request("power")
        at = time.monotonic()
        os.kill(loop, signal.SIGSTOP)
        measured["power_off"] = power_off_time(on.control)
        measured["currents"] = on.control.request("world")["currents"]
        os.kill(loop, signal.SIGKILL)
        return at

    result, trigger = run_until_triggered(
        lambda on_snapshot: restart_and_run(on, on_snapshot), lambda: Trigger(suspend, 1.0)
    )
    seconds = measured["power_off"] - trigger.time
    print(f"safe {seconds:.3f} s after the loop was suspended")
    assert 0.0 < seconds <= WATCHDOG + MARGIN
    assert result.outcome.status == "crashed"
    assert result.outcome.dropped == result.outcome.unsaved == 0


# By killed process the possible reasons of the loop: the value that gets too old first.
DEATHS = {
    "emulated devices": {"STALE_ENCODER", "STALE_DRIVE"},
    "can": {"FIELDBUS_LOST"},
    "line amplifiers": {"STALE_LOAD_CELL"},
    "line analyser": {"STALE_ANALYSER"},
}


@pytest.mark.sampled
@pytest.mark.parametrize("process", DEATHS)
def test_a_process_that_is_killed_is_named_and_the_loop_stops(
    on: EmulatedRig, tmp_path: Path, process: str
) -> None:
    if process == "emulated devices":
        campaign, plan = open_checked(write_campaign_file(tmp_path))
        result, _ = run_until_triggered(
            lambda on_snapshot: run_emulated(campaign, plan, tmp_path, on_snapshot),
            lambda: Kill(f"{process}.stderr"),
        )
    else:
        result, _ = run_until_triggered(
            lambda on_snapshot: restart_and_run(on, on_snapshot), lambda: Kill(f"{process}.stderr")
        )
    outcome = result.outcome
    assert outcome.status == "fault"
    assert outcome.reason in DEATHS[process]
    assert outcome.died == f"{process} ended: killed by SIGKILL"
    assert outcome.dropped == outcome.unsaved == 0
    assert exit_code(outcome, "") == LOST
    status = json.loads((result.folder / "run.json").read_text())
    assert status["died"] == outcome.died
    assert child_error_files() <= {"emulation.stderr"}  # only the shared emulated devices are left


def test_listening_is_possible_during_a_run(on: EmulatedRig) -> None:
    """As in `rig devices --listen`: every node is received, and the run goes on."""
    activity = list[BusActivity]()

    def listen_to_bus() -> None:
        activity.append(listen(on.short.checked.rig))

    listener = threading.Thread(target=listen_to_bus)

    def begin() -> float:
        listener.start()
        return time.monotonic()

    result, _ = run_until_triggered(
        lambda on_snapshot: restart_and_run(on, on_snapshot), lambda: Trigger(begin, 0.0)
    )
    listener.join(timeout=120)
    (bus_activity,) = activity
    assert (bus_activity.trouble, bus_activity.unlisted_nodes) == ((), ())
    assert [node.name for node in bus_activity.nodes] == ["heave", "surge", "stator"]
    assert {node.nmt for node in bus_activity.nodes} == {NmtState.OPERATIONAL}  # set up by the run
    assert result.outcome.reason == "PLAN_END"
    assert result.outcome.dropped == result.outcome.unsaved == 0


def test_a_second_run_is_refused_while_the_first_one_lives(on: EmulatedRig, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())

    def first() -> RunResult:
        refused = pytest.raises(BusyError, match="taken by campaign first")
        with acquire((REALTIME_WIRE,), "campaign first"), refused:
            run_task(
                execution_task(*on.short),
                tmp_path,
                SilentView(),
                emulated_mode(on),
            )
        return None  # type: ignore[return-value]

    run_when_free(first)
    assert set(tmp_path.iterdir()) == before


def test_a_killed_supervisor_leaves_its_wires_locked_until_its_loop_has_stopped(
    tmp_path: Path,
) -> None:
    """Its emulated devices end with it; until the loop has stopped, no other program may send."""
    campaign = write_campaign_file(tmp_path)
    rig = tmp_path / "rig.yaml"
    wires = wires_in(load_rig(rig)[0])
    module = "benchmarks.support.run_process"
    command = [sys.executable, "-m", module, str(campaign), str(tmp_path / "runs"), "hil", str(rig)]
    wait_realtime_free()
    with LiveRun(command, tmp_path / "runs") as run:
        run.wait_started()
        loop = run.pid("rig.processes.loop_process")
        wait_until(lambda: mode_of(run) == RUN, "the motors to have power")
        run.process.kill()
        run.process.wait()
        for wire in wires:
            with pytest.raises(BusyError, match=rf"{wire.name} .* was killed; its loop is coming"):
                acquire((wire,), "campaign next")

        def free() -> bool:
            try:
                acquire((REALTIME_WIRE, *wires), "campaign next").close()
            except BusyError:
                return False
            assert not is_running(loop)
            return True

        wait_until(free, "the end of all processes that send")


def mode_of(run: LiveRun) -> int:
    newest = run.ring.latest()
    assert newest is not None
    return int(np.frombuffer(newest, row_dtype(leaves(WaveBotRow)))["safety.mode"][0])


def emulated_mode(on: EmulatedRig) -> Any:
    return wired_mode(on.short.checked, emulated=True)


def test_an_address_that_is_taken_is_named(tmp_path: Path) -> None:
    """As with two runs on one host that share wires but not the real-time lock."""
    campaign, plan = open_checked(write_campaign_file(tmp_path))
    port = campaign.rig.wiring.can.options["port"]  # type: ignore[union-attr]
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", int(port)))
        taken.listen()
        result = run_emulated(campaign, plan, tmp_path)
    outcome = result.outcome
    assert outcome.status == "refused"
    assert outcome.reason.startswith("emulated devices: ")
    assert f"{port}" in outcome.reason
    assert "taken" in outcome.reason
    assert (outcome.ticks, outcome.logger_restarts) == (0, 0)
    assert child_error_files() <= {"emulation.stderr"}


def test_a_refused_start_leaves_a_folder_with_the_reason(on: EmulatedRig, tmp_path: Path) -> None:
    on.control.request("restart")
    on.control.switch("heave", "wrong_kp")
    result = run_when_free(
        lambda: run_task(
            execution_task(*on.short),
            tmp_path,
            SilentView(),
            emulated_mode(on)._replace(io_processes=own_io_processes(on)),
        )
    )
    on.control.request("clear")
    status = json.loads((result.folder / "run.json").read_text())
    assert status["status"] == "refused"
    assert "can: heave (node 5)" in status["reason"]
    assert "amc_peak_current: expected 1000" in status["reason"]
    assert status["ticks"] == 0
    assert {path.name for path in result.folder.iterdir()} >= {"config.json", "plan.json"}
    assert child_error_files() <= {"emulation.stderr"}


def own_io_processes(on: EmulatedRig) -> Any:
    return wired_mode(on.short.checked, emulated=False).io_processes
