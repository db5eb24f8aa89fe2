"""The parameters of a WaveBot's cycle for a run, and its state from tick to tick."""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from controllers import (
    drive_gating,
    magnetic_spring,
    open_loop,
    position_hold,
    signal_generator,
    station_keeping,
)
from controllers.signal_generator import NO_SIGNAL
from controllers.signals import AxisSense, DriveCommand, DriveSettings, Gains
from rig.kinds.wavebot.tick import power_checks, stations, tare
from rig.kinds.wavebot.tick.signals import Setpoints
from rig.realtime import axis


class SurgeUse(IntEnum):
    """The use of the surge axis in a campaign."""

    OFF = 0  # its drive stays off, the mooring holds it
    STATION_KEEPING = 1
    HOLD = 2  # held where it is


# Plain ints for the tick, as in `rig.realtime.safety`.
SURGE_OFF, SURGE_STATION_KEEPING, SURGE_HOLD = (int(use) for use in SurgeUse)


class ReferenceAxis(IntEnum):
    """The axis that the open-loop reference excites."""

    HEAVE = 0
    SURGE = 1


REFERENCE_SURGE = int(ReferenceAxis.SURGE)


class Limits(NamedTuple):
    """Limits of all but the axes."""

    string_pot_difference_stop: float  # m
    rotor_travel_stop: float  # m
    metres_per_radian: float  # of the rotor
    bus_voltage_stop: float  # V
    stator_age_stop: float  # s
    load_cell_age_stop: float  # s
    analyser_age_stop: float  # s
    panel_age_stop: float  # s
    tare_span_stop: float  # m


class Params(NamedTuple):
    """Constants of a WaveBot run."""

    heave: axis.Params
    heave_law: Any  # the heave law's own Params
    reference: open_loop.Params
    reference_axis: int  # `ReferenceAxis`: the axis that the reference excites
    gate: drive_gating.Params  # of the heave drive
    modulation: int  # `Modulation` of the heave drive
    surge: axis.Params
    surge_use: int  # `SurgeUse`
    station_keeping: station_keeping.Params
    surge_hold: position_hold.Params
    spring: magnetic_spring.Params
    limits: Limits
    power_checks: power_checks.Params
    setpoints: Setpoints


class ActiveSetpoint(NamedTuple):
    """The set point in use, as the signals that the tick needs."""

    setpoint: int  # its index, -1: none yet
    law: Any  # the heave law's own SetPoint
    surge: Gains
    reference_scale: float
    realisation: int
    spring_rate: float  # N/m
    stroke: float  # m
    drive: DriveCommand
    signal: signal_generator.SetPoint


# State of the laws; it is reset whenever they do not act.
Laws = tuple[
    Any,  # the heave law's own State
    open_loop.State,
    signal_generator.State,
    drive_gating.State,
    station_keeping.State,
    position_hold.State,
]


class State(NamedTuple):
    """State of a WaveBot run."""

    heave: axis.State
    laws: Laws
    surge: axis.State
    spring: magnetic_spring.State
    tare: tare.State
    power: stations.Power
    power_checks: power_checks.State
    active_setpoint: ActiveSetpoint


def zeros_in_use(
    params: Params, state: State, heave: AxisSense, surge: AxisSense
) -> tuple[float, float]:
    """Return the zeros of heave and surge in use, in m in the encoders' frames.

    Before the first tick they are the present positions.
    """
    tare_state = state.tare
    if tare_state.seeded == 1:
        zeros = tare_state.zeros
        return zeros.position, zeros.surge
    return (
        heave.counts * params.heave.metres_per_count,
        surge.counts * params.surge.metres_per_count,
    )


class LawFunctions(NamedTuple):
    """The functions of a WaveBot's cycle that depend on its heave law."""

    start: Callable[[Params], State]  # state before the first tick
    laws_at_rest: Callable[[Params], Laws]  # state of all laws before they act
    load_setpoint: Callable[[Params, int], ActiveSetpoint]  # the set point of an index


def _setpoint_reader(set_point: Any) -> Callable[[Any, int], Any]:
    """Return the function ``(columns, i) -> SetPoint`` of a law; a column per field, in order.

    It is generated from the fields: a loop over them costs time in the tick, and compiled code has
    none. The columns are a plain tuple: compiled code on disk refers to a type by its name, and a
    generated type has none by which a later process would find that code.
    """
    values = ", ".join(f"columns[{place}][i]" for place in range(len(set_point._fields)))
    names: dict[str, Any] = {"SetPoint": set_point}
    exec(f"def read_setpoint(columns, i):\n    return SetPoint({values})\n", names)
    reader: Callable[[Any, int], Any] = names["read_setpoint"]
    return reader


def law_functions(law: Any) -> LawFunctions:
    """Return the functions for a law's module.

    They are closures, so that the tick and compiled code call the law directly. A set point is
    built once and used until the index changes.
    """
    start_law, read_setpoint = law.start, _setpoint_reader(law.SetPoint)
    read_signal = _setpoint_reader(signal_generator.SetPoint)
    initial_setpoint = law.SetPoint(*(0.0 for _ in law.COLUMNS))

    def laws_at_rest(params: Params) -> Laws:
        return (
            start_law(params.heave_law),
            open_loop.start(),
            signal_generator.start(),
            drive_gating.start(),
            station_keeping.start(),
            position_hold.start(),
        )

    def start(params: Params) -> State:
        none = Gains(0.0, 0.0, 0.0)
        resting = DriveCommand(1, DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0))
        return State(
            axis.start(),
            laws_at_rest(params),
            axis.start(),
            magnetic_spring.start(),
            tare.start(),
            stations.start(),
            power_checks.start(),
            ActiveSetpoint(-1, initial_setpoint, none, 0.0, 0, 0.0, math.inf, resting, NO_SIGNAL),
        )

    def load_setpoint(params: Params, setpoint: int) -> ActiveSetpoint:
        table = params.setpoints
        settings = DriveSettings(
            params.modulation,
            table.bus_voltage[setpoint],
            table.switching_period[setpoint],
            table.hysteresis_tolerance[setpoint],
            table.velocity_threshold[setpoint],
            table.discharge_level[setpoint],
        )
        return ActiveSetpoint(
            setpoint,
            read_setpoint(table.law, setpoint),
            Gains(table.surge_kp[setpoint], table.surge_ki[setpoint], 0.0),
            table.reference_scale[setpoint],
            table.realisation[setpoint],
            table.spring_rate[setpoint],
            table.stroke[setpoint],
            DriveCommand(1, settings),
            read_signal(table.signal, setpoint),
        )

    return LawFunctions(start, laws_at_rest, load_setpoint)
