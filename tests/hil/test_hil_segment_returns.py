"""Slaves that come back after a lost segment: the next run brings them up, nothing else does."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from hil_processes import in_execution

from benchmarks.support.campaigns import SilentView
from benchmarks.support.emulated_wavebot import (
    emulated_wavebot,
    write_ethercat_rig_file,
)
from rig.emulation.cable import cable_problem
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import CallbackView, Trigger, run_when_free

pytest.importorskip("pysoem")
if problem := cable_problem("wectest"):
    pytest.skip(problem, allow_module_level=True)

pytestmark = [pytest.mark.realtime, pytest.mark.long]
CALM_S = 12.0  # s in which the body comes to rest after a stop without damping


@pytest.fixture(scope="module")
def segment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatedRig]:
    """Start the emulated segment for all tests of this file."""
    folder, timing = tmp_path_factory.mktemp("returns"), {"settle_s": 1, "interval_s": 4}
    with emulated_wavebot(folder, write_ethercat_rig_file, timing=timing) as started:
        started.control.request("restart")
        yield in_execution(started, "compiled")


@pytest.mark.parametrize(
    ("device", "fault"),
    [
        ("stator", "unplugged"),  # it forgets station, settings and its home, as all behind it
        ("heave", "brown_out"),
        ("heave", "cable_cut"),
        ("ethercat", "disconnect"),
    ],
)
def test_the_run_after_a_lost_segment_needs_no_restart(
    segment: EmulatedRig, device: str, fault: str
) -> None:
    control = segment.control

    def lose() -> float:
        control.switch(device, fault)
        return time.monotonic()

    trigger = Trigger(lose, 0.5)
    lost = run_when_free(lambda: segment.run(CallbackView(trigger)))
    assert (lost.outcome.status, lost.outcome.reason) == ("fault", "FIELDBUS_LOST")
    nodes = control.request("world")["nodes"]
    assert nodes["heave"]["state"] != 8  # OP
    control.request("clear")
    time.sleep(CALM_S)
    assert control.request("world")["nodes"]["heave"]["state"] != 8  # nothing is armed by itself
    following = run_when_free(lambda: segment.run(SilentView()))
    assert following.outcome.status == "complete", following.outcome
