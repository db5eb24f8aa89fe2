"""One powered axis: encoder -> motion, gains -> demand -> granted command."""

from typing import NamedTuple

from controllers import estimator, impedance
from controllers.blocks import ramp_start
from controllers.signals import AxisCommand, AxisSense, Demand, Estimate, Gains
from rig import limits
from rig.safety import RUN, STOP_1, STOP_2


class Params(NamedTuple):
    """Constants of one axis."""

    estimator: estimator.Params
    law: impedance.Params
    limits: limits.AxisLimits
    stop_damping: float  # N*s/m, > 0: what holds the body while it is brought to a stop
    stop_ramp: float  # s, time from the gains of the run to that damping


class State(NamedTuple):
    """Memory of one axis."""

    estimator: estimator.State
    law: impedance.State
    limits: limits.AxisState
    stopping: int  # 1: the law's gains were last set by a stop


class Record(NamedTuple):
    """What one axis adds to a log row."""

    sense: AxisSense
    estimate: Estimate
    demand: Demand
    command: AxisCommand


def start() -> State:
    """State at switch-on."""
    return State(estimator.start(), impedance.start(), limits.start(), 0)


class Seen(NamedTuple):
    """What this tick's counts say."""

    estimator: estimator.State
    motion: Estimate


def observe(
    params: Params, state: State, sense: AxisSense, zero: float, periods: int, dt: float
) -> Seen:
    """Motion from this tick's counts, relative to the tared zero (m)."""
    tracked = estimator.step(params.estimator, state.estimator, sense.counts, periods, dt)
    return Seen(tracked, estimator.estimate(tracked, zero))


def control(
    params: Params, state: State, gains: Gains, seen: Seen, mode: int, dt: float
) -> tuple[State, Demand, AxisCommand]:
    """Demand and granted command for this tick: the set gains in RUN, damping in a stop.

    With the power off the law starts afresh, so a later start ramps its gains up from zero.
    """
    motion, law = seen.motion, state.law
    stopping = 1 if mode in (STOP_1, STOP_2) else 0
    if stopping != state.stopping:
        # A ramp keeps its pace while its target stays: a stop must not inherit that of the run.
        law = impedance.State(ramp_start(law.kp.value), ramp_start(law.ki.value))
    if mode == RUN:
        law, demand = impedance.step(params.law, law, gains, motion, dt)
    elif stopping == 1:
        held = Gains(-params.stop_damping, 0.0)
        quick = impedance.Params(params.stop_ramp)
        law, demand = impedance.step(quick, law, held, motion, dt)
    else:
        law, demand = impedance.start(), Demand(0.0, 0.0, 0.0)
    granted, command = limits.grant(params.limits, state.limits, demand.force, mode, dt)
    return State(seen.estimator, law, granted, stopping), demand, command
