"""The cycle: sense -> estimate -> control -> limit -> actuate -> log, as one pure function.

`make` composes it from the functions of one rig kind (its axes, its other devices); only this
module defines the order of the stages. A tick ends either in a valid command or in a stop.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from controllers.signals import Count, Index, Second
from rig.realtime import assessment, safety, sequence
from rig.realtime.reasons import NO_REASON, Reason, ReasonTable, TripReason, reason_table
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.safety import RUN, STOP_2


class Params(NamedTuple):
    """Constants of a run."""

    segments: sequence.Segments
    safety: safety.Params
    lost_ticks_stop: int  # a gap of more periods than this trips
    rig: Any  # the kind's own Params
    live_setpoint: int = -1  # first of the two set points that people write; -1: there are none
    assessed: assessment.Params = assessment.NOTHING


class State(NamedTuple):
    """Memory of the cycle."""

    sequence: sequence.State
    safety: safety.State
    wave_start_tick: int  # tick in which the wave maker started; -1 while it is stopped
    rig: Any  # the kind's own State
    assessed: assessment.State = assessment.start()


class Timing(NamedTuple):
    """Actual timing of a tick; all zero on a virtual clock."""

    lateness: Second  # wake-up after the planned time
    work: Second  # duration of the previous tick
    skipped: Count  # periods lost since the run began


class PlanRecord(NamedTuple):
    """Present position in the campaign plan."""

    row: Index  # row id; -1 for none
    phase: Index  # `rig.realtime.sequence.Phase`
    attempt: Index  # number of times that the row was started over
    wave_clock: Second  # time since the wave maker started; -1 while it is stopped
    live: Count = 0  # number of the set point in force that people chose; 0: the plan's own
    request: Request = NO_REQUEST  # what people and the supervisor ask


class Kind(NamedTuple):
    """The functions of one kind of rig; each is pure.

    ``start(params) -> state`` before the first tick
    ``observe(params, state, sense, periods, dt) -> motion`` of every axis
    ``ready(params, state, sense) -> set of the sequence.WAIT_ flags`` that are met
    ``check(params, state, sense, motion, mode) -> reason``
    ``control(params, state, sense, motion, plan, safety, setpoint, dt) -> state, command, signals``
    where ``setpoint`` is an index into the kind's table of set points
    ``row(tick, time, timing, plan, safety, sense, command, signals) -> row``
    ``assessed(row) -> powers, velocity`` by which a row may end (`rig.realtime.assessment`)

    ``any_types`` are the types of the fields within ``params_type`` that are annotated `Any`, for
    the way to the loop process.
    """

    row_type: type
    params_type: type
    start: Callable[[Any], Any]
    observe: Callable[..., Any]
    ready: Callable[..., int]
    check: Callable[..., int]
    control: Callable[..., Any]
    row: Callable[..., Any]
    any_types: tuple[tuple[str, Any], ...] = ()  # of the fields of Params
    reasons: tuple[TripReason, ...] = ()  # the kind's own
    late_reason: int = Reason.DRIVE_NOT_ON.value  # moved parts have not arrived in time
    sense_type: Any = None  # of the readings; None: the cycle is not compiled
    assessed: Callable[[Any], assessment.Assessed] = assessment.nothing_assessed

    @property
    def reason_table(self) -> ReasonTable:
        """All reasons of a stop."""
        return reason_table(self.reasons)


Step = Callable[..., tuple[State, Any, Any]]


def start(kind: Kind, params: Params, tick: int) -> State:
    """Return the state before the first tick."""
    return State(sequence.start(tick), safety.start(tick), -1, kind.start(params.rig))


def make(kind: Kind) -> Step:
    """Return the cycle of one kind of rig.

    ``step(params, state, sense, request, tick, timing, periods, dt) -> state, command, row``:
    ``request`` are those of people and the supervisor, from the mailbox; ``periods`` the ticks
    since the last call (1 unless some were lost), ``dt`` the period in seconds.
    """
    observe, ready, check = kind.observe, kind.ready, kind.check
    control, make_row = kind.control, kind.row
    category, late_reason = kind.reason_table.categories, kind.late_reason
    get_assessed = kind.assessed

    def step(
        params: Params,
        state: State,
        sense: Any,
        request: Request,
        tick: int,
        timing: Timing,
        periods: int,
        dt: float,
    ) -> tuple[State, Any, Any]:
        segments, safety_params, max_lost_ticks, rig_params, live_setpoint, assessed_params = params
        plan_state, safety_state, wave_start, rig, assessed = state
        motion = observe(rig_params, rig, sense, periods, dt)

        # The plan advances on the conditions met so far; the safety machine then decides.
        # The conditions are evaluated only where the drive is coming on or the plan waits for one.
        mode = safety_state.mode
        waiting = mode < RUN or segments.wait[plan_state.segment] != 0
        conditions = assessed.flags | (ready(rig_params, rig, sense) if waiting else 0)
        if request.armed == 1:
            conditions = conditions | sequence.WAIT_ARMED
        plan_state, (finished, timed_out) = sequence.step(
            segments, plan_state, tick, conditions, mode <= RUN, mode == STOP_2, request
        )
        trip = check(rig_params, rig, sense, motion, mode)
        if periods > max_lost_ticks:  # this trip allows no controlled stop, so it overrides
            trip = Reason.LOST_TICKS.value
        if timed_out and trip == NO_REASON:
            arrived = (conditions & sequence.WAIT_ARRIVAL) != 0
            trip = Reason.DRIVE_NOT_ON.value if arrived else late_reason
        i = plan_state.segment
        power_required = segments.drive[i] == 1
        drive_on = (conditions & sequence.WAIT_DRIVE) != 0
        safety_state = safety.step(
            safety_params,
            safety_state,
            tick,
            trip,
            request.code,
            finished,
            power_required,
            drive_on,
            category,
        )

        if segments.waves[i] == 0 or safety_state.mode > STOP_2:
            wave_start, wave_clock = -1, -1.0
        else:
            wave_start = tick if wave_start < 0 else wave_start
            wave_clock = (tick - wave_start) * dt
        row, phase, setpoint = segments.row[i], segments.phase[i], segments.setpoint[i]
        live = plan_state.live
        if live != 0 and live_setpoint >= 0:
            row, phase, setpoint = sequence.NO_ROW, sequence.MANUAL, live_setpoint + (live & 1)
        plan = PlanRecord(row, phase, plan_state.attempt, wave_clock, live, request)
        rig, command, signals = control(
            rig_params, rig, sense, motion, plan, safety_state, setpoint, dt
        )
        record = make_row(tick, tick * dt, timing, plan, safety_state, sense, command, signals)
        assessed = assessment.step(
            assessed_params, assessed, plan_state, phase, tick, periods, get_assessed(record)
        )
        return State(plan_state, safety_state, wave_start, rig, assessed), command, record

    return step
