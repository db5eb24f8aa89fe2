"""Processes that are stopped or killed in a run on real wires, and runs that must not begin."""

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
from hil_processes import Kill, children, emulated

from benchmarks.support.fault_walk import Trigger, power_gone, ran, when_free
from benchmarks.support.live import LiveRun, running, wait_realtime_free, wait_until
from benchmarks.support.process_faults import beside
from benchmarks.support.wavebot_fault_walk import Stage, campaign_file, checked
from drivers.canopen.heartbeat import Nmt
from rig.config.any_rig_file import load_rig
from rig.execution.campaign import Ended, carry_out, wired
from rig.execution.hardware.listen import Heard, listen
from rig.kinds.wavebot import WaveBotRow
from rig.processes.wire_locks import REALTIME_PLACE, hold, wires_of
from rig.realtime.safety import RUN
from rig.recording.row_layout import leaves
from rig.recording.runs.create import BusyError
from rig.recording.runs.mcap_file import row_dtype

pytestmark = pytest.mark.realtime

WATCHDOG = 0.25  # s, command_deadline_ms of the drives in configs/rigs/wavebot_hil.yaml
MARGIN = 0.15  # s of a host with other work
TRIES = 3


def fairly(run: Any, trigger: Any) -> tuple[Ended, Any]:
    """A run in which the deed was done: on a loaded host one may stop before, and is repeated."""
    for _ in range(TRIES):
        deed = trigger()
        ended = run(deed)
        if deed.at is not None:
            return ended, deed
        print(f"ended before its time: {ended.outcome.reason}")
    raise AssertionError("no run got that far")


def test_a_loop_that_stands_still_leaves_the_drives_to_their_watchdog(on: Stage) -> None:
    told: dict[str, Any] = {}

    def stand() -> float:
        loop = beside("loop.stderr")
        on.control.ask("power")
        at = time.monotonic()
        os.kill(loop, signal.SIGSTOP)
        told["gone"] = power_gone(on)
        told["currents"] = on.control.ask("world")["currents"]
        os.kill(loop, signal.SIGKILL)
        return at

    ended, deed = fairly(lambda see: ran(on, see), lambda: Trigger(stand, 1.0))
    seconds = told["gone"] - deed.at
    print(f"safe {seconds:.3f} s after the loop stood still")
    assert 0.0 < seconds <= WATCHDOG + MARGIN
    assert ended.outcome.status == "crashed"
    assert ended.outcome.dropped == ended.outcome.unsaved == 0


# What dies, and what the loop may name: whichever value grows old first.
DEATHS = {
    "emulated devices": {"STALE_ENCODER", "STALE_DRIVE"},
    "can": {"DRIVE_FAULT", "SURGE_DRIVE_FAULT"},
    "line amplifiers": {"STALE_LOAD_CELL"},
    "line analyser": {"STALE_ANALYSER"},
}


@pytest.mark.parametrize("who", DEATHS)
def test_a_process_that_is_killed_is_named_and_the_loop_stops(
    on: Stage, tmp_path: Path, who: str
) -> None:
    if who == "emulated devices":
        campaign, plan = checked(campaign_file(tmp_path))
        ended, _ = fairly(
            lambda see: emulated(campaign, plan, tmp_path, see), lambda: Kill(f"{who}.stderr")
        )
    else:
        ended, _ = fairly(lambda see: ran(on, see), lambda: Kill(f"{who}.stderr"))
    outcome = ended.outcome
    assert outcome.status == "fault"
    assert outcome.reason in DEATHS[who]
    assert outcome.died == f"{who} ended: killed by SIGKILL"
    assert outcome.dropped == outcome.unsaved == 0
    status = json.loads((ended.folder / "run.json").read_text())
    assert status["died"] == outcome.died
    assert children() <= {"emulation.stderr"}  # the staged devices; nothing else is left


