"""The safety machine: one table that a person can read at once.

Stop categories follow IEC 60204-1: category 0 removes power at once; category 1 brings the motion
under control (passive damping), then removes power; category 2 does the same and keeps power on.
There is no way back up from a stop of category 0 or 1: a new run is a new, explicit request.
"""

from enum import IntEnum
from typing import NamedTuple

from controllers.signals import Index, Tick


class Mode(IntEnum):
    """State of the machine."""

    OFF = 0  # power off, nothing wrong
    ENABLING = 1  # drive asked to come up, not yet on
    RUN = 2  # the law acts
    STOP_2 = 3  # held: damping, power stays on
    STOP_1 = 4  # damping for a set time, then STOP_0
    STOP_0 = 5  # power off, latched


# Plain ints for the tick: looking up an enum member costs 0.1 us, and a tick compares many.
OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0 = (int(mode) for mode in Mode)


class Event(IntEnum):
    """What may happen in a tick; when several do, the one named first counts."""

    TRIP_0 = 0  # a fault that allows no controlled stop
    EXPIRED = 1  # the present state has lasted as long as it may
    TRIP_1 = 2  # a fault that allows a controlled stop
    STOP = 3  # the operator, the supervisor, or the plan's end
    HOLD = 4  # the operator holds the rig
    RESUME = 5
    POWER = 6  # the plan wants the drive on and it reports on
    WANTED = 7  # the plan wants the drive on and it is not on yet
    NONE = 8


_OFF, _ENA, _RUN = Mode.OFF, Mode.ENABLING, Mode.RUN
_ST2, _ST1, _ST0 = Mode.STOP_2, Mode.STOP_1, Mode.STOP_0

# fmt: off
TABLE: tuple[tuple[Mode, ...], ...] = (
    # TRIP_0 EXPIRED TRIP_1 STOP   HOLD  RESUME POWER WANTED NONE
    (_ST0,   _OFF,   _ST0,  _ST0,  _OFF, _OFF,  _ENA, _ENA,  _OFF),  # OFF
    (_ST0,   _ST0,   _ST0,  _ST0,  _ENA, _ENA,  _RUN, _ENA,  _ENA),  # ENABLING
    (_ST0,   _RUN,   _ST1,  _ST1,  _ST2, _RUN,  _RUN, _RUN,  _RUN),  # RUN
    (_ST0,   _ST2,   _ST1,  _ST1,  _ST2, _RUN,  _ST2, _ST2,  _ST2),  # STOP_2
    (_ST0,   _ST0,   _ST1,  _ST1,  _ST1, _ST1,  _ST1, _ST1,  _ST1),  # STOP_1
    (_ST0,   _ST0,   _ST0,  _ST0,  _ST0, _ST0,  _ST0, _ST0,  _ST0),  # STOP_0
)
# fmt: on

_NEXT = tuple(tuple(int(mode) for mode in row) for row in TABLE)
_TRIP_0, _EXPIRED, _TRIP_1, _STOP, _HOLD, _RESUME, _POWER, _WANTED, _NONE = (
    int(event) for event in Event
)


class Reason(IntEnum):
    """Why the rig stopped, or was asked to."""

    NONE = 0
    PLAN_END = 1
    OPERATOR_STOP = 2
    OPERATOR_ABORT = 3
    SUPERVISOR_LOST = 4
    LOGGER_LOST = 5
    NOT_FINITE = 6  # a sensed, estimated or demanded value is NaN or infinite
    STALE_ENCODER = 7
    STALE_DRIVE = 8
    STALE_LOAD_CELL = 9
    STALE_ANALYSER = 10
    STALE_STATOR = 11
    LOST_TICKS = 12
    DRIVE_FAULT = 13
    DRIVE_DROPPED = 14  # the drive left its on state by itself
    DRIVE_NOT_ON = 15  # the drive did not come up in time
    POSITION = 16
    VELOCITY = 17
    ROTOR_TRAVEL = 18
    POSITION_DISAGREES = 19  # encoder and string pot differ: one of them is stuck or has slipped
    STATOR_LATE = 20
    NOT_CALM = 21  # the body moved during the tare
    EXCEPTION = 22  # the loop's own code failed
    ENCODER_JUMP = 23  # counts far from where the motion could have led: slip, lost counts
    SPRING_STROKE = 24  # beyond the stroke at which the stator's force reverses
    BUS_UNDERVOLTAGE = 25  # the custom drive's bus ran out of energy
    BUS_OVERVOLTAGE = 26  # more energy than the dump resistors burn
    SURGE_STALE_ENCODER = 27
    SURGE_STALE_DRIVE = 28
    SURGE_DRIVE_FAULT = 29
    SURGE_DRIVE_DROPPED = 30
    SURGE_POSITION = 31
    SURGE_VELOCITY = 32
    SURGE_ENCODER_JUMP = 33
    EMERGENCY_STOP = 34  # the button; the hard-wired chain has acted already
    LIMIT_SWITCH = 35
    STALE_PANEL = 36
    BRAKE_LOST = 37  # the brake's current is not what it was told to be
    STALE_BRAKE = 38
    COUPLING_SLIP = 39  # motor and shaft are further apart than the driveline can twist
    LOAD_CELL_OVERLOAD = 40
    SHAFT_ENCODER_JUMP = 41
    CURRENT_DISAGREES = 42  # the drive's current is not what it was commanded to be
    SURGE_CURRENT_DISAGREES = 43
    VELOCITY_DISAGREES = 44  # the motor does not turn as its velocity loop was commanded to
    FORCE_DISAGREES = 45  # the force sensor at the motor's shaft does not show its current
    POWER_SIGN = 46  # the motor feeds energy into the body under a law that can only absorb
    POWER_BALANCE = 47  # two stations report powers that no loss between them explains


