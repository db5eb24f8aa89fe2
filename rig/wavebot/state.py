"""What a WaveBot's cycle is given for a run, and what it remembers from tick to tick."""

from typing import NamedTuple

from controllers import impedance, magnetic_spring
from controllers.signals import DriveCommand, DriveSettings, Gains
from rig import axis, power, tare
from rig.wavebot.words import Setpoints


class Limits(NamedTuple):
    """Limits of what is not an axis."""

    string_pot_difference_stop: float  # m
    rotor_travel_stop: float  # m
    metres_per_radian: float  # of the rotor
    bus_voltage_stop: float  # V
    stator_age_stop: float  # s
    load_cell_age_stop: float  # s
    analyser_age_stop: float  # s
    tare_span_stop: float  # m


class Params(NamedTuple):
    """Constants of a WaveBot run."""

    heave: axis.Params
    heave_law: impedance.Params
    surge: axis.Params
    surge_law: impedance.Params
    surge_on: int  # 1: the surge drive is used; 0: it stays off
    spring: magnetic_spring.Params
    modulation: int  # `Modulation` of the custom drive
    limits: Limits
    setpoints: Setpoints


class Held(NamedTuple):
    """The set point in use, as the words that the tick needs."""

    setpoint: int  # its index, -1: none yet
    gains: Gains
    surge: Gains
    reference_scale: float
    spring_rate: float  # N/m
    stroke: float  # m
    drive: DriveCommand


class State(NamedTuple):
    """Memory of a WaveBot run."""

    heave: axis.State
    heave_law: impedance.State
    surge: axis.State
    surge_law: impedance.State
    spring: magnetic_spring.State
    tare: tare.State
    power: power.Power
    held: Held


def start() -> State:
    """State before the first tick."""
    none = Gains(0.0, 0.0, 0.0)
    resting = DriveCommand(1, DriveSettings(0, 0.0, 0.0, 0.0, 0.0, 0))
    return State(
        axis.start(),
        impedance.start(),
        axis.start(),
        impedance.start(),
        magnetic_spring.start(),
        tare.start(),
        power.start(),
        Held(-1, none, none, 0.0, 0.0, 0.0, resting),
    )


def hold(params: Params, setpoint: int) -> Held:
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
    return Held(
        setpoint,
        Gains(table.kp[setpoint], table.ki[setpoint], table.km[setpoint]),
        Gains(table.surge_kp[setpoint], table.surge_ki[setpoint], 0.0),
        table.reference_scale[setpoint],
        table.spring_rate[setpoint],
        table.stroke[setpoint],
        DriveCommand(1, settings),
    )
