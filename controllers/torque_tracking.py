"""Torque control of the OSWEC's driveline: current from the measured constant, and feedback.

Open loop: the current for a torque of either direction by that direction's own constant (OSWEC
thesis (University of Washington), section 3.1.2: clockwise and counter-clockwise constants differ),

    i = T_w / K(sign T_w)                                              (A)

Closed loop on the load cell, for the same constants spread by a tenth from ramp to ramp (ibid.):

    T_w = T + P e + I,    e = T - T_m,    I' = G e + short / TRACKING

P, I and with them the whole feedback are bounded by an authority. ``short`` is what the limits
granted less what was asked in the tick before: back-calculation, so that the integral does not
wind up (Astrom and Hagglund, Advanced PID Control, section 3.5).

Bad input: NaN or infinity in either torque gives a demand that is not finite, which the limits
turn into a stop; in the integral it stays until the law starts afresh.
"""

from typing import NamedTuple

from controllers.blocks import clamp
from controllers.signals import Ampere, NewtonMetre, Ratio

TRACKING = 0.1  # s; a hundred ticks, so that a slew limit at a start hardly touches the integral


class Params(NamedTuple):
    """Constants of the law; with both gains 0 it is the open loop."""

    positive: float  # N*m/A, K of currents above zero
    negative: float  # N*m/A, K of currents below zero
    proportional: Ratio  # P >= 0
    integral: float  # 1/s, G >= 0
    authority: NewtonMetre  # >= 0, most of the feedback either way


class State(NamedTuple):
    """Memory of the feedback."""

    integral: NewtonMetre


class Drawn(NamedTuple):
    """What the law asks for."""

    torque: NewtonMetre  # wanted and feedback
    current: Ampere


def start() -> State:
    """State at switch-on."""
    return State(0.0)


def current(params: Params, torque: NewtonMetre) -> Ampere:
    """Current for a torque, by the constant of its direction."""
    return torque / (params.positive if torque > 0.0 else params.negative)


def torque(params: Params, current: Ampere) -> NewtonMetre:
    """Torque of a current, by the constant of its direction."""
    return current * (params.positive if current > 0.0 else params.negative)


def step(
    params: Params,
    state: State,
    reference: NewtonMetre,
    measured: NewtonMetre,
    saturation_deficit: NewtonMetre,
    dt: float,
) -> tuple[State, Drawn]:
    """Torque and current for a wanted torque on the shaft and the measured one."""
    _, _, proportional, gain, most = params
    feedback = integral = 0.0
    if proportional != 0.0 or gain != 0.0:
        error = reference - measured
        integral = state.integral + dt * (gain * error + saturation_deficit / TRACKING)
        integral = clamp(integral, -most, most)
        feedback = clamp(proportional * error + integral, -most, most)
    asked = reference + feedback
    return State(integral), Drawn(asked, current(params, asked))
