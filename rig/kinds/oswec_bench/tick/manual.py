"""Manual mode of the bench: velocity or torque that people choose, ramped.

It needs no wave clock. In the velocity loop, with the motor's angle x, its goal g, a signal s on
the angle, a velocity u (a jog, and a signal on the velocity) and the end E of the range of motion:

    v = h + ds/dt + u        h = clamp(rate (g + s - x), -speed, speed)    (rad/s)
    v <= min(END_RATE d, sqrt(a d)),  d = E - x - LAG m    and likewise below

a is the limit of acceleration: braking by the square root takes half of it, and by END_RATE, below
the speed at which the two meet, at most all of it. While people choose a velocity, m is the one
that a drive with the time constant LAG would have, which turns by LAG m after a demand of zero; so
a drive that lags by less ends there, too. Else m is zero: a goal bounds the way.

h returns the motor to its goal as homing does between rows, so that drift does not add up. (By the
shaft's angle it would excite the resonance of the coupling with a heavy flap behind it.) While
people choose a velocity, it goes to zero. In the torque loop the torque is

    T = t + s - R v_f                                                      (N*m)

t and R (the motor's damping), u and the amplitude of s take the ramp's duration to a new value, and
the rate of change of h is bounded, so that h does not overshoot. A signal on another quantity waits
until the amplitude is zero.
"""

from math import sqrt
from typing import NamedTuple

from controllers import signal_generator
from controllers.blocks import Ramp, clamp, ramp_start, ramp_step
from controllers.signals import Radian, RadianPerSecond, Second

END_RATE = 15.0
"""Velocity over the angle that is left to the end of the range of motion, 1/s."""

LAG = 0.1
"""Time constant of the slowest drive that a velocity does not take past the end, s."""

_LEAST_SPEED = 0.01  # rad/s

ANGLE, VELOCITY, TORQUE = range(3)


class Params(NamedTuple):
    """Constants of manual mode."""

    ramp: Second  # duration of a change
    end: Radian  # E, either way
    homing_rate: float  # 1/s, velocity over remaining angle
    homing_change: float  # 1/s, rate of change of h over its speed; twice the rate or more
    acceleration: float  # rad/s^2, a


class SetPoint(NamedTuple):
    """A set point that people choose; in the torque loop only the last three act."""

    angle: float  # rad, g
    speed: float  # rad/s, >= 0; 0: the shaft does not return to its goal
    velocity: float  # rad/s, of a jog
    torque: float  # N*m
    quantity: float  # of the signal: ANGLE, VELOCITY or TORQUE
    signal: signal_generator.SetPoint  # of the unit of its quantity


Columns = tuple[tuple[float, ...], ...]
"""A column for each number of the set points, those of the signal last."""

AT_REST = SetPoint(0.0, 0.0, 0.0, 0.0, 0.0, signal_generator.NO_SIGNAL)


class State(NamedTuple):
    """Memory from tick to tick."""

    generator: signal_generator.State
    quantity: float  # of the signal that acts
    value: float  # of the signal, in the last tick
    homing: RadianPerSecond  # h
    lagging: RadianPerSecond  # m
    velocity: Ramp
    torque: Ramp
    damping: Ramp


class Demand(NamedTuple):
    """The demand on the drive."""

    angle: Radian  # g + s
    velocity: RadianPerSecond
    torque: float  # N*m, without that of the damping
    damping: float  # N*m*s/rad, R


NO_DEMAND = Demand(0.0, 0.0, 0.0, 0.0)


def start() -> State:
    """Return the state at rest."""
    at_rest = ramp_start(0.0)
    return State(signal_generator.start(), 0.0, 0.0, 0.0, 0.0, at_rest, at_rest, at_rest)


def excites(state: State) -> bool:
    """Return whether the motor's torque is more than that of its damping."""
    return state.torque.value != 0.0 or state.generator.amplitude.value != 0.0


def columns(set_points: tuple[SetPoint, ...]) -> Columns:
    """Return the columns of set points."""
    return tuple(zip(*((*each[:-1], *each.signal) for each in set_points), strict=True))


def set_point(table: Columns, i: int) -> SetPoint:
    """Return a set point of a table."""
    signal = signal_generator.SetPoint(
        table[5][i], table[6][i], table[7][i], table[8][i], table[9][i]
    )
    return SetPoint(table[0][i], table[1][i], table[2][i], table[3][i], table[4][i], signal)


def step(
    params: Params, state: State, chosen: SetPoint, damping: float, angle: Radian, dt: float
) -> tuple[State, Demand]:
    """Return the demand; ``damping``: R that people choose, N*m*s/rad; ``angle``: of the motor."""
    generator, quantity, last, homing, lagging, jog, torque, damping_ramp = state
    ramp, end, rate, quickness, acceleration = params
    signal, value = chosen.signal, 0.0
    if quantity != chosen.quantity:
        if generator.amplitude.value == 0.0:
            quantity, last = chosen.quantity, 0.0
        else:
            signal = signal_generator.SetPoint(
                signal.kind, 0.0, signal.frequency, signal.end_frequency, signal.sweep
            )
    rests = signal_generator.at_rest(generator, signal)
    if not rests:
        generator, value = signal_generator.step(
            signal_generator.Params(ramp), generator, signal, dt
        )
    jog = ramp_step(jog, chosen.velocity, ramp, dt)
    torque = ramp_step(torque, chosen.torque, ramp, dt)
    damping_ramp = ramp_step(damping_ramp, damping, ramp, dt)

    goal, velocity, home = chosen.angle, jog.value, 0.0
    turns = jog.value != 0.0 or chosen.velocity != 0.0
    if quantity == ANGLE:
        goal = goal + value
        velocity = velocity + (value - last) / dt
    elif quantity == VELOCITY:
        velocity = velocity + value
        turns = turns or not rests
    if not turns:
        home = clamp(rate * (goal - angle), -chosen.speed, chosen.speed)
    change = quickness * dt * max(chosen.speed, abs(homing), _LEAST_SPEED)
    homing = clamp(home, homing - change, homing + change)
    velocity = velocity + homing
    ahead = angle + LAG * lagging if turns else angle
    highest = _stopping_speed(end - ahead, acceleration)
    lowest = -_stopping_speed(end + ahead, acceleration)
    velocity = clamp(velocity, lowest, highest)
    lagging = lagging + (velocity - lagging) * dt / LAG
    total_torque = torque.value + value if quantity == TORQUE else torque.value
    after = State(generator, quantity, value, homing, lagging, jog, torque, damping_ramp)
    return after, Demand(goal, velocity, total_torque, damping_ramp.value)


def _stopping_speed(distance: Radian, acceleration: float) -> RadianPerSecond:
    """Return the highest speed at a distance from an end, >= 0."""
    return min(END_RATE * distance, sqrt(acceleration * distance)) if distance > 0.0 else 0.0
