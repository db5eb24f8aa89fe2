"""One powered axis: encoder -> motion, a law's demand -> granted command.

Which law asks is the rig kind's matter; what happens in a stop is the same for every axis. For an
axis that turns read rad for m and N*m for N.
"""

from typing import NamedTuple

from controllers import estimator
from controllers.blocks import clamp
from controllers.signals import AxisCommand, AxisSense, Demand, Estimate, Flag
from rig.realtime import limits
from rig.realtime.safety import OFF, RUN, STOP_1, STOP_2

NOTHING = Demand(0.0, 0.0, 0.0, 0.0)
UNSEEN = -1  # no count was seen yet
_ANY = 1e9  # s, more than any age
_OLD = 1.0  # s, counts that are as late tell nothing of the motion
_APART = 1.5  # ticks between values, beyond which the filter must be slower
_MEMORY = 0.05  # s, of how far apart they have been


class Params(NamedTuple):
    """Constants of one axis."""

    metres_per_count: float  # signed: counts that grow when the body rises give a positive scale
    estimator: estimator.Params
    limits: limits.AxisLimits
    stop_damping: float  # N*s/m, > 0: what holds the body while it is brought to a stop
    stop_ramp: float  # s, time from the force of the run to that of the damping


class State(NamedTuple):
    """Memory of one axis."""

    motion: Estimate
    limits: limits.AxisState
    acting: int  # what made the last demand: RUN the law, STOP_1 a stop, OFF nothing; or UNSEEN
    fade_from: float  # N, force at the last change of that
    fade: float  # 1 .. 0, share of that force still in the demand
    saturation_deficit: float  # N, what was granted in the last tick less what was asked
    age: float  # s, of the counts in the last tick
    min_age: float  # s, the least age that counts ever had: what is older came late
    sample_gap: float  # ticks between new counts, the most of late
    mismatch: int  # ticks of a current that disagrees: `rig.realtime.limits.mismatch_ticks`


class Record(NamedTuple):
    """What one axis adds to a log row."""

    sense: AxisSense
    estimate: Estimate
    demand: Demand
    command: AxisCommand
    warned: Flag  # set of `rig.realtime.limits.Warned`


def start() -> State:
    """State at switch-on."""
    rest = Estimate(0.0, 0.0, 0.0)
    return State(rest, limits.start(), UNSEEN, 0.0, 0.0, 0.0, 0.0, _ANY, 1.0, 0)


def observe(
    params: Params, state: State, sense: AxisSense, zero: float, periods: int, dt: float
) -> Estimate:
    """Motion from this tick's counts, relative to the tared zero (m in the encoder's own frame).

    Counts that are as much older as time has gone on are the same as before: taken for new they
    would look like a body that stands. New ones that are older than they usually are were held up
    on the wire: taken for those of now they would look like a jump.
    """
    counts, age, _, _, _, _ = sense
    motion, _, acting, _, _, _, before, usual, apart, _ = state
    measured = counts * params.metres_per_count - zero
    if acting == UNSEEN:
        return Estimate(measured, 0.0, 0.0)
    if age == before == usual and apart == 1.0:  # the usual tick: what `track` would do, sooner
        return estimator.step(params.estimator, motion, measured, periods, dt)
    apart = recent_sample_gap(state, age, dt)
    return track(params.estimator, motion, measured, before, age, usual, apart, periods, dt)


def recent_sample_gap(state: State, age: float, dt: float) -> float:
    """How many ticks new counts have lain apart at most, of late; at least 1.

    ``age`` (s) of the counts of this tick. It is forgotten slowly: gains that changed with every
    gap would swing up by themselves.
    """
    waited = state.age - age  # s; below 0 while the counts are the same as before
    if state.acting == UNSEEN or (waited == 0.0 and state.sample_gap == 1.0):
        return 1.0
    apart = state.sample_gap - state.sample_gap * dt / _MEMORY
    if waited > 0.0:
        apart = max(apart, 1.0 + min(waited, _OLD) / dt)
    return max(apart, 1.0)


