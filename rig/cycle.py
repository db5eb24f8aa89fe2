"""The cycle: sense -> estimate -> control -> limit -> actuate -> log, as one pure function.

`make` composes it from the functions of one kind of rig (its axes, its other devices); the order
of the stages is said here and nowhere else. A tick either ends in a valid command or in a stop.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from controllers.signals import Count, Index, Second
from rig import safety, sequence
from rig.safety import FINE, RUN, STOP_2, Reason


class Params(NamedTuple):
    """Constants of a run."""

    segments: sequence.Segments
    safety: safety.Params
    lost_ticks_stop: int  # more periods than this in one gap trip
    rig: Any  # the kind's own Params


class State(NamedTuple):
    """Memory of the cycle."""

    sequence: sequence.State
    safety: safety.State
    waves_since: int  # tick in which the wave maker was started; -1: it stands
    rig: Any  # the kind's own State


class Timing(NamedTuple):
    """When a tick really ran; all zero on a virtual clock."""

    lateness: Second  # wake-up after the planned time
    work: Second  # duration of the tick before
    skipped: Count  # periods lost since the run began


class PlanRecord(NamedTuple):
    """Where the campaign stands."""

    row: Index  # row id, -1: none
    phase: Index  # `rig.sequence.Phase`
    attempt: Index  # times a hold made the row start over
    wave_clock: Second  # since the wave maker was started; -1 while it stands


class Kind(NamedTuple):
    """The functions that make one kind of rig; each is pure.

    ``start(params) -> state`` before the first tick
    ``observe(params, state, sense, periods, dt) -> motion`` of every axis
    ``ready(params, state, sense) -> set of sequence.WAIT_ flags that hold``
    ``check(params, state, sense, motion, mode) -> reason``
    ``control(params, state, sense, motion, plan, safety, setpoint, dt) -> state, command, words``,
    ``setpoint`` an index into the kind's table of set points
    ``row(tick, time, timing, plan, safety, sense, command, words) -> row``
    """

    row_type: type
    params_type: type
    start: Callable[[Any], Any]
    observe: Callable[..., Any]
    ready: Callable[..., int]
    check: Callable[..., int]
    control: Callable[..., Any]
    row: Callable[..., Any]


Step = Callable[..., tuple[State, Any, Any]]


def start(kind: Kind, params: Params, tick: int) -> State:
    """State before the first tick."""
    return State(sequence.start(tick), safety.start(tick), -1, kind.start(params.rig))


def make(kind: Kind) -> Step:
    """The cycle of one kind of rig.

    ``step(params, state, sense, request, tick, timing, periods, dt) -> state, command, row``:
    ``request`` is what people or the supervisor asked through the mailbox, ``periods`` the ticks
    since the last call (1 unless some were lost), ``dt`` the period in seconds.
    """
    observe, ready, check = kind.observe, kind.ready, kind.check
    control, make_row = kind.control, kind.row

    def step(
        params: Params,
        state: State,
        sense: Any,
        request: int,
        tick: int,
        timing: Timing,
        periods: int,
        dt: float,
    ) -> tuple[State, Any, Any]:
        rig_params, rig = params.rig, state.rig
        motion = observe(rig_params, rig, sense, periods, dt)

        # The plan moves on what held until now; the safety machine then has the last word.
        segments = params.segments
        mode = state.safety.mode
        holds = ready(rig_params, rig, sense)
        place, walk = sequence.step(
            segments, state.sequence, tick, holds, mode <= RUN, mode == STOP_2
        )
        i = place.segment
        trip = check(rig_params, rig, sense, motion, mode)
        if periods > params.lost_ticks_stop:  # allows no controlled stop, so it goes first
            trip = Reason.LOST_TICKS.value
        if trip == FINE and walk.late:
            stator_there = (holds & sequence.WAIT_STATOR) != 0
            trip = (Reason.DRIVE_NOT_ON if stator_there else Reason.STATOR_LATE).value
        guard = safety.step(
            params.safety,
            state.safety,
            tick,
            trip,
            request,
            walk.finished,
            segments.drive[i] == 1,
            (holds & sequence.WAIT_DRIVE) != 0,
        )

        waves = segments.waves[i] if guard.mode <= STOP_2 else 0
        since = state.waves_since
        if waves == 0:
            since = -1
        elif since < 0:
            since = tick
        clock = -1.0 if since < 0 else (tick - since) * dt
        plan = PlanRecord(segments.row[i], segments.phase[i], place.attempt, clock)
        rig, command, words = control(
            rig_params, rig, sense, motion, plan, guard, segments.setpoint[i], dt
        )
        row = make_row(tick, tick * dt, timing, plan, guard, sense, command, words)
        return State(place, guard, since, rig), command, row

    return step
