"""One powered axis: encoder -> motion, gains -> demand -> granted command."""

from typing import NamedTuple

from controllers import estimator, impedance
from controllers.signals import AxisCommand, AxisSense, Demand, Estimate, Flag, Gains
from rig import limits
from rig.safety import CATEGORY, FINE, RUN, STOP_1, STOP_2, Reason


class Params(NamedTuple):
    """Constants of one axis."""

    metres_per_count: float  # signed: counts that grow when the body rises give a positive scale
    estimator: estimator.Params
    law: impedance.Params
    limits: limits.AxisLimits
    stop_damping: float  # N*s/m, > 0: what holds the body while it is brought to a stop
    stop_ramp: float  # s, time from the gains of the run to that damping


class State(NamedTuple):
    """Memory of one axis."""

    motion: Estimate
    seeded: int  # 1 once a count was seen
    law: impedance.State
    limits: limits.AxisState
    stopping: int  # 1: the law's gains were last set by a stop


class Record(NamedTuple):
    """What one axis adds to a log row."""

    sense: AxisSense
    estimate: Estimate
    demand: Demand
    command: AxisCommand
    warned: Flag  # set of `rig.limits.Warned`


def start() -> State:
    """State at switch-on."""
    return State(Estimate(0.0, 0.0, 0.0), 0, impedance.start(), limits.start(), 0)


def observe(
    params: Params, state: State, sense: AxisSense, zero: float, periods: int, dt: float
) -> Estimate:
    """Motion from this tick's counts, relative to the tared zero (m in the encoder's own frame)."""
    measured = sense.counts * params.metres_per_count - zero
    if state.seeded == 0:
        return Estimate(measured, 0.0, 0.0)
    return estimator.step(params.estimator, state.motion, measured, periods, dt)


def check(
    params: Params, state: State, sense: AxisSense, motion: Estimate, zero: float, mode: int
) -> int:
    """The first reason to trip on this axis, or Reason.NONE; ``zero`` as in `observe`.

    A jump of the counts looks like a velocity to the estimator, and damping would push against
    it: so it is caught before anything else acts on the motion.
    """
    reason = limits.check_axis(params.limits, state.limits, sense, motion, mode)
    if reason == FINE or CATEGORY[reason] != 0:
        most = params.limits.encoder_jump_stop
        jump = sense.counts * params.metres_per_count - zero - motion.position
        if not -most <= jump <= most:
            return Reason.ENCODER_JUMP.value
    return reason


def rezero(state: State, by: float) -> State:
    """The same motion seen from a zero that has moved up by ``by`` (m)."""
    x, v, a = state.motion
    return State(Estimate(x - by, v, a), state.seeded, state.law, state.limits, state.stopping)


def control(
    params: Params,
    state: State,
    sense: AxisSense,
    motion: Estimate,
    gains: Gains,
    mode: int,
    dt: float,
) -> tuple[State, Record]:
    """Demand and granted command for this tick: the set gains in RUN, damping in a stop.

    With the power off the law starts afresh, so a later start ramps its gains up from zero.
    """
    law = state.law
    stopping = 1 if STOP_2 <= mode <= STOP_1 else 0
    if stopping != state.stopping:
        # A ramp keeps its pace while its target stays: a stop must not inherit that of the run.
        law = impedance.rest(law)
    if mode == RUN:
        law, demand = impedance.step(params.law, law, gains, motion, 0.0, 0.0, dt)
    elif stopping == 1:
        held = Gains(-params.stop_damping, 0.0, 0.0)
        quick = impedance.Params(params.stop_ramp, params.law.sections, 0.0)
        law, demand = impedance.step(quick, law, held, motion, 0.0, 0.0, dt)
    else:
        law, demand = impedance.start(params.law.sections), Demand(0.0, 0.0, 0.0, 0.0)
    granted, command = limits.grant(params.limits, state.limits, demand.force, mode, dt)
    warned = limits.warn_axis(params.limits, motion)
    return (
        State(motion, 1, law, granted, stopping),
        Record(sense, motion, demand, command, warned),
    )
