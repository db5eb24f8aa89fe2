"""A loop on the simulated plants notices an actuator or a sensor that does something else.

Each fault is put between the loop and a plant in waves; without one nothing trips.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import pytest
from core_bench import params as bench_params
from core_bench import setpoints
from core_bench import simulated_bench as bench_plant
from core_runs import Ran, plan, run
from core_wavebot import READY, Bent, params, plant, table

from controllers import impedance
from controllers.oswec_position import Component
from rig.kinds.oswec_bench import KIND as BENCH
from rig.kinds.wavebot import KIND, Sense
from rig.realtime.safety import CATEGORY, RUN, STOP_0, STOP_1, Reason
from rig.realtime.sequence import WAIT_DRIVE, Phase

AT = 9000  # tick of the fault; the waves are up since 7 s
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
    """What is put between loop and plant from tick AT on."""

    def __init__(self) -> None:
        self.commanded: Any = None

    def sense(self, word: Any) -> Any:
        """What the loop reads of it."""
        return word

    def command(self, word: Any) -> Any:
        """What the plant hears of it."""
        return word


def ran(fault: Fault, segments: Any = LONG, points: Any = POINTS) -> tuple[Ran, Bent]:
    def sense(tick: int, word: Any) -> Any:
        return fault.sense(word) if tick >= AT else word

    def command(tick: int, word: Any) -> Any:
        made = fault.command(word) if tick >= AT else word
        fault.commanded = word
        return made

    devices = Bent(plant(WAVES), sense, command)
    done = run(KIND, params(segments, points), devices)
    assert done.error is None
    assert done.end is not None
    return done, devices


class Command(Fault):
    """The current of an axis on its way to the drive."""

    def __init__(self, axis: str, change: Any) -> None:
        super().__init__()
        self._axis, self._change = axis, change

    def command(self, word: Any) -> Any:
        told = getattr(word, self._axis)
        changed = told._replace(current=self._change(told.current))
        return word._replace(**{self._axis: changed})


class Lying(Command):
    """The same with a drive that reports the current it was commanded to have."""

    def sense(self, word: Any) -> Any:
        axis = getattr(word, self._axis)
        current = getattr(self.commanded, self._axis).current if axis.enabled else 0.0
        return word._replace(**{self._axis: axis._replace(current=current)})


class Read(Fault):
    """A sensor."""

    def __init__(self, change: Any) -> None:
        super().__init__()
        self._change = change

    def sense(self, word: Sense) -> Sense:
        changed: Sense = self._change(word)
        return changed


def inverted_cell(word: Sense) -> Sense:
    return word._replace(load=word.load._replace(lcb=-word.load.lcb))


def inverted_torque_sensor(word: Sense) -> Sense:
    return word._replace(load=word.load._replace(trs=-word.load.trs))


def dead_cells(word: Sense) -> Sense:
    return word._replace(load=word.load._replace(lcb=0.0, trs=0.0))


def inverted_analyser(word: Sense) -> Sense:
    return word._replace(power=word.power._replace(ac=-word.power.ac))


FAULTS: dict[str, tuple[Fault, Reason, float]] = {
    "inverted motor": (Command("heave", lambda i: -i), Reason.CURRENT_DISAGREES, 0.9),
    "second master": (Command("heave", lambda i: 19.6), Reason.CURRENT_DISAGREES, 0.3),
    "no torque": (Command("heave", lambda i: 0.0), Reason.CURRENT_DISAGREES, 1.2),
    "inverted surge motor": (Command("surge", lambda i: -i), Reason.SURGE_CURRENT_DISAGREES, 0.9),
    "inverted force, current as told": (Lying("heave", lambda i: -i), Reason.FORCE_DISAGREES, 1.0),
    "half the force, current as told": (
        Lying("heave", lambda i: i / 2),
        Reason.FORCE_DISAGREES,
        4.0,
    ),
    "inverted column load cell": (Read(inverted_cell), Reason.POWER_BALANCE, 10.0),
    "inverted torque sensor": (Read(inverted_torque_sensor), Reason.FORCE_DISAGREES, 1.0),
    "dead load cells": (Read(dead_cells), Reason.FORCE_DISAGREES, 2.5),
    "inverted analyser": (Read(inverted_analyser), Reason.POWER_BALANCE, 10.0),
}


@cache
def undisturbed() -> tuple[Ran, Bent]:
    return ran(Fault())


def test_without_a_fault_nothing_disagrees() -> None:
    done, _ = undisturbed()
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END
    moved = [row.heave.estimate.velocity for row in done.rows if row.tick > AT]
    assert max(map(abs, moved)) > 0.2  # m/s: there was power to compare


@pytest.mark.parametrize("name", FAULTS)
def test_what_does_not_do_what_it_was_told_is_noticed(name: str) -> None:
    fault, reason, within = FAULTS[name]
    done, devices = ran(fault)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.reason, first.tick > AT) == (reason, True)
    assert (first.tick - AT) * 0.001 <= within
    assert first.safety.mode == (STOP_0 if CATEGORY[reason] == 0 else STOP_1)
    if CATEGORY[reason] == 0:
        told = devices.commands[first.tick]
        assert (told.heave.current, told.heave.enable, told.surge.enable) == (0.0, 0, 0)


def test_a_law_that_pushes_where_it_should_damp_is_noticed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As if the sign of the force were wrong: current and load cells agree with each other."""
    sound, calls = impedance.step, iter(range(10**9))

    def wrong(*given: Any) -> Any:
        state, demand = sound(*given)
        if next(calls) >= AT - 1000:  # it acts from about tick 700 on
            demand = demand._replace(force=-demand.force)
        return state, demand

    monkeypatch.setattr(impedance, "step", wrong)
    done, devices = ran(Fault())
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, Reason.POWER_SIGN)
    assert devices.commands[first.tick].heave.current == 0.0


