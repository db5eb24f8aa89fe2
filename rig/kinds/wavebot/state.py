"""What a WaveBot's cycle is given for a run, and what it remembers from tick to tick."""

import math
from enum import IntEnum
from typing import NamedTuple

from controllers import (
    drive_gating,
    impedance,
    magnetic_spring,
    open_loop,
    position_hold,
    station_keeping,
)
from controllers.signals import AxisSense, DriveCommand, DriveSettings, Gains
from rig.kinds.wavebot import stations, tare
from rig.kinds.wavebot.signals import Setpoints
from rig.realtime import axis, power


class SurgeUse(IntEnum):
    """What is done with the surge axis."""

    OFF = 0  # its drive stays off, the mooring holds it
    STATION_KEEPING = 1
    HOLD = 2  # held where it is


# Plain ints for the tick, as in `rig.realtime.safety`.
SURGE_OFF, SURGE_KEPT, SURGE_HELD = (int(use) for use in SurgeUse)


class ReferenceAxis(IntEnum):
    """Which axis the open-loop reference pushes."""

    HEAVE = 0
    SURGE = 1


REFERENCE_SURGE = int(ReferenceAxis.SURGE)


class Limits(NamedTuple):
    """Limits of what is not an axis."""

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
    heave_law: impedance.Params
    reference: open_loop.Params
    reference_axis: int  # `ReferenceAxis`: what the reference pushes
    gate: drive_gating.Params  # of the heave drive
    modulation: int  # `Modulation` of the heave drive
    surge: axis.Params
    surge_use: int  # `SurgeUse`
    station_keeping: station_keeping.Params
    surge_hold: position_hold.Params
    spring: magnetic_spring.Params
    limits: Limits
    stations: stations.Params
    setpoints: Setpoints


class ActiveSetpoint(NamedTuple):
    """The set point in use, as the words that the tick needs."""

    setpoint: int  # its index, -1: none yet
    gains: Gains
    surge: Gains
    reference_scale: float
    realisation: int
    spring_rate: float  # N/m
    stroke: float  # m
    drive: DriveCommand


# Memory of the laws; it starts afresh whenever they do not act.
Laws = tuple[
    impedance.State,
    open_loop.State,
    drive_gating.State,
    station_keeping.State,
    position_hold.State,
]


class State(NamedTuple):
    """Memory of a WaveBot run."""

    heave: axis.State
    laws: Laws
    surge: axis.State
    spring: magnetic_spring.State
    tare: tare.State
    power: power.Power
    stations: stations.State
    active_setpoint: ActiveSetpoint


def laws_at_rest(params: Params) -> Laws:
    """The laws' memory before they act."""
    return (
        impedance.start(params.heave_law.sections),
        open_loop.start(),
        drive_gating.start(),
        station_keeping.start(),
        position_hold.start(),
    )


def start(params: Params) -> State:
    """State before the first tick."""
    none = Gains(0.0, 0.0, 0.0)
    resting = DriveCommand(1, DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0))
    return State(
        axis.start(),
        laws_at_rest(params),
        axis.start(),
        magnetic_spring.start(),
        tare.start(),
        power.start(),
        stations.start(),
        ActiveSetpoint(-1, none, none, 0.0, 0, 0.0, math.inf, resting),
    )


def zeros(params: Params, state: State, heave: AxisSense, surge: AxisSense) -> tuple[float, float]:
    """The zeros of heave and surge in use (m in the encoder's frame), at first where they stand."""
    tared = state.tare
    if tared.seeded == 1:
        zeros = tared.zeros
        return zeros.position, zeros.surge
    return (
        heave.counts * params.heave.metres_per_count,
        surge.counts * params.surge.metres_per_count,
    )


def hold(params: Params, setpoint: int) -> ActiveSetpoint:
    """The set point of an index, made once and used until the next one."""
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
        Gains(table.kp[setpoint], table.ki[setpoint], table.km[setpoint]),
        Gains(table.surge_kp[setpoint], table.surge_ki[setpoint], 0.0),
        table.reference_scale[setpoint],
        table.realisation[setpoint],
        table.spring_rate[setpoint],
        table.stroke[setpoint],
        DriveCommand(1, settings),
    )
