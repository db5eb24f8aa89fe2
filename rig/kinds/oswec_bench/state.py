"""What the bench's cycle is given for a run, and what it remembers from tick to tick."""

from typing import NamedTuple

from controllers import brake_damping, estimator, oswec_position, torque_tracking
from controllers.oswec_position import Component, Span
from controllers.signals import Estimate
from rig.kinds.oswec_bench import speed, stations, tare
from rig.kinds.oswec_bench.signals import NO_FLUME, EncoderSense, Flume, Setpoints
from rig.realtime import axis


class ShaftParams(NamedTuple):
    """The encoder behind the coupling."""

    radians_per_count: float
    estimator: estimator.Params


class Homing(NamedTuple):
    """How the velocity loop brings the shaft back to its zero between rows."""

    rate: float  # 1/s: of the way that is left
    most: float  # rad/s


class LoadLimits(NamedTuple):
    """Range of the load cell, either way."""

    across: float  # N, fx and fy
    along: float  # N, fz
    bending: float  # N*m, tx and ty
    twisting: float  # N*m, tz


class Limits(NamedTuple):
    """Limits of what is not the motor's own."""

    slip_stop: float  # rad between motor and shaft
    shaft_jump_stop: float  # rad, between what was measured and what the estimate says
    load_stop: LoadLimits
    load_age_stop: float  # s
    brake_difference_stop: float  # A, between what the brake was told and what it has
    brake_ticks_stop: int  # ticks in a row it may be so
    velocity_difference_stop: float  # rad/s, between the motor's velocity and its command
    velocity_ticks_stop: int  # ticks that the difference may last
    brake_age_stop: float  # s
    panel_age_stop: float  # s
    tare_span_stop: float  # rad


class Params(NamedTuple):
    """Constants of a bench run; the motor is an axis that turns: rad for m, N*m for N."""

    mode: int  # `DriveMode`
    motor: axis.Params
    shaft: ShaftParams
    speed: speed.Params
    homing: Homing
    feedback: float  # 1/s, from the motor's angle to the velocity command; 0: it may drift
    position: oswec_position.Params
    torque: torque_tracking.Params
    brake: brake_damping.Params
    locked: int  # 1: the shaft is clamped
    limits: Limits
    stations: stations.Params
    setpoints: Setpoints


class ShaftState(NamedTuple):
    """Memory of the shaft's estimate."""

    motion: Estimate
    age: float  # s, of the counts in the last tick


class BrakeState(NamedTuple):
    """What the brake was told, and since when it has not obeyed."""

    told: brake_damping.Braked
    mismatch_ticks: int  # ticks in a row


class Laws(NamedTuple):
    """Memory of the laws; it starts afresh whenever they do not act."""

    position: oswec_position.State
    torque: torque_tracking.State


class ActiveSetpoint(NamedTuple):
    """The set point in use."""

    setpoint: int  # its index, -1: none yet
    components: tuple[Component, ...]
    span: Span
    damping: float  # N*m*s/rad
    brake_current: float  # A
    flume: Flume


class State(NamedTuple):
    """Memory of a bench run."""

    motor: axis.State
    shaft: ShaftState
    speed: speed.State
    laws: Laws
    brake: BrakeState
    mismatch: int  # ticks of a velocity that disagrees with its command, as those of a current
    stations: stations.State
    tare: tare.State
    active_setpoint: ActiveSetpoint


LAWS_AT_REST = Laws(oswec_position.start(), torque_tracking.start())


def start(params: Params) -> State:
    """State before the first tick."""
    return State(
        axis.start(),
        ShaftState(Estimate(0.0, 0.0, 0.0), 0.0),
        speed.start(),
        LAWS_AT_REST,
        BrakeState(brake_damping.start(), 0),
        0,
        stations.start(),
        tare.start(),
        ActiveSetpoint(-1, (), Span(0.0, 0.0), 0.0, 0.0, NO_FLUME),
    )


def hold(table: Setpoints, setpoint: int) -> ActiveSetpoint:
    """The set point of an index, made once and used until the next one."""
    return ActiveSetpoint(
        setpoint,
        table.components[setpoint],
        Span(table.rise[setpoint], table.until[setpoint]),
        table.damping[setpoint],
        table.brake_current[setpoint],
        table.flume[setpoint],
    )


def zeros(params: Params, state: State, encoders: EncoderSense) -> tuple[float, float]:
    """The zeros of motor and shaft in use (rad in their encoders' frames), at first their own."""
    tared = state.tare
    if tared.seeded == 1:
        return tared.zeros.motor, tared.zeros.shaft
    return angles(params, encoders)


def angles(params: Params, encoders: EncoderSense) -> tuple[float, float]:
    """What the counts of motor and shaft say, rad in the encoders' own frames."""
    return (
        encoders.motor_counts * params.motor.metres_per_count,
        encoders.shaft_counts * params.shaft.radians_per_count,
    )
