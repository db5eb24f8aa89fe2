"""Latching: hold the body at each turning point for a while, then let it go.

    free       F = Kp v + reference                      (N, force on the body)
    latched    F = -K (x - x_l) - D v + reference        for a time t_l from each turning point

A body whose natural period is shorter than that of the waves moves too early. Holding it still at
its turning points delays it until its velocity is in phase with the excitation; for a lightly
damped body the best time is half the difference of the wave period and the natural period (Budal
and Falnes 1975; Babarit and Clement, Applied Ocean Research 28 (2006) 77).

The drive itself holds the body: a stiff spring to the position x_l of the turning point, and a
damper. Its force is zero where the latch closes; where the latch opens the force falls to that of
the damper Kp v, as fast as the limits allow.

``t_l = 0`` never latches: the law is then a plain damper. Kp is ramped, from zero at the start. If
the limits grant less than the latch demands, the body creeps and the spring pulls it back to x_l.

Bad input: a motion that is not finite gives a force that is not finite, which the limits turn into
a stop.
"""

from typing import NamedTuple

from controllers import turning_point
from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import (
    Demand,
    Estimate,
    Flag,
    Metre,
    MetrePerSecond,
    Newton,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Second,
)

COLUMNS = (
    Column("kp_n_s_per_m", "kp", "N*s/m", "Kp", -20_000.0, 0.0,
           "Velocity gain while the body is free; Kp < 0 absorbs."),
    Column("latch_s", "latch", "s", "latching time", 0.0, 10.0,
           "How long the body is held at each turning point; 0: never."),
)  # fmt: skip

PARAMETERS = (
    Parameter("hold_stiffness_n_per_m", "N/m", 1.0, 1e7,
              "Stiffness that holds the latched body; as stiff as the loop stays stable."),
    Parameter("hold_damping_n_s_per_m", "N*s/m", 0.0, 1e6, "Damping of the latched body."),
    Parameter("arming_speed_m_per_s", "m/s", 1e-4, 1.0,
              "Speed to exceed before the next turning point counts.", (0.02,)),
)  # fmt: skip


class SetPoint(NamedTuple):
    """The set point of a row."""

    kp: NewtonSecondPerMetre
    latch: Second


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time that a change of Kp takes
    stiffness: NewtonPerMetre  # K > 0
    damping: NewtonSecondPerMetre  # D >= 0
    arming_speed: MetrePerSecond


class State(NamedTuple):
    """The state of the latch: on or off, since when, and the held position."""

    kp: Ramp
    turning: turning_point.State
    latched: Flag
    clock: Second  # since the latch closed
    position: Metre  # x_l


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants."""
    return Params(
        ramp,
        settings["hold_stiffness_n_per_m"][0],
        settings["hold_damping_n_s_per_m"][0],
        settings["arming_speed_m_per_s"][0],
    )


def start(params: Params) -> State:
    """State at switch-on: free, Kp zero."""
    return State(ramp_start(0.0), turning_point.start(), 0, 0.0, 0.0)


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: Newton,
    deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Return the state and the force on the body (N) for the measured motion."""
    position, velocity, _ = motion
    kp, turning, latched, clock, anchor = state
    kp = ramp_step(kp, setpoint.kp, params.ramp, dt)
    if latched == 1:
        clock = clock + dt
        if clock > setpoint.latch - 0.5 * dt:
            latched = 0
    else:
        turning, turned = turning_point.step(turning, velocity, params.arming_speed)
        if turned == 1 and setpoint.latch > 0.5 * dt:
            latched, clock, anchor = 1, 0.0, position
    after = State(kp, turning, latched, clock, anchor)
    if latched == 1:
        force = -params.stiffness * (position - anchor) - params.damping * velocity
        return after, Demand(-params.damping, -params.stiffness, 0.0, force + reference)
    return after, Demand(kp.value, 0.0, 0.0, kp.value * velocity + reference)
