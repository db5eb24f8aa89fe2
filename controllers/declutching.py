"""Declutching: no force for a while from each turning point, then a damper.

    declutched    F = reference                    for a time t_d from each turning point
    engaged       F = Kp v + reference             (N, force on the body)

A body whose natural period is longer than that of the waves moves too late. Without the force of
the take-off it gathers speed sooner (Babarit, Guglielmi and Clement, Ocean Engineering 36 (2009)
1015).

In a sinusoidal motion of velocity amplitude V and period T the mean absorbed power is

    -Kp V^2 ( 1/2 - t_d / T + sin(4 pi t_d / T) / (4 pi) )       for t_d <= T / 2

``t_d = 0`` is a plain damper. Kp is ramped, from zero at the start. The force jumps to Kp v where
the damper engages, as fast as the limits allow.

Bad input: a motion that is not finite gives a force that is not finite, which the limits turn into
a stop.
"""

from typing import NamedTuple

from controllers import turning_point
from controllers.blocks import Ramp, finite, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import (
    Demand,
    Estimate,
    Flag,
    MetrePerSecond,
    Newton,
    NewtonSecondPerMetre,
    Second,
)

COLUMNS = (
    Column("kp_n_s_per_m", "kp", "N*s/m", "Kp", -20_000.0, 0.0,
           "Velocity gain while the damper is engaged; Kp < 0 absorbs."),
    Column("declutch_s", "declutch", "s", "declutching time", 0.0, 10.0,
           "How long there is no force from each turning point on; 0: never."),
)  # fmt: skip

PARAMETERS = (
    Parameter("arming_speed_m_per_s", "m/s", 1e-4, 1.0,
              "Speed to exceed before the next turning point counts.", (0.02,)),
)  # fmt: skip


class SetPoint(NamedTuple):
    """The set point of a row."""

    kp: NewtonSecondPerMetre
    declutch: Second


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time that a change of Kp takes
    arming_speed: MetrePerSecond


class State(NamedTuple):
    """The state of the damper: disengaged or not, and since when."""

    kp: Ramp
    turning: turning_point.State
    declutched: Flag
    clock: Second  # since the damper was disengaged


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants."""
    return Params(ramp, settings["arming_speed_m_per_s"][0])


def start(params: Params) -> State:
    """State at switch-on: engaged, Kp zero."""
    return State(ramp_start(0.0), turning_point.start(), 0, 0.0)


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: Newton,
    deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Return the state and the force on the body (N) for the measured velocity."""
    velocity = motion.velocity
    kp, turning, declutched, clock = state
    kp = ramp_step(kp, setpoint.kp, params.ramp, dt)
    turning, turned = turning_point.step(turning, velocity, params.arming_speed)
    clock = clock + dt
    if turned == 1 and setpoint.declutch > 0.5 * dt:
        declutched, clock = 1, 0.0
    elif declutched == 1 and clock > setpoint.declutch - 0.5 * dt:
        declutched = 0
    after = State(kp, turning, declutched, clock)
    if declutched == 1 and finite(velocity):
        return after, Demand(0.0, 0.0, 0.0, reference)
    return after, Demand(kp.value, 0.0, 0.0, kp.value * velocity + reference)