def test_a_saturated_drive_may_give_less() -> None:
    """Half the current under a bus that does not suffice agrees; twice as much does not."""

    class Saturated(Lying):
        def sense(self, word: Sense) -> Sense:
            current = self._change(self.commanded.heave.current) if word.heave.enabled else 0.0
            return word._replace(
                heave=word.heave._replace(current=current),
                drive=word.drive._replace(saturated=1),
            )

    weak, _ = ran(Saturated("heave", lambda i: 0.5 * i))
    assert weak.end is not None
    assert weak.end.reason == Reason.PLAN_END
    strong, _ = ran(Saturated("heave", lambda i: 2.0 * i))
    assert strong.end is not None
    assert strong.end.reason == Reason.CURRENT_DISAGREES


# --- the bench

TURN = Component(math.radians(10.0), 2.0 * math.pi / 1.5, 0.0, 1.0, 0.0)
SLOW = plan(
    (-1, Phase.TARE, 60, 0, 0),
    (0, Phase.MOVING, 200, WAIT_DRIVE, 0),
    (0, Phase.SETTLE, 1500, 0, 0),
    (0, Phase.MEASURE, 6000, 0, 0),
    (0, Phase.TAIL, 100, 0, 0),
)
STRIKE = 2500


def bench_ran(sense: Any = None, command: Any = None) -> Ran:
    point = setpoints(TURN, 60.0)._replace(rise=(0.5,), until=(7.0,))
    made = bench_params(segments=SLOW, setpoints=point)
    done = run(BENCH, made, Bent(bench_plant(), sense, command))
    assert done.error is None
    return done


def test_a_bench_without_a_fault_agrees() -> None:
    done = bench_ran()
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END


def test_a_servo_that_keeps_its_last_speed_is_noticed_before_the_end_of_travel() -> None:
    last: list[float] = []

    def ignoring(tick: int, word: Any) -> Any:
        if tick < STRIKE:
            last[:] = [word.volts]
        return word._replace(volts=last[0]) if last else word

    done = bench_ran(command=ignoring)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, Reason.VELOCITY_DISAGREES)
    assert 0 < first.tick - STRIKE < 600


def test_an_inverted_load_cell_of_the_bench_is_noticed() -> None:
    def inverted(tick: int, word: Any) -> Any:
        return word if tick < STRIKE else word._replace(load=word.load._replace(tz=-word.load.tz))

    done = bench_ran(sense=inverted)
    first = next(row for row in done.rows if row.safety.mode > RUN)
    assert (first.safety.mode, first.safety.reason) == (STOP_0, Reason.FORCE_DISAGREES)
    assert 0 < first.tick - STRIKE < 1500
