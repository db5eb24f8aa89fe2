"""The composed tick of a modular rig against the equations that it stands for."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import pytest
from modular_rigs import (
    DT,
    FORCE,
    HEAVE,
    PITCH,
    axis_sense,
    composed,
    measuring,
    one_axis,
    params,
    rig_mapping,
    sense,
    two_axes,
)

from controllers.signals import PanelSense
from rig.compilation import lifting
from rig.kinds.modular.config import LimitsFile, RigFile
from rig.kinds.modular.tick import Composition, compose, find_kind
from rig.realtime import cycle
from rig.realtime.reasons import Reason
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import RUN
from rig.recording.row_layout import leaves

NO_TIMING = cycle.Timing(0.0, 0.0, 0)
GAINS = {"heave": (-2000.0, 500.0, 0.0), "pitch": (-300.0, 0.0, 5.0)}
TARE_TICKS = 200

Read = Callable[[int], Any]


def run(rig: RigFile, bounds: LimitsFile, read: Read, ticks: int = 1200) -> list[Any]:
    """Return the rows of a run whose readings of each tick are given."""
    kind = composed(rig).KIND
    own = params(rig, bounds, measuring(TARE_TICKS, ticks), **GAINS)
    step, state, rows = cycle.make(kind), cycle.start(kind, own, 0), []
    currents = dict.fromkeys(rig.axes, 0.0)
    for tick in range(ticks):
        given = follow(read(tick), currents)
        state, command, row = step(own, state, given, NO_REQUEST, tick, NO_TIMING, 1, DT)
        currents = {name: getattr(command, name).current for name in rig.axes}
        rows.append(row)
    return rows


def follow(given: Any, currents: dict[str, float]) -> Any:
    """Return readings in which the drives have the currents that the last tick commanded."""
    axes = {name: getattr(given, name)._replace(current=i) for name, i in currents.items()}
    return given._replace(**axes)


def radians(axis: dict[str, Any], motor_angle_per_unit: str) -> float:
    return 2.0 * math.pi / axis[motor_angle_per_unit] / axis["counts_per_revolution"]


PER_COUNT = radians(HEAVE, "gear_ratio_rad_per_m")
PITCH_PER_COUNT = radians(PITCH, "gear_ratio")


def swing(tick: int) -> float:
    """Return a motion of 0.1 at 0.5 Hz, at rest until the tare is over."""
    t = max(0, tick - TARE_TICKS) * DT
    return 0.05 * (1.0 - math.cos(math.pi * t))


def quiet(tick: int) -> Any:
    rig, _ = one_axis()
    return sense(composed(rig), axis_sense(0), pto_force=(0.0, 0.0), dc_power=(0.0, 0.0))


def test_force_and_powers_are_those_of_their_equations() -> None:
    """The force is Kp v + Ki x of the estimated motion, with the zero of the tare."""
    rig, bounds = one_axis()
    offset = 100_000

    def read(tick: int) -> Any:
        counts = offset + round(swing(tick) / PER_COUNT)
        return sense(
            composed(rig), axis_sense(counts), pto_force=(7.0 + tick, 0.0), dc_power=(-3.0, 0.0)
        )

    rows = run(rig, bounds, read)
    assert rows[-1].safety.reason == Reason.NONE
    zero = 7.0 + (TARE_TICKS - 1) / 2.0  # mean of the tared ticks
    for row in rows[TARE_TICKS + 210 :]:  # the force fades in over stop.ramp_s
        assert row.safety.mode == RUN
        x, v, _ = row.heave.estimate
        assert row.heave.demand.force == pytest.approx(-2000.0 * v + 500.0 * x, rel=1e-12)
        assert row.heave.command.current == pytest.approx(row.heave.command.force / 18.0)
        assert row.tare.pto_force == pytest.approx(zero)
        assert row.power.mechanical == pytest.approx((row.pto_force.value - zero) * v)
        assert row.power.dc == -3.0
    last = rows[-1]
    assert last.heave.estimate.position == pytest.approx(swing(last.tick), abs=2e-5)


def test_each_axis_has_its_own_law_limits_and_units() -> None:
    rig, bounds = two_axes()

    def read(tick: int) -> Any:
        heave, pitch = round(swing(tick) / PER_COUNT), round(-2.0 * swing(tick) / PITCH_PER_COUNT)
        return sense(
            composed(rig),
            axis_sense(heave),
            axis_sense(pitch),
            pto_force=(0.0, 0.0),
            dc_power=(0.0, 0.0),
        )

    last = run(rig, bounds, read)[-1]
    x, v, a = last.pitch.estimate
    assert last.pitch.demand.force == pytest.approx(-300.0 * v + 5.0 * a)
    assert x == pytest.approx(-2.0 * swing(last.tick), abs=1e-3)
    assert last.heave.demand.force == pytest.approx(
        -2000.0 * last.heave.estimate.velocity + 500.0 * last.heave.estimate.position
    )
    units = {leaf.name: leaf.unit for leaf in leaves(composed(rig).Row)}
    assert units["pitch.estimate.velocity"] == "rad/s"
    assert units["pitch.command.force"] == "N*m"
    assert units["heave.command.force"] == "N"
    assert units["pto_force.value"] == "N"
    assert units["tare.pitch"] == "rad"


@pytest.mark.parametrize(
    ("readings", "reason"),
    [
        ({"pto_force": (0.0, 0.2)}, "PTO_FORCE_STALE"),
        ({"pto_force": (0.0, -1e-3)}, "PTO_FORCE_STALE"),
        ({"pto_force": (5001.0, 0.0)}, "PTO_FORCE_RANGE"),
        ({"dc_power": (-20001.0, 0.0)}, "DC_POWER_RANGE"),
        ({"dc_power": (math.nan, 0.0)}, "NOT_FINITE"),
        ({"dc_power": (0.0, math.inf)}, "NOT_FINITE"),
        ({"heave": {"counts": 900_000}}, "ENCODER_JUMP"),
        ({"heave": {"fault": 1}}, "DRIVE_FAULT"),
        ({"heave": {"encoder_age": 0.03}}, "STALE_ENCODER"),
        ({"pitch": {"fault": 1}}, "PITCH_DRIVE_FAULT"),
        ({"pitch": {"fault": -1, "encoder_age": 0.03}}, "FIELDBUS_LOST"),
        ({"pitch": {"enabled": 0}}, "PITCH_DRIVE_DROPPED"),
        ({"pitch": {"drive_age": 0.2}}, "PITCH_STALE_DRIVE"),
        ({"panel": PanelSense(1, 0, 0.0)}, "EMERGENCY_STOP"),
        ({"panel": PanelSense(0, 1, 0.0)}, "LIMIT_SWITCH"),
        ({"panel": PanelSense(0, 0, 0.6)}, "STALE_PANEL"),
    ],
)
def test_each_fault_stops_the_rig_by_its_name(readings: dict[str, Any], reason: str) -> None:
    rig, bounds = two_axes()
    tick_of_fault = 400

    def read(tick: int) -> Any:
        good = {"pto_force": (0.0, 0.0), "dc_power": (0.0, 0.0)}
        if tick < tick_of_fault:
            return sense(composed(rig), axis_sense(0), axis_sense(0), **good)
        sensors = {name: readings.get(name, value) for name, value in good.items()}
        axes = [axis_sense(0)._replace(**readings.get(name, {})) for name in ("heave", "pitch")]
        given = sense(composed(rig), *axes, **sensors)
        return given._replace(panel=readings.get("panel", given.panel))

    rows = run(rig, bounds, read, ticks=800)
    stopped = next(row for row in rows if row.safety.reason != Reason.NONE)
    assert stopped.tick - tick_of_fault <= 1
    assert composed(rig).KIND.reason_table.name(stopped.safety.reason) == reason
    assert all(row.safety.mode > RUN for row in rows if row.tick > stopped.tick)


def test_a_body_that_moves_during_the_tare_stops_the_rig() -> None:
    rig, bounds = one_axis()

    def read(tick: int) -> Any:
        counts = round(0.03 * math.sin(0.02 * tick) / PER_COUNT)
        return sense(composed(rig), axis_sense(counts), pto_force=(0.0, 0.0), dc_power=(0.0, 0.0))

    reasons = {row.safety.reason for row in run(rig, bounds, read, ticks=190)}
    assert reasons == {Reason.NONE, Reason.NOT_CALM}


def test_composed_source_is_that_of_the_parts() -> None:
    rig, _ = two_axes()
    module = composed(rig)
    source = inspect.getsource(module)
    assert "law_of_pitch.step(" in source
    assert "AXIS" not in source
    assert "SENSOR" not in source
    assert composed(rig) is module
    other = rig.model_copy(update={"sensors": {}, "stations": {}})
    assert composed(other) is not module


def test_composition_survives_the_way_to_the_loop_process() -> None:
    kind = find_kind("")
    default = Composition.default()
    assert find_kind(default.to_text()).row_type is compose(default).Row
    assert kind.row_type is compose(default).Row
    assert Composition.from_text(default.to_text()) == default


def test_compiled_tick_has_the_bits_of_the_interpreted_one() -> None:
    """Numba compiles the composed module as it stands; law memory and rows agree to the bit."""
    rig, bounds = two_axes()
    module = composed(rig)
    own = params(rig, bounds, measuring(TARE_TICKS, 600), **GAINS)

    def read(tick: int) -> Any:
        heave, pitch = round(swing(tick) / PER_COUNT), round(-2.0 * swing(tick) / PITCH_PER_COUNT)
        return sense(
            module,
            axis_sense(heave),
            axis_sense(pitch),
            pto_force=(3.0, 0.0),
            dc_power=(-float(tick), 0.0),
        )

    interpreted = run(rig, bounds, read, 600)
    compiled, state = compiled_step(module), cycle.start(module.KIND, own, 0)
    currents = dict.fromkeys(rig.axes, 0.0)
    for tick, row in enumerate(interpreted):
        given = follow(read(tick), currents)
        state, command, repeated = compiled(own, state, given, NO_REQUEST, tick, NO_TIMING, 1, DT)
        currents = {name: getattr(command, name).current for name in rig.axes}
        assert lifting.flatten(repeated) == lifting.flatten(row)


def compiled_step(module: Any) -> Any:
    """Return the compiled cycle of a composed module."""
    from numba import njit

    from controllers import biquads, blocks, estimator, impedance, open_loop, signal_generator
    from rig.realtime import assessment, axis, limits, paired_rows, safety, sequence, student

    laws = (biquads, blocks, estimator, impedance, open_loop, signal_generator)
    loop = (student, paired_rows, assessment, axis, limits, safety, sequence)
    lifting.lift((*laws, *loop, module))
    return njit(error_model="numpy")(cycle.make(module.KIND))


@pytest.mark.parametrize(
    "name", ["tick", "power", "plan", "Heave", "a__b", "x_", "heave_force", "class"]
)
def test_names_that_a_log_row_cannot_have_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="name"):
        RigFile.model_validate(rig_mapping(sensors={name: FORCE}, stations={}))


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("pto_force * surge_velocity", "no signal 'surge_velocity'"),
        ("pto_force / heave_velocity", "write"),
        ("__import__('os')", "no signal|write"),
        ("pto_force *", "invalid syntax"),
    ],
)
def test_station_over_what_is_not_there_is_refused(formula: str, message: str) -> None:
    stations = {"mechanical": {"formula": formula}}
    with pytest.raises(ValueError, match=message):
        RigFile.model_validate(rig_mapping(stations=stations))
