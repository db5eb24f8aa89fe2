"""One powered axis, from encoder counts to motion and from a demand to the granted command.

The rig kind chooses the control law; the behaviour in a stop is the same for every axis. For a
rotary axis read rad for m and N*m for N.
"""

from typing import NamedTuple

from controllers import estimator
from controllers.blocks import fade_step
from controllers.signals import AxisCommand, AxisSense, Demand, Estimate, Flag
from rig.realtime import limits
from rig.realtime.safety import OFF, RUN, STOP_1, STOP_2

NO_DEMAND = Demand(0.0, 0.0, 0.0, 0.0)
UNINITIALISED = -1  # demand source before the first counts
_INFINITE_AGE = 1e9  # s, greater than any real age
_MAX_DELAY = 1.0  # s; counts delayed as long carry no information about the motion
_GAP_DECAY_TIME = 0.05  # s, time constant with which the sample gap decays


class Params(NamedTuple):
    """Constants of one axis."""

    metres_per_count: float  # signed: counts that grow when the body rises give a positive scale
    estimator: estimator.Params
    limits: limits.AxisLimits
    stop_damping: float  # N*s/m, > 0: damping of the body during a stop
    stop_ramp: float  # s, time to fade from the force of the run to that of the damping


class State(NamedTuple):
    """Memory of one axis."""

    motion: Estimate
    limits: limits.AxisState
    demand_source: int  # of the last tick: RUN law, STOP_1 damping, OFF none, UNINITIALISED
    fade_force: float  # N, force when the demand source last changed
    fade_share: float  # 1 .. 0, share of `fade_force` that is still in the demand
    saturation_deficit: float  # N, granted less demanded force of the last tick
    encoder_age: float  # s, age of the counts in the last tick
    min_age: float  # s, least age of any counts so far; older counts were delayed by the excess
    sample_gap: float  # ticks between new counts, the recent maximum (decays)
    mismatch_ticks: int  # ticks with a wrong drive current: `rig.realtime.limits.mismatch_ticks`


class Record(NamedTuple):
    """The fields that one axis adds to a log row."""

    sense: AxisSense
    estimate: Estimate
    demand: Demand
    command: AxisCommand
    warned: Flag  # set of `rig.realtime.limits.WarningFlag`


def start() -> State:
    """Return the state at switch-on."""
    rest = Estimate(0.0, 0.0, 0.0)
    return State(rest, limits.start(), UNINITIALISED, 0.0, 0.0, 0.0, 0.0, _INFINITE_AGE, 1.0, 0)


def observe(
    params: Params, state: State, sense: AxisSense, zero: float, periods: int, dt: float
) -> Estimate:
    """Return the motion from this tick's counts, relative to the tared ``zero``.

    ``zero`` is in m in the encoder's own frame.

    Counts whose age grew by the elapsed time are the counts of the tick before: taken as new, they
    would make the body appear at rest. New counts older than ``min_age`` were delayed on the wire:
    taken as current, they would look like a jump of the body.
    """
    counts, age, _, _, _, _ = sense
    motion, _, demand_source, _, _, _, previous_age, min_age, sample_gap, _ = state
    measured = counts * params.metres_per_count - zero
    if demand_source == UNINITIALISED:
        return Estimate(measured, 0.0, 0.0)
    if age == previous_age == min_age and sample_gap == 1.0:  # same result as `track`, but faster
        return estimator.step(params.estimator, motion, measured, periods, dt)
    sample_gap = recent_sample_gap(state, age, dt)
    return track(
        params.estimator, motion, measured, previous_age, age, min_age, sample_gap, periods, dt
    )


def recent_sample_gap(state: State, age: float, dt: float) -> float:
    """Return the recent maximum of the ticks between new counts; at least 1.

    ``age`` (s) of the counts of this tick. The maximum decays slowly: estimator gains that changed
    with every gap would excite oscillations of their own.
    """
    waited = state.encoder_age - age  # s; negative while the counts repeat
    if state.demand_source == UNINITIALISED or (waited == 0.0 and state.sample_gap == 1.0):
        return 1.0
    sample_gap = state.sample_gap - state.sample_gap * dt / _GAP_DECAY_TIME
    if waited > 0.0:
        sample_gap = max(sample_gap, 1.0 + min(waited, _MAX_DELAY) / dt)
    return max(sample_gap, 1.0)


