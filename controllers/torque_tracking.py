"""Torque control of the OSWEC's driveline: feed-forward current, and feedback.

Open loop: the current for a torque, by the torque constant of its direction (OSWEC
thesis (University of Washington), section 3.1.2: clockwise and counter-clockwise constants differ),

    i = T_w / K(sign T_w)                                              (A)

Closed loop on the load cell, because the same constants vary by a tenth from ramp to ramp (ibid.):

    T_w = T + P e + I,    e = T - T_m,    I' = G e + deficit / TRACKING

An authority bounds I and the whole feedback. The deficit (``saturation_deficit``) is the granted
less the demanded torque of the previous tick: back-calculation, so that the integral does not
wind up (Astrom and Hagglund, Advanced PID Control, section 3.5).

Bad input: NaN or infinity in either torque gives a demand that is not finite, which the limits
turn into a stop; such a value stays in the integral until the law starts afresh.
"""

from typing import NamedTuple

from controllers.blocks import clamp
from controllers.signals import Ampere, NewtonMetre, Ratio

TRACKING = 0.1  # s; a hundred ticks, so that a slew limit at a start hardly affects the integral


class Params(NamedTuple):
    """Constants of the law; with both gains 0 the law is open-loop."""

    positive: float  # N*m/A, K for currents above zero
    negative: float  # N*m/A, K for currents below zero
    proportional: Ratio  # P >= 0
    integral: float  # 1/s, G >= 0
    authority: NewtonMetre  # >= 0, bound of the feedback in both directions


class State(NamedTuple):
    """Memory of the feedback."""

    integral: NewtonMetre


class TorqueDemand(NamedTuple):
    """Demand of the law."""

    torque: NewtonMetre  # reference plus feedback
    current: Ampere


def start() -> State:
    """Return the state at switch-on."""
    return State(0.0)


def current(params: Params, torque: NewtonMetre) -> Ampere:
    """Return the current for a torque, by the constant of its direction."""
    return torque / (params.positive if torque > 0.0 else params.negative)


def torque(params: Params, current: Ampere) -> NewtonMetre:
    """Return the torque of a current, by the constant of its direction."""
    return current * (params.positive if current > 0.0 else params.negative)


def step(
    params: Params,
    state: State,
    reference: NewtonMetre,
    measured: NewtonMetre,
    saturation_deficit: NewtonMetre,
    dt: float,
) -> tuple[State, TorqueDemand]:
    """Return the demand for a reference torque on the shaft and the measured one."""
    _, _, proportional, gain, authority = params
    feedback = integral = 0.0
    if proportional != 0.0 or gain != 0.0:
        error = reference - measured
        integral = state.integral + dt * (gain * error + saturation_deficit / TRACKING)
        integral = clamp(integral, -authority, authority)
        feedback = clamp(proportional * error + integral, -authority, authority)
    demanded = reference + feedback
    return State(integral), TorqueDemand(demanded, current(params, demanded))
