"""A loop on the simulated plants detects a faulty actuator or sensor.

Each fault acts between the loop and a plant in waves; without a fault nothing trips. Both
executions of the tick detect it in time; only interpreted is a law that counts its calls.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import pytest
from core_bench import cosine, setpoints
from core_bench import params as bench_params
from core_bench import simulated_bench as bench_plant
from core_runs import RunResult, plan, run
from core_wavebot import READY, ModifiedDevices, params, plant, table

from controllers import impedance
from controllers.oswec_position import EnvelopeTimes
from rig.kinds.oswec_bench.tick.cycle import KIND as BENCH
from rig.kinds.oswec_bench.tick.reasons import BenchReason
from rig.kinds.wavebot.tick import KIND, Sense, kind_with_law
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN, STOP_0, STOP_1
from rig.realtime.sequence import WAIT_DRIVE, Phase

pytestmark = [pytest.mark.usefixtures("execution"), pytest.mark.sampled]

AT = 9000  # tick of the fault, 7 s after the waves started
WAVES = {"kind": "regular", "amplitude_m": 0.2, "frequency_hz": 0.5}
LONG = plan(
    (-1, Phase.TARE, 500, 0, 0),
    (-1, Phase.MOVING, 100, READY, 0),
    (-1, Phase.LEAD_IN, 500, 0, 0),
    (0, Phase.SETTLE, 1000, 0, 0),
    (0, Phase.MEASURE, 9000, 0, 0),
    (1, Phase.MEASURE, 5000, 0, 1),
    timeout=400,
)
POINTS = table((-2000.0, -2500.0), (0.0, 3000.0), (490.9, 490.9))


class Fault:
    """A fault between loop and plant from tick AT on."""

    def __init__(self) -> None:
        self.commanded: Any = None

    def sense(self, signals: Any) -> Any:
        """Return the signals that the loop reads."""
        return signals

    def command(self, signals: Any) -> Any:
        """Return the command that the plant receives."""
        return signals


def run_with_fault(
    fault: Fault, segments: Any = LONG, points: Any = POINTS, kind: Any = KIND
) -> tuple[RunResult, ModifiedDevices]:
    def sense(tick: int, signals: Any) -> Any:
        return fault.sense(signals) if tick >= AT else signals

    def command(tick: int, signals: Any) -> Any:
        modified = fault.command(signals) if tick >= AT else signals
        fault.commanded = signals
        return modified

    devices = ModifiedDevices(plant(WAVES), sense, command)
    done = run(kind, params(segments, points), devices)
    assert done.error is None
    assert done.end is not None
    return done, devices


class Command(Fault):
    """Changes the current command of an axis."""

    def __init__(self, axis: str, change: Any) -> None:
        super().__init__()
        self._axis, self._change = axis, change

    def command(self, signals: Any) -> Any:
        axis_command = getattr(signals, self._axis)
        changed = axis_command._replace(current=self._change(axis_command.current))
        return signals._replace(**{self._axis: changed})


class Lying(Command):
    """Like `Command`, with a drive that reports the commanded current."""

    def sense(self, signals: Any) -> Any:
        axis = getattr(signals, self._axis)
        current = getattr(self.commanded, self._axis).current if axis.enabled else 0.0
        return signals._replace(**{self._axis: axis._replace(current=current)})


class Read(Fault):
    """Changes sensed values."""

    def __init__(self, change: Any) -> None:
        super().__init__()
        self._change = change

    def sense(self, signals: Sense) -> Sense:
        changed: Sense = self._change(signals)
        return changed


def inverted_cell(signals: Sense) -> Sense:
    return signals._replace(load=signals.load._replace(lcb=-signals.load.lcb))


def inverted_torque_sensor(signals: Sense) -> Sense:
    return signals._replace(load=signals.load._replace(trs=-signals.load.trs))


def dead_cells(signals: Sense) -> Sense:
    return signals._replace(load=signals.load._replace(lcb=0.0, trs=0.0))


def inverted_analyser(signals: Sense) -> Sense:
    return signals._replace(power=signals.power._replace(ac=-signals.power.ac))


FAULTS: dict[str, tuple[Fault, Reason, float]] = {
    "inverted motor": (Command("heave", lambda i: -i), Reason.CURRENT_DISAGREES, 0.9),
    "second master": (Command("heave", lambda i: 19.6), Reason.CURRENT_DISAGREES, 0.3),
    "no torque": (Command("heave", lambda i: 0.0), Reason.CURRENT_DISAGREES, 1.2),
    "inverted surge motor": (
        Command("surge", lambda i: -i),
        WaveBotReason.SURGE_CURRENT_DISAGREES,
        0.9,
    ),
    "inverted force, current as commanded": (
        Lying("heave", lambda i: -i),
        Reason.FORCE_DISAGREES,
        1.0,
    ),
    "half the force, current as commanded": (
        Lying("heave", lambda i: i / 2),
        Reason.FORCE_DISAGREES,
        4.0,
    ),
    "inverted column load cell": (Read(inverted_cell), Reason.POWER_BALANCE, 10.0),
    "inverted torque sensor": (Read(inverted_torque_sensor), Reason.FORCE_DISAGREES, 1.0),
    "dead load cells": (Read(dead_cells), Reason.FORCE_DISAGREES, 2.5),
    "inverted analyser": (Read(inverted_analyser), Reason.POWER_BALANCE, 10.0),
}


def test_without_a_fault_nothing_disagrees() -> None:
    done, _ = run_with_fault(Fault())
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END
    moved = [row.heave.estimate.velocity for row in done.rows if row.tick > AT]
    assert max(map(abs, moved)) > 0.2  # m/s: enough power to compare


@pytest.mark.parametrize("name", FAULTS)
def test_every_device_fault_is_detected(name: str) -> None:
    fault, reason, within = FAULTS[name]
    done, devices = run_with_fault(fault)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.reason, first.tick > AT) == (reason, True)
    assert (first.tick - AT) * 0.001 <= within
    assert first.safety.mode == (STOP_0 if KIND.reason_table.categories[reason] == 0 else STOP_1)
    if KIND.reason_table.categories[reason] == 0:
        axis_command = devices.commands[first.tick]
        assert (
            axis_command.heave.current,
            axis_command.heave.enable,
            axis_command.surge.enable,
        ) == (0.0, 0, 0)


@pytest.mark.parametrize("execution", ["interpreted"], indirect=True)
def test_a_law_with_the_wrong_sign_is_detected() -> None:
    """The sign of the force is wrong, while current and load cells agree with each other."""
    sound, calls = impedance.step, iter(range(10**9))

    def wrong(*given: Any) -> Any:
        state, demand = sound(*given)
        if next(calls) >= AT - 1000:  # it acts from about tick 700 on
            demand = demand._replace(force=-demand.force)
        return state, demand

    law = ModuleType("wrong_sign")
    vars(law).update(vars(impedance) | {"step": wrong})
    done, devices = run_with_fault(Fault(), kind=kind_with_law(law))
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, Reason.POWER_SIGN)
    assert devices.commands[first.tick].heave.current == 0.0


def test_a_saturated_drive_may_supply_less_current() -> None:
    """At insufficient bus voltage half the current is accepted, twice the current is not."""

    class Saturated(Lying):
        def sense(self, signals: Sense) -> Sense:
            current = self._change(self.commanded.heave.current) if signals.heave.enabled else 0.0
            return signals._replace(
                heave=signals.heave._replace(current=current),
                drive=signals.drive._replace(saturated=1),
            )

    weak, _ = run_with_fault(Saturated("heave", lambda i: 0.5 * i))
    assert weak.end is not None
    assert weak.end.reason == Reason.PLAN_END
    strong, _ = run_with_fault(Saturated("heave", lambda i: 2.0 * i))
    assert strong.end is not None
    assert strong.end.reason == Reason.CURRENT_DISAGREES


# --- the bench

TURN = cosine(math.radians(10.0), 1.5)
SLOW = plan(
    (-1, Phase.TARE, 60, 0, 0),
    (0, Phase.MOVING, 200, WAIT_DRIVE, 0),
    (0, Phase.SETTLE, 1500, 0, 0),
    (0, Phase.MEASURE, 6000, 0, 0),
    (0, Phase.TAIL, 100, 0, 0),
)
STRIKE = 2500


def run_bench(sense: Any = None, command: Any = None) -> RunResult:
    slow = setpoints(TURN, 60.0, span=EnvelopeTimes(0.5, 7.0))
    modified = bench_params(segments=SLOW, setpoints=slow)
    done = run(BENCH, modified, ModifiedDevices(bench_plant(), sense, command))
    assert done.error is None
    return done


def test_a_bench_without_a_fault_agrees() -> None:
    done = run_bench()
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END


def test_a_servo_with_a_frozen_speed_is_detected_in_time() -> None:
    last: list[float] = []

    def ignoring(tick: int, signals: Any) -> Any:
        if tick < STRIKE:
            last[:] = [signals.volts]
        return signals._replace(volts=last[0]) if last else signals

    done = run_bench(command=ignoring)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, BenchReason.VELOCITY_DISAGREES)
    assert 0 < first.tick - STRIKE < 600


def test_an_inverted_load_cell_of_the_bench_is_detected() -> None:
    def inverted(tick: int, signals: Any) -> Any:
        return (
            signals
            if tick < STRIKE
            else signals._replace(load=signals.load._replace(tz=-signals.load.tz))
        )

    done = run_bench(sense=inverted)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, Reason.FORCE_DISAGREES)
    assert 0 < first.tick - STRIKE < 1500