def track(
    params: estimator.Params,
    motion: Estimate,
    measured: float,
    previous_age: float,
    age: float,
    min_age: float,
    sample_gap: float,
    periods: int,
    dt: float,
) -> Estimate:
    """Return the motion corrected by ``measured`` (m), or only predicted if that is not new.

    ``age`` (s) of ``measured``; ``previous_age`` of the value of the last tick; ``min_age``: age of
    a value without delay, for which the estimate holds; ``sample_gap``: see `recent_sample_gap`.
    """
    delay = age - min_age
    if age > previous_age + 0.5 * periods * dt or delay >= _MAX_DELAY:
        return estimator.predict(motion, periods, dt)
    if sample_gap > 1.0:
        params = estimator.stretch_gains(params, sample_gap)
    if delay > 0.0:
        return estimator.step_late(params, motion, measured, delay, periods, dt)
    return estimator.step(params, motion, measured, periods, dt)


def check(
    params: Params, state: State, sense: AxisSense, motion: Estimate, zero: float, mode: int
) -> int:
    """Return the first trip reason of this axis, or Reason.NONE; ``zero`` as in `observe`."""
    measured = sense.counts * params.metres_per_count - zero
    delay = sense.encoder_age - state.min_age
    if delay > 0.0:  # extrapolate to the present position of the body
        measured = measured + delay * (motion.velocity - 0.5 * delay * motion.acceleration)
    return limits.check_axis(
        params.limits, state.limits, state.mismatch_ticks, sense, measured, motion, mode
    )


def rezero(state: State, shift: float) -> State:
    """Return the state relative to a zero that has moved up by ``shift`` (m)."""
    (x, v, a), limited, source, fade_force, fade, deficit, age, min_age, gap, mismatch = state
    moved = Estimate(x - shift, v, a)
    return State(moved, limited, source, fade_force, fade, deficit, age, min_age, gap, mismatch)


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
    """Return the demand and the granted command: of the law in RUN, of the damping in a stop.

    A change between the two is bumpless: the force fades over from the last one granted.
    ``conducting`` 0: the drive's power stage rests, and no force is granted in RUN; ``saturated``
    1: the drive reports that it cannot supply all of its current.
    """
    _, limited, previous_source, fade_force, fade, _, previous_age, min_age, gap, mismatch = state
    mismatch = limits.mismatch_ticks(params.limits, limited, mismatch, sense, saturated, mode)
    source = RUN if mode == RUN else STOP_1 if STOP_2 <= mode <= STOP_1 else OFF
    if source != previous_source:
        fade_force, fade = limited.force, 1.0
    if source == STOP_1:
        damping = params.stop_damping
        demand, conducting = Demand(-damping, 0.0, 0.0, -damping * motion.velocity), 1
    elif source != RUN:
        demand, fade = NO_DEMAND, 0.0
    if fade > 0.0:
        fade = fade_step(fade, params.stop_ramp, dt)
        kp, ki, km, force = demand
        demand = Demand(kp, ki, km, force + fade * (fade_force - force))
    granted, command = limits.grant(params.limits, limited, demand.force, conducting, mode, dt)
    # Exactly zero when the demand was granted in full.
    deficit = command.force - demand.force if command.limited != 0 else 0.0
    age = sense.encoder_age
    if age != previous_age or age < min_age or gap != 1.0:  # otherwise both are unchanged
        min_age, gap = min(min_age, age), recent_sample_gap(state, age, dt)
    after = State(motion, granted, source, fade_force, fade, deficit, age, min_age, gap, mismatch)
    return after, Record(sense, motion, demand, command, limits.warn_axis(params.limits, motion))
