"""Damping that grows with the displacement: F = -(c0 + c1 |x|) v + reference."""

from typing import NamedTuple

from controllers.blocks import Ramp, clamp, ramp_start, ramp_step
from controllers.law import Column, Parameter
from controllers.signals import Demand

COLUMNS = (
    Column("c0_n_s_per_m", "c0", "N*s/m", "c0", 0.0, 20_000.0, "Damping at the zero."),
    Column("c1_n_s_per_m2", "c1", "N*s/m^2", "c1", 0.0, 1e6, "Increase of the damping with |x|."),
)

PARAMETERS = (Parameter("max_force_n", "N", 1.0, 1e5, "Greatest damping force.", (4000.0,)),)


class SetPoint(NamedTuple):
    c0: float
    c1: float


class Params(NamedTuple):
    ramp: float  # s, time that a change of a coefficient takes
    max_force: float  # N


class State(NamedTuple):
    c0: Ramp
    c1: Ramp


def params(settings, ramp, dt):
    return Params(ramp, settings["max_force_n"][0])


def start(params):
    return State(ramp_start(0.0), ramp_start(0.0))


def step(params, state, setpoint, motion, reference, deficit, dt):
    c0 = ramp_step(state.c0, setpoint.c0, params.ramp, dt)
    c1 = ramp_step(state.c1, setpoint.c1, params.ramp, dt)
    distance = motion.position if motion.position > 0.0 else -motion.position
    damping = c0.value + c1.value * distance
    force = clamp(-damping * motion.velocity, -params.max_force, params.max_force)
    return State(c0, c1), Demand(-damping, 0.0, 0.0, force + reference)
