"""Processes that are stopped or killed in a run on real wires, and runs that must not begin."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from hil_processes import Kill, children, emulated

from benchmarks.support.fault_walk import Trigger, power_gone, ran, when_free
from benchmarks.support.process_faults import beside
from benchmarks.support.wavebot_fault_walk import Stage, campaign_file, checked
from rig.campaign_run import Ended, carry_out, wired
from rig.cli.devices_view import as_dict
from rig.hardware.job import job_of
from rig.hardware.survey import survey
from rig.runs.create import BusyError, hold_realtime

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
    """As `rig devices --anyway` does: every node answers it, and the run goes on."""
    job, told = job_of(on.campaign.rig), dict[str, Any]()

    def look() -> None:
        told.update(as_dict("beside a run", survey(job)))

    looking = threading.Thread(target=look)

    def begin() -> float:
        looking.start()
        return time.monotonic()

    ended, _ = fairly(lambda see: ran(on, see), lambda: Trigger(begin, 0.0))
    looking.join(timeout=120)
    print(told["trouble"])
    nodes = {node["name"]: node for node in told["can"]["nodes"]}
    assert nodes.keys() == {"heave", "surge", "stator"}
    assert all(node["answers"] and node["wrong"] == [] for node in nodes.values())
    assert all(node["nmt"] is not None for node in nodes.values())  # set up by the run: they beat
    assert ended.outcome.reason == "PLAN_END"
    assert ended.outcome.dropped == ended.outcome.unsaved == 0


def test_a_second_run_is_refused_while_the_first_one_lives(on: Stage, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())

    def first() -> Ended:
        with hold_realtime("first"), pytest.raises(BusyError, match="taken by campaign first"):
            carry_out(on.campaign, on.plan, tmp_path, lambda snapshot: None, wired_(on))
        return None  # type: ignore[return-value]

    when_free(first)
    assert set(tmp_path.iterdir()) == before


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
