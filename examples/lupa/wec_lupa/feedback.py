"""LUPA's feedback: F = -(K x_f + C v_f), with filtered position and velocity.

Positive stiffness K and damping C resist the motion, so reactive control has K < 0. Position and
its difference quotient pass a notch at 50 Hz (10 Hz wide) and a Butterworth low-pass of second
order at 10 Hz, which delay the force by 23 ms at wave frequencies (4.2 degrees at 0.5 Hz). The rig
turns the force into the current I = F r / Kt of the drive, and limits it.

Source: the public Simulink model of LUPA (github.com/PMEC-OSU/LUPA, Apache-2.0), version 9.147; its
coefficients at 1 kHz are those of `low_pass` here.
"""

import math
from typing import NamedTuple

from controllers import biquads
from controllers.biquads import Biquad, SectionState
from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate

COLUMNS = (
    Column("stiffness_n_per_m", "stiffness", "N/m", "K", -10_000.0, 10_000.0,
           "Stiffness against the displacement; K < 0 acts as a negative spring.", default=0.0),
    Column("damping_n_s_per_m", "damping", "N*s/m", "C", 0.0, 10_000.0,
           "Damping against the velocity; C > 0 absorbs."),
)  # fmt: skip

PARAMETERS = (
    Parameter("low_pass_hz", "Hz", 0.5, 200.0, "Corner of the low-pass.", (10.0,)),
    Parameter("notch_hz", "Hz", 1.0, 200.0, "Frequency that is filtered out.", (50.0,)),
    Parameter("notch_width_hz", "Hz", 0.1, 100.0, "Width of the notch at -3 dB.", (10.0,)),
)


class SetPoint(NamedTuple):
    """Gains of a row."""

    stiffness: float  # N/m
    damping: float  # N*s/m


class Params(NamedTuple):
    """Constants of a run."""

    ramp: float  # s, time that a change of a gain takes
    notch: Biquad
    low_pass: Biquad
    period: float  # s, of a tick, for which the filters hold


class State(NamedTuple):
    """Memory from tick to tick."""

    stiffness: Ramp
    damping: Ramp
    started: int  # 1: there is a position of the tick before
    position: float  # m, of the tick before
    position_filters: tuple[SectionState, SectionState]
    velocity_filters: tuple[SectionState, SectionState]


def low_pass(corner: float, dt: float) -> Biquad:
    """Return a Butterworth low-pass of second order, by the bilinear transform; Hz, s."""
    warped = math.tan(math.pi * corner * dt)
    norm = 1.0 / (1.0 + math.sqrt(2.0) * warped + warped * warped)
    gain = warped * warped * norm
    return Biquad(
        gain,
        2.0 * gain,
        gain,
        2.0 * (warped * warped - 1.0) * norm,
        (1.0 - math.sqrt(2.0) * warped + warped * warped) * norm,
    )


def notch(frequency: float, width: float, dt: float) -> Biquad:
    """Return a notch, by the bilinear transform; Hz, Hz at -3 dB, s."""
    centre = math.cos(2.0 * math.pi * frequency * dt)
    half = math.tan(math.pi * width * dt)
    norm = 1.0 / (1.0 + half)
    return Biquad(norm, -2.0 * centre * norm, norm, -2.0 * centre * norm, (1.0 - half) * norm)


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants; ValueError if a filter is too fast for the period ``dt`` (s)."""
    highest = 0.4 / dt
    for key in ("low_pass_hz", "notch_hz"):
        if not settings[key][0] < highest:
            raise ValueError(f"{key} {settings[key][0]:g} Hz is too fast; allowed < {highest:g} Hz")
    return Params(
        ramp,
        notch(settings["notch_hz"][0], settings["notch_width_hz"][0], dt),
        low_pass(settings["low_pass_hz"][0], dt),
        dt,
    )


def start(params: Params) -> State:
    """Return the memory before the first tick."""
    empty = (SectionState(0.0, 0.0), SectionState(0.0, 0.0))
    return State(ramp_start(0.0), ramp_start(0.0), 0, 0.0, empty, empty)


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: float,
    deficit: float,
    dt: float,
) -> tuple[State, Demand]:
    """Return the memory and the force on the body after one tick."""
    stiffness = ramp_step(state.stiffness, setpoint.stiffness, params.ramp, dt)
    damping = ramp_step(state.damping, setpoint.damping, params.ramp, dt)
    velocity = 0.0
    if state.started == 1:
        velocity = (motion.position - state.position) / dt
    filters = (params.notch, params.low_pass)
    position_filters, x = biquads.step(filters, state.position_filters, motion.position)
    velocity_filters, v = biquads.step(filters, state.velocity_filters, velocity)
    force = -(stiffness.value * x + damping.value * v)
    after = State(stiffness, damping, 1, motion.position, position_filters, velocity_filters)
    return after, Demand(-damping.value, -stiffness.value, 0.0, force + reference)


def linear(params: Params, setpoint: SetPoint, omega: float) -> complex:
    """Return force per velocity (N*s/m) at ``omega`` > 0 (rad/s); the velocity is a difference."""
    angle = omega * params.period
    filtered = biquads.response((params.notch, params.low_pass), angle)
    difference = complex(1.0 - math.cos(angle), math.sin(angle)) / complex(0.0, angle)
    spring = setpoint.stiffness / complex(0.0, omega)
    return -(spring + setpoint.damping * difference) * filtered
