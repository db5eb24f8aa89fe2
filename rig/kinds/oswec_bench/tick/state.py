"""Parameters of the bench's cycle for a run, and its state from tick to tick."""

from typing import NamedTuple

from controllers import brake_damping, estimator, oswec_position, torque_tracking
from controllers.signals import Estimate
from rig.kinds.oswec_bench.tick import manual, speed, stations, tare
from rig.kinds.oswec_bench.tick.signals import EncoderSense, Setpoints
from rig.realtime import axis, motor_power


class ShaftParams(NamedTuple):
    """The encoder behind the coupling."""

    radians_per_count: float
    estimator: estimator.Params


class Homing(NamedTuple):
    """Return of the shaft to its zero between rows, in the velocity loop."""

    rate: float  # 1/s, velocity over remaining angle
    max_velocity: float  # rad/s


class LoadLimits(NamedTuple):
    """Range of the load cell, both directions."""

    lateral: float  # N, fx and fy
    axial: float  # N, fz
    bending: float  # N*m, tx and ty
    torsion: float  # N*m, tz


class Limits(NamedTuple):
    """Limits of everything but the motor."""

    slip_stop: float  # rad between motor and shaft
    shaft_jump_stop: float  # rad, between measurement and estimate
    load_stop: LoadLimits
    load_age_stop: float  # s
    brake_difference_stop: float  # A, between command and measured current of the brake
    brake_ticks_stop: int  # consecutive ticks that the difference may last
    velocity_difference_stop: float  # rad/s, between the motor's velocity and its command
    velocity_ticks_stop: int  # ticks that the difference may last
    brake_age_stop: float  # s
    panel_age_stop: float  # s
    tare_span_stop: float  # rad


class Params(NamedTuple):
    """Constants of a bench run; the motor is a rotating axis: rad for m, N*m for N."""

    mode: int  # `DriveMode`
    motor: axis.Params
    shaft: ShaftParams
    speed: speed.Params
    homing: Homing
    position_feedback: (
        float  # 1/s, gain from the motor's angle error to the velocity command; 0: free drift
    )
    position: oswec_position.Params
    torque: torque_tracking.Params
    brake: brake_damping.Params
    manual: manual.Params
    locked: int  # 1: the shaft is clamped
    limits: Limits
    motor_power: motor_power.Params
    setpoints: Setpoints


class ShaftState(NamedTuple):
    """Memory of the shaft's estimate."""

    motion: Estimate
    age: float  # s, age of the counts in the last tick


class BrakeState(NamedTuple):
    """The brake's last command, and for how long the brake has not followed it."""

    command: brake_damping.BrakeState
    mismatch_ticks: int  # consecutive ticks


class Laws(NamedTuple):
    """Memory of the laws; it is reset whenever they do not act."""

    position: oswec_position.State
    torque: torque_tracking.State
    manual: manual.State


class State(NamedTuple):
    """Memory of a bench run."""

    motor: axis.State
    shaft: ShaftState
    speed: speed.State
    laws: Laws
    brake: BrakeState
    mismatch: int  # ticks in which the velocity disagrees with its command
    power: stations.Power
    motor_power: motor_power.State
    tare: tare.State


LAWS_AT_REST = Laws(oswec_position.start(), torque_tracking.start(), manual.start())


def start(params: Params) -> State:
    """Return the state before the first tick."""
    return State(
        axis.start(),
        ShaftState(Estimate(0.0, 0.0, 0.0), 0.0),
        speed.start(),
        LAWS_AT_REST,
        BrakeState(brake_damping.start(), 0),
        0,
        stations.start(),
        motor_power.start(),
        tare.start(),
    )


def zeros_in_use(params: Params, state: State, encoders: EncoderSense) -> tuple[float, float]:
    """Return the zeros of motor and shaft, rad in their encoders' frames.

    Before there are zeros, the present angles take their place.
    """
    tare_state = state.tare
    if tare_state.seeded == 1:
        return tare_state.zeros.motor, tare_state.zeros.shaft
    return encoder_angles(params, encoders)


def encoder_angles(params: Params, encoders: EncoderSense) -> tuple[float, float]:
    """Return the angles of motor and shaft, rad in the encoders' own frames."""
    return (
        encoders.motor_counts * params.motor.metres_per_count,
        encoders.shaft_counts * params.shaft.radians_per_count,
    )
