"""The cycle: sense -> estimate -> control -> limit -> actuate -> log, as one pure function.

`make` composes it from the functions of one kind of rig (its axes, its other devices); the order
of the stages is said here and nowhere else. A tick either ends in a valid command or in a stop.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from controllers.signals import Count, Index, Second
from rig.realtime import safety, sequence
from rig.realtime.safety import FINE, RUN, STOP_2, Reason


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
    phase: Index  # `rig.realtime.sequence.Phase`
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
        segments, guard_params, most_lost, rig_params = params
        place, guard, since, rig = state
        motion = observe(rig_params, rig, sense, periods, dt)

        # The plan moves on what held until now; the safety machine then has the last word.
        # What holds is asked only where something waits for it: a drive to come on, or the plan.
        mode = guard.mode
        waits = mode < RUN or segments.wait[place.segment] != 0
        holds = ready(rig_params, rig, sense) if waits else 0
        place, (finished, late) = sequence.step(
            segments, place, tick, holds, mode <= RUN, mode == STOP_2
        )
        trip = check(rig_params, rig, sense, motion, mode)
        if periods > most_lost:  # allows no controlled stop, so it goes first
            trip = Reason.LOST_TICKS.value
        if late and trip == FINE:
            stator_there = (holds & sequence.WAIT_STATOR) != 0
            trip = (Reason.DRIVE_NOT_ON if stator_there else Reason.STATOR_LATE).value
        i = place.segment
        on = (holds & sequence.WAIT_DRIVE) != 0
        guard = safety.step(
            guard_params, guard, tick, trip, request, finished, segments.drive[i] == 1, on
        )

        if segments.waves[i] == 0 or guard.mode > STOP_2:
            since, clock = -1, -1.0
        else:
            since = tick if since < 0 else since
            clock = (tick - since) * dt
        plan = PlanRecord(segments.row[i], segments.phase[i], place.attempt, clock)
        rig, command, words = control(
            rig_params, rig, sense, motion, plan, guard, segments.setpoint[i], dt
        )
        row = make_row(tick, tick * dt, timing, plan, guard, sense, command, words)
        return State(place, guard, since, rig), command, row

    return step