FINE = int(Reason.NONE)

# The stop category of each reason. A fault in what the damping itself needs (encoder, drive,
# arithmetic, time) leaves no controlled stop.
CATEGORY: tuple[int, ...] = (
    1,  # NONE (never used)
    1,  # PLAN_END
    1,  # OPERATOR_STOP
    0,  # OPERATOR_ABORT
    1,  # SUPERVISOR_LOST
    1,  # LOGGER_LOST
    0,  # NOT_FINITE
    0,  # STALE_ENCODER
    0,  # STALE_DRIVE
    1,  # STALE_LOAD_CELL
    1,  # STALE_ANALYSER
    1,  # STALE_STATOR
    0,  # LOST_TICKS
    0,  # DRIVE_FAULT
    0,  # DRIVE_DROPPED
    0,  # DRIVE_NOT_ON
    1,  # POSITION
    1,  # VELOCITY
    1,  # ROTOR_TRAVEL
    0,  # POSITION_DISAGREES
    1,  # STATOR_LATE
    1,  # NOT_CALM
    0,  # EXCEPTION
    0,  # ENCODER_JUMP
    1,  # SPRING_STROKE
    0,  # BUS_UNDERVOLTAGE
    0,  # BUS_OVERVOLTAGE
    0,  # SURGE_STALE_ENCODER
    0,  # SURGE_STALE_DRIVE
    0,  # SURGE_DRIVE_FAULT
    0,  # SURGE_DRIVE_DROPPED
    1,  # SURGE_POSITION
    1,  # SURGE_VELOCITY
    0,  # SURGE_ENCODER_JUMP
    0,  # EMERGENCY_STOP
    1,  # LIMIT_SWITCH
    1,  # STALE_PANEL
    1,  # BRAKE_LOST
    1,  # STALE_BRAKE
    0,  # COUPLING_SLIP
    0,  # LOAD_CELL_OVERLOAD
    0,  # SHAFT_ENCODER_JUMP
    0,  # CURRENT_DISAGREES
    0,  # SURGE_CURRENT_DISAGREES
    0,  # VELOCITY_DISAGREES
    0,  # FORCE_DISAGREES
    0,  # POWER_SIGN
    1,  # POWER_BALANCE
)

# Requests of people and of the supervisor, as they come through the mailbox.
REQUEST_NONE = 0
REQUEST_STOP = 1
REQUEST_ABORT = 2
REQUEST_HOLD = 3
REQUEST_RESUME = 4
REQUEST_LOGGER_LOST = 5
REQUEST_SUPERVISOR_LOST = 6


class Params(NamedTuple):
    """How long a state may last, in ticks."""

    enable_ticks: int  # ENABLING
    stop_ticks: int  # STOP_1


class State(NamedTuple):
    """State of the machine; logged every tick."""

    mode: Index  # `Mode`
    entered: Tick  # in which the mode began
    reason: Index  # `Reason`: the first cause of a stop


def start(tick: int) -> State:
    """Power off, nothing wrong."""
    return State(0, tick, 0)


def requested(request: int) -> int:
    """The reason to stop that a request carries, or NONE."""
    if request == REQUEST_STOP:
        return Reason.OPERATOR_STOP.value
    if request == REQUEST_ABORT:
        return Reason.OPERATOR_ABORT.value
    if request == REQUEST_LOGGER_LOST:
        return Reason.LOGGER_LOST.value
    if request == REQUEST_SUPERVISOR_LOST:
        return Reason.SUPERVISOR_LOST.value
    return Reason.NONE.value


def step(
    params: Params,
    state: State,
    tick: int,
    trip: int,
    request: int,
    finished: bool,
    wanted: bool,
    powered: bool,
) -> State:
    """The mode for this tick.

    ``trip``: the reason (0: none) found by the checks in this very tick; ``finished``: the plan is
    walked to its end; ``wanted``: the plan wants the drive on; ``powered``: the drive says it is.
    """
    mode = state.mode
    age = tick - state.entered
    reason = trip
    if reason == FINE and mode == ENABLING and age >= params.enable_ticks and not powered:
        reason = Reason.DRIVE_NOT_ON.value
    if request != REQUEST_NONE:
        asked = requested(request)
        # An abort goes before a fault that would still allow a controlled stop.
        if asked != FINE and (reason == FINE or CATEGORY[asked] < CATEGORY[reason]):
            reason = asked
    if reason == FINE and finished:
        reason = Reason.PLAN_END.value

    if reason != FINE and CATEGORY[reason] == 0:
        event = _TRIP_0
    elif mode == STOP_1 and age >= params.stop_ticks:
        event = _EXPIRED
    elif trip != FINE:
        event = _TRIP_1
    elif reason != FINE:
        event = _STOP
    elif request == REQUEST_HOLD and mode == RUN:
        event = _HOLD
    elif request == REQUEST_RESUME and mode == STOP_2:
        event = _RESUME
    elif wanted:
        event = _POWER if powered else _WANTED
    else:
        event = _NONE

    after = _NEXT[mode][event]
    if after == mode:
        return state
    # The first reason is the cause; what follows from it must not hide it.
    kept = state.reason if state.reason != FINE else reason
    return State(after, tick, kept)