def test_the_wires_can_be_looked_at_beside_a_run(on: Stage) -> None:
    """As `rig devices --listen` does: every node is heard, and the run goes on."""
    heard = list[Heard]()

    def look() -> None:
        heard.append(listen(on.campaign.rig))

    looking = threading.Thread(target=look)

    def begin() -> float:
        looking.start()
        return time.monotonic()

    ended, _ = fairly(lambda see: ran(on, see), lambda: Trigger(begin, 0.0))
    looking.join(timeout=120)
    (found,) = heard
    assert (found.trouble, found.strangers) == ((), ())
    assert [one.name for one in found.nodes] == ["heave", "surge", "stator"]
    assert {one.nmt for one in found.nodes} == {Nmt.OPERATIONAL}  # set up by the run: they beat
    assert ended.outcome.reason == "PLAN_END"
    assert ended.outcome.dropped == ended.outcome.unsaved == 0


def test_a_second_run_is_refused_while_the_first_one_lives(on: Stage, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())

    def first() -> Ended:
        refused = pytest.raises(BusyError, match="taken by campaign first")
        with hold((REALTIME_PLACE,), "campaign first"), refused:
            carry_out(on.campaign, on.plan, tmp_path, lambda snapshot: None, wired_(on))
        return None  # type: ignore[return-value]

    when_free(first)
    assert set(tmp_path.iterdir()) == before


def test_a_killed_supervisor_leaves_its_wires_locked_until_its_loop_has_stopped(
    tmp_path: Path,
) -> None:
    """Its emulated devices go with it; until the loop has seen that, nobody else may send."""
    campaign = campaign_file(tmp_path)
    rig = tmp_path / "rig.yaml"
    wires = wires_of(load_rig(rig)[0])
    module = "benchmarks.support.run_process"
    words = [sys.executable, "-m", module, str(campaign), str(tmp_path / "runs"), "hil", str(rig)]
    wait_realtime_free()
    with LiveRun(words, tmp_path / "runs") as run:
        run.wait_started()
        loop = run.pid("rig.execution.hardware")
        wait_until(lambda: mode_of(run) == RUN, "the motors to have power")
        run.process.kill()
        run.process.wait()
        for wire in wires:
            with pytest.raises(BusyError, match=rf"{wire.name} .* was killed; its loop is coming"):
                hold((wire,), "campaign next")

        def free() -> bool:
            try:
                hold((REALTIME_PLACE, *wires), "campaign next").close()
            except BusyError:
                return False
            assert not running(loop)
            return True

        wait_until(free, "the end of all that sends")


def mode_of(run: LiveRun) -> int:
    newest = run.ring.latest()
    assert newest is not None
    return int(np.frombuffer(newest, row_dtype(leaves(WaveBotRow)))["safety.mode"][0])


def wired_(on: Stage) -> Any:
    return wired(on.campaign, emulated=True)


def test_an_address_that_is_taken_is_named(tmp_path: Path) -> None:
    """So it is when two runs on one host share wires and not the real-time place."""
    campaign, plan = checked(campaign_file(tmp_path))
    port = campaign.rig.wiring.can.options["port"]  # type: ignore[union-attr]
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", int(port)))
        taken.listen()
        ended = emulated(campaign, plan, tmp_path)
    outcome = ended.outcome
    assert outcome.status == "refused"
    assert outcome.reason.startswith("emulated devices: ")
    assert f"{port}" in outcome.reason
    assert "taken" in outcome.reason
    assert (outcome.ticks, outcome.logger_restarts) == (0, 0)
    assert children() <= {"emulation.stderr"}


def test_a_refused_start_leaves_a_folder_that_says_so(on: Stage, tmp_path: Path) -> None:
    on.control.ask("restart")
    on.control.switch("heave", "wrong_kp")
    ended = when_free(
        lambda: carry_out(
            on.campaign, on.plan, tmp_path, Quiet(), wired_(on)._replace(companions=only_ours(on))
        )
    )
    on.control.ask("clear")
    status = json.loads((ended.folder / "run.json").read_text())
    assert status["status"] == "refused"
    assert "can: heave (node 5)" in status["reason"]
    assert "amc_peak_current: wanted 1000" in status["reason"]
    assert status["ticks"] == 0
    assert {path.name for path in ended.folder.iterdir()} >= {"config.json", "plan.json"}
    assert children() <= {"emulation.stderr"}


class Quiet:
    notice = ""

    def __call__(self, snapshot: Any) -> None:
        pass


def only_ours(on: Stage) -> Any:
    return wired(on.campaign, emulated=False).companions