def track(
    params: estimator.Params,
    motion: Estimate,
    measured: float,
    age_before: float,
    age: float,
    min_age: float,
    sample_gap: float,
    periods: int,
    dt: float,
) -> Estimate:
    """The motion before, corrected by ``measured`` (m) unless that is the old value.

    ``age`` (s) of ``measured``, ``age_before`` of the value of the last tick, ``usual``: the age
    that a value has without delay, to which the motion belongs; ``apart``: as `apart_of_late`.
    """
    late = age - min_age
    if age > age_before + 0.5 * periods * dt or late >= _OLD:
        return estimator.predict(motion, periods, dt)
    if sample_gap > _APART:
        params = estimator.stretched(params, sample_gap)
    if late > 0.0:
        return estimator.step_late(params, motion, measured, late, periods, dt)
    return estimator.step(params, motion, measured, periods, dt)


def check(
    params: Params, state: State, sense: AxisSense, motion: Estimate, zero: float, mode: int
) -> int:
    """The first reason to trip on this axis, or Reason.NONE; ``zero`` as in `observe`."""
    measured = sense.counts * params.metres_per_count - zero
    late = sense.encoder_age - state.min_age
    if late > 0.0:  # where the body is by now
        measured = measured + late * (motion.velocity - 0.5 * late * motion.acceleration)
    return limits.check_axis(
        params.limits, state.limits, state.mismatch, sense, measured, motion, mode
    )


def rezero(state: State, by: float) -> State:
    """The same motion seen from a zero that has moved up by ``by`` (m)."""
    (x, v, a), bounded, acting, fade_from, fade, short, age, usual, apart, mismatch = state
    moved = Estimate(x - by, v, a)
    return State(moved, bounded, acting, fade_from, fade, short, age, usual, apart, mismatch)


def control(
    params: Params,
    state: State,
    sense: AxisSense,
    motion: Estimate,
    demand: Demand,
    conducting: int,
    saturated: int,
    mode: int,
    dt: float,
) -> tuple[State, Record]:
    """Demand and granted command for this tick: what the law wants in RUN, damping in a stop.

    A change between the two is bumpless: the force fades over from the last one granted.
    ``conducting`` 0: the drive's power stage rests, and no force is granted in RUN; ``saturated``
    1: the drive reports that it cannot give all of its current.
    """
    _, bounded, before, fade_from, fade, _, age_before, usual, apart, mismatch = state
    mismatch = limits.mismatch_ticks(params.limits, bounded, mismatch, sense, saturated, mode)
    acting = RUN if mode == RUN else STOP_1 if STOP_2 <= mode <= STOP_1 else OFF
    if acting != before:
        fade_from, fade = bounded.force, 1.0
    if acting == STOP_1:
        damping = params.stop_damping
        demand, conducting = Demand(-damping, 0.0, 0.0, -damping * motion.velocity), 1
    elif acting != RUN:
        demand, fade = NOTHING, 0.0
    if fade > 0.0:
        fade = fade - dt / params.stop_ramp if params.stop_ramp > dt else 0.0
        fade = clamp(fade, 0.0, 1.0)
        kp, ki, km, force = demand
        demand = Demand(kp, ki, km, force + fade * (fade_from - force))
    granted, command = limits.grant(params.limits, bounded, demand.force, conducting, mode, dt)
    # Granted in full, nothing is short.
    short = command.force - demand.force if command.limited != 0 else 0.0
    age = sense.encoder_age
    if age != age_before or age < usual or apart != 1.0:  # else both are what they were
        usual, apart = min(usual, age), recent_sample_gap(state, age, dt)
    after = State(motion, granted, acting, fade_from, fade, short, age, usual, apart, mismatch)
    return after, Record(sense, motion, demand, command, limits.warn_axis(params.limits, motion))
