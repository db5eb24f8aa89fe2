"""The CiA 402 state machine seen from the master: goal and statusword -> controlword.

`cia402_table` holds two tables: the controlword that brings a drive from its state towards the
goal, and the transition awaited then, which has a deadline. Two rules override the tables:

- **No drive is enabled without permission.** An explicit request (`arm`, a number that changes)
  gives the permission while the drive is in SWITCH ON DISABLED; each cause in `DisarmReason` ends
  it. Without it the goal is SAFE, or QUICK_STOP if that is the goal; a quick stop that takes too
  long ends in SAFE as well.
- **A fault is reset only by an explicit request** (`reset`), which does not give the permission.

A request that cannot be granted in its tick is discarded, so that nothing starts unexpectedly
later. A goal that goes down and up again within one round trip of the bus ends the permission,
because the drive's response then looks like an unrequested drop.

The set-point must be a quantity for which zero is harmless (torque, current). It is zero unless the
drive is in OPERATION ENABLED by our permission, displays the requested mode in 0x6061 and, if it
implements statusword bit 12, reports there that it follows the command.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.cia402.state_table import (
    AWAITED,
    CONTROLWORDS,
    CYCLIC,
    HALT,
    LEVEL,
    MAX_LEVEL,
    MODE_BITS,
    OFF,
    ON,
    RESET,
    RUN,
    STOP,
    Awaited,
    Goal,
)
from drivers.cia402.statusword import (
    DISABLED,
    ENABLED,
    FAULT,
    FAULT_REACTION,
    MODE_BIT_12,
    QUICK_STOPPING,
    SWITCHED_ON,
    UNKNOWN,
    decode,
)


class DisarmReason(IntEnum):
    """The reason why the drive has no permission to be enabled."""

    NONE = 0  # it has the permission
    NOT_REQUESTED = 1
    STALE = 2  # the statusword is too old, or its age is not finite
    FAULT = 3
    UNKNOWN_STATE = 4  # a statusword that no pattern of the table matches
    DROPPED = 5  # the drive left its state by itself: reboot, limit switch, its own quick stop
    LATE = 6  # a transition took too long: `State.missed_transition`
    QUICK_STOP = 7  # requested by the goal


class Deadlines(NamedTuple):
    """Deadline of each `Awaited` transition in ticks, in the order of `Awaited`."""

    nothing: int
    boot: int
    shutdown: int
    switch_on: int
    enable: int
    mode: int
    follow: int
    disable_voltage: int
    quick_stop: int
    ramp_end: int
    fault_reaction: int
    fault_reset: int


_SAFE, _READY, _ENABLED, _QUICK_STOP = (int(goal) for goal in Goal)
_NOTHING, _ENABLE, _MODE, _FOLLOW, _RESET = (
    int(awaited)
    for awaited in (
        Awaited.NOTHING,
        Awaited.ENABLE,
        Awaited.MODE,
        Awaited.FOLLOW,
        Awaited.FAULT_RESET,
    )
)
_ARMED, _NOT_REQUESTED, _STALE, _FAULTY, _UNKNOWN_STATE, _DROPPED, _LATE, _STOPPED = (
    int(w) for w in DisarmReason
)


class Params(NamedTuple):
    """Parameters that differ between drives."""

    max_status_age: float  # s, > 0: an older statusword is ignored
    mode_first: (
        int  # 1: 0x6061 must display the mode before enabling; 0: it does so only afterwards
    )
    follows: int  # 1: bit 12 is implemented in cyclic modes; differs between manufacturers
    resume: int  # 1: 0x605A was read back as 5..8, the drive stays in QUICK STOP ACTIVE
    reset_ticks: int  # >= 1: duration of each level of the reset edge; the deadline is later
    deadlines: Deadlines


class Inputs(NamedTuple):
    """Received values and requests of this tick."""

    statusword: int
    age: float  # s, since the statusword was sampled
    mode_display: int  # 0x6061, or 0 (no mode) if it was not read or is too old
    mode: int  # 0x6060 as requested
    goal: int  # `Goal`; any other value counts as SAFE
    arm: int  # changes with every request for the permission to enable
    reset: int  # changes with every request to reset a fault
    mode_bits: int  # of the controlword: HALT in OPERATION ENABLED, MODE_BITS while acting
    setpoint: int  # raw


class State(NamedTuple):
    """State of the machine."""

    armed: int  # 1: permission to enable
    reason: int  # `DisarmReason`: the first cause
    missed_transition: int  # first `Awaited` that was late since the permission was given
    arm: int  # the last request seen, granted or not
    reset: int
    resetting: int  # 1 during a fault reset
    reached_level: int  # highest `LEVEL` reached on the way to the goal
    awaited: int  # `Awaited`
    ticks: int  # waited for it so far


class Output(NamedTuple):
    """Values to send, and the state of the drive."""

    controlword: int
    setpoint: int
    drive: int  # `DriveState`; UNKNOWN while the statusword is stale
    acting: int  # 1: the drive follows the set-point of its mode


def start(arm: int, reset: int) -> State:
    """Return the initial state, without permission; ``arm``, ``reset``: numbers already used."""
    return State(0, _NOT_REQUESTED, 0, arm, reset, 0, -1, 0, 0)


def find_problems(params: Params) -> tuple[str, ...]:
    """Return the problems of the parameters, by name; empty if they are valid."""
    problems = []
    if not 0.0 < params.max_status_age < 1.0:  # s; a moving drive must report within a second
        problems.append(f"stale: {params.max_status_age} s is not between 0 and 1")
    if params.reset_ticks < 1:
        problems.append(f"reset_ticks: {params.reset_ticks} is below 1")
    if params.deadlines.fault_reset <= 2 * params.reset_ticks:
        problems.append(
            f"fault_reset: {params.deadlines.fault_reset} ticks end before the edge does"
        )
    for name, ticks in zip(Deadlines._fields[1:], params.deadlines[1:], strict=True):
        if ticks < 1:
            problems.append(f"{name}: a deadline of {ticks} ticks is below 1")
    return tuple(problems)


def explain(state: State) -> str:
    """Return why the drive is not enabled, for people; empty if it has permission."""
    missed = (
        f"{Awaited(state.missed_transition).name} took too long" if state.missed_transition else ""
    )
    if state.reason == _LATE:
        return missed
    reason = DisarmReason(state.reason).name if state.reason else ""
    return "; ".join(filter(None, [reason, missed]))


def _disarm_reason(fresh: bool, drive: int, reached: int, goal: int) -> int:
    """Return the `DisarmReason` that ends a permission in this tick, worst first."""
    if not fresh:
        return _STALE
    if drive in (FAULT, FAULT_REACTION):
        return _FAULTY
    if drive == UNKNOWN:
        return _UNKNOWN_STATE
    if LEVEL[drive] < reached:
        return _DROPPED
    return _STOPPED if goal == _QUICK_STOP else _ARMED


def _command(params: Params, inputs: Inputs, drive: int, goal: int) -> tuple[int, int]:
    """Return controlword (without mode bits) and awaited transition for a permitted goal."""
    if goal == _ENABLED:
        shown = inputs.mode_display == inputs.mode != 0
        if drive == SWITCHED_ON and params.mode_first == 1 and not shown:
            return ON, _MODE
        if drive == ENABLED and not shown:
            return RUN, _MODE
        if drive == ENABLED and params.follows == 1 and inputs.mode in CYCLIC:
            return RUN, _NOTHING if inputs.statusword & MODE_BIT_12 else _FOLLOW
        if drive == QUICK_STOPPING and params.resume == 1:
            return RUN, _ENABLE
    if goal == _QUICK_STOP and drive == QUICK_STOPPING and params.resume == 1:
        return STOP, _NOTHING  # the drive's setting keeps it in this state
    return CONTROLWORDS[drive][goal], AWAITED[drive][goal]


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """Return state and output after one tick; raises nothing for any integers."""
    armed, reason, missed, last_arm, last_reset, resetting, reached, previous, ticks = state
    statusword, age, _, _, goal, arm, reset, mode_bits, setpoint = inputs
    if not _SAFE <= goal <= _QUICK_STOP:
        goal = _SAFE
    fresh = 0.0 <= age <= params.max_status_age  # false for NaN
    drive = decode(statusword) if fresh else UNKNOWN
    level = min(LEVEL[drive], MAX_LEVEL[goal])

    if armed == 1:
        reached = min(reached, MAX_LEVEL[goal])
        reason = _disarm_reason(fresh, drive, reached, goal)
        armed = 1 if reason == _ARMED else 0
        reached = max(reached, level)
    elif (
        arm != last_arm
        and goal != _QUICK_STOP
        # Only from these states: enabling always starts without power and takes every transition.
        and (drive == DISABLED or (drive == QUICK_STOPPING and params.resume == 1))
    ):
        armed, reason, missed, reached, previous = 1, _ARMED, 0, level, 0

    if drive != FAULT:
        resetting = 0
    elif reset != last_reset:
        resetting, previous = 1, 0

    permitted = goal if armed == 1 or goal == _QUICK_STOP else _SAFE
    controlword, awaited = _command(params, inputs, drive, permitted)
    if resetting == 1:
        awaited = _RESET
    ticks = ticks + 1 if awaited == previous else 1
    if awaited != _NOTHING and ticks > params.deadlines[awaited]:
        missed = missed if missed else awaited
        resetting = 0
        if armed == 1:
            armed, reason = 0, _LATE
            controlword, awaited = _command(params, inputs, drive, _SAFE)
            ticks = 1
        elif permitted == _QUICK_STOP:
            controlword = OFF
    if resetting == 1 and params.reset_ticks < ticks <= 2 * params.reset_ticks:
        controlword = RESET  # low before and after: only the rising edge resets

    acting = (
        1 if armed == 1 and controlword == RUN and drive == ENABLED and awaited == _NOTHING else 0
    )
    if controlword == RUN and drive == ENABLED:
        controlword |= mode_bits & (HALT | MODE_BITS if acting == 1 else HALT)
    after = State(armed, reason, missed, arm, reset, resetting, reached, awaited, ticks)
    return after, Output(controlword, setpoint if acting == 1 else 0, drive, acting)
