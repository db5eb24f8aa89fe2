"""The CiA 402 power machine seen from the master: goal and statusword -> controlword.

`cia402_table` says in one table which controlword brings a drive from its state to the goal, and in
a second one what is then awaited, which has a deadline. Two rules stand above the tables:

- **Nothing goes up without permission.** The permission is given by an explicit request (`arm`, a
  number that changes) while the drive is in SWITCH ON DISABLED, and is lost by everything listed
  in `Why`. Without it the goal is SAFE, or QUICK_STOP if that is asked for; a quick stop that
  takes too long ends in SAFE as well.
- **A fault is reset only by an explicit request** (`reset`), which does not give the permission.

A request that cannot be granted in its tick is spent: nothing starts later by surprise. A goal that
goes down and up again within one round trip of the wire ends the permission, because what the drive
then does cannot be told from a drop.

The set-point is one of which zero is harmless (torque, current). It is zero unless the drive is
in OPERATION ENABLED by our permission, shows the mode asked for in 0x6061 and, where it implements
that, says in bit 12 that it follows the command.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.canopen.cia402_table import (
    AWAITED,
    CYCLIC,
    HALT,
    MODE_BITS,
    OFF,
    ON,
    RESET,
    RUN,
    RUNG,
    STOP,
    TOP,
    WORDS,
    Awaited,
    Goal,
)
from drivers.canopen.statusword import (
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


class Why(IntEnum):
    """Why there is no permission to go up."""

    NONE = 0  # there is
    NOT_ASKED = 1
    STALE = 2  # the statusword is too old, or its age is no number
    FAULT = 3
    UNKNOWN_STATE = 4  # a statusword that is in no table
    DROPPED = 5  # the drive went down by itself: reboot, limit switch, its own quick stop
    LATE = 6  # a transition took too long; `State.missed` says which
    QUICK_STOP = 7  # asked for by the goal


class Deadlines(NamedTuple):
    """How many ticks each `Awaited` transition may take, in its order."""

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
_FINE, _NOT_ASKED, _STALE, _FAULTY, _STRANGE, _DROPPED, _LATE, _STOPPED = (int(w) for w in Why)


class Params(NamedTuple):
    """What differs between drives."""

    stale: float  # s, > 0: a statusword that is older says nothing
    mode_first: int  # 1: not enabled before 0x6061 shows the mode; 0: it is shown only then
    follows: int  # 1: bit 12 is implemented in cyclic modes; differs between makers
    resume: int  # 1: 0x605A was read back as 5..8, the drive stays in QUICK STOP ACTIVE
    reset_ticks: int  # >= 1: how long each level of the reset's edge stands; the deadline is later
    deadlines: Deadlines


class Inputs(NamedTuple):
    """What came from the wire and what is wanted, this tick."""

    statusword: int
    age: float  # s, since the statusword was sampled
    shown: int  # 0x6061, or 0 (no mode) if it was not read or is too old
    mode: int  # 0x6060 as it was asked for
    goal: int  # `Goal`; anything else counts as SAFE
    arm: int  # changes with every request for the permission to go up
    reset: int  # changes with every request to reset a fault
    mode_bits: int  # of the controlword: HALT in OPERATION ENABLED, MODE_BITS while acting
    setpoint: int  # raw


class State(NamedTuple):
    """Memory of the machine."""

    armed: int  # 1: permission to go up
    why: int  # `Why` there is none: the first cause
    missed: int  # `Awaited` that came too late first since the permission was given
    arm: int  # the last request seen, granted or not
    reset: int
    resetting: int  # 1 while the fault reset is under way
    rung: int  # the highest reached on the way to the goal
    awaited: int
    ticks: int  # for which it has been awaited


class Output(NamedTuple):
    """What to send, and what the drive is at."""

    controlword: int
    setpoint: int
    drive: int  # `DriveState`; UNKNOWN while the statusword is stale
    acting: int  # 1: the drive does what the mode's set-point says


def start(arm: int, reset: int) -> State:
    """No permission; requests that were counted before (``arm``, ``reset``) mean nothing."""
    return State(0, _NOT_ASKED, 0, arm, reset, 0, -1, 0, 0)


def problems(params: Params) -> tuple[str, ...]:
    """What is wrong with the parameters, by name; empty if the machine can work with them."""
    found = []
    if not 0.0 < params.stale < 1.0:  # s; nothing that moves may go unheard for a second
        found.append(f"stale: {params.stale} s is not between 0 and 1")
    if params.reset_ticks < 1:
        found.append(f"reset_ticks: {params.reset_ticks} is below 1")
    if params.deadlines.fault_reset <= 2 * params.reset_ticks:
        found.append(f"fault_reset: {params.deadlines.fault_reset} ticks end before the edge does")
    for name, ticks in zip(Deadlines._fields[1:], params.deadlines[1:], strict=True):
        if ticks < 1:
            found.append(f"{name}: a deadline of {ticks} ticks is below 1")
    return tuple(found)


def explain(state: State) -> str:
    """Why the drive is kept down, for people; empty if it is not."""
    missed = f"{Awaited(state.missed).name} took too long" if state.missed else ""
    if state.why == _LATE:
        return missed
    why = Why(state.why).name if state.why else ""
    return "; ".join(filter(None, [why, missed]))


def _lost(fresh: bool, drive: int, floor: int, goal: int) -> int:
    """`Why` a permission ends in this tick, worst first."""
    if not fresh:
        return _STALE
    if drive in (FAULT, FAULT_REACTION):
        return _FAULTY
    if drive == UNKNOWN:
        return _STRANGE
    if RUNG[drive] < floor:
        return _DROPPED
    return _STOPPED if goal == _QUICK_STOP else _FINE


def _command(params: Params, inputs: Inputs, drive: int, goal: int) -> tuple[int, int]:
    """Controlword (mode bits aside) and what is awaited, for a goal that is permitted."""
    if goal == _ENABLED:
        shown = inputs.shown == inputs.mode != 0
        if drive == SWITCHED_ON and params.mode_first == 1 and not shown:
            return ON, _MODE
        if drive == ENABLED and not shown:
            return RUN, _MODE
        if drive == ENABLED and params.follows == 1 and inputs.mode in CYCLIC:
            return RUN, _NOTHING if inputs.statusword & MODE_BIT_12 else _FOLLOW
        if drive == QUICK_STOPPING and params.resume == 1:
            return RUN, _ENABLE
    if goal == _QUICK_STOP and drive == QUICK_STOPPING and params.resume == 1:
        return STOP, _NOTHING  # the drive stays there by its setting
    return WORDS[drive][goal], AWAITED[drive][goal]


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """One tick; raises nothing, whatever the integers are."""
    armed, why, missed, _, _, resetting, floor, before, ticks = state
    goal = inputs.goal if _SAFE <= inputs.goal <= _QUICK_STOP else _SAFE
    fresh = 0.0 <= inputs.age <= params.stale  # false for NaN
    drive = decode(inputs.statusword) if fresh else UNKNOWN
    rung = min(RUNG[drive], TOP[goal])

    if armed == 1:
        floor = min(floor, TOP[goal])
        why = _lost(fresh, drive, floor, goal)
        armed = 1 if why == _FINE else 0
        floor = max(floor, rung)
    elif (
        inputs.arm != state.arm
        and goal != _QUICK_STOP
        # From here only: every way up starts where there is no power, and is walked in full.
        and (drive == DISABLED or (drive == QUICK_STOPPING and params.resume == 1))
    ):
        armed, why, missed, floor, before = 1, _FINE, 0, rung, 0

    if drive != FAULT:
        resetting = 0
    elif inputs.reset != state.reset:
        resetting, before = 1, 0

    permitted = goal if armed == 1 or goal == _QUICK_STOP else _SAFE
    word, awaited = _command(params, inputs, drive, permitted)
    if resetting == 1:
        awaited = _RESET
    ticks = ticks + 1 if awaited == before else 1
    if awaited != _NOTHING and ticks > params.deadlines[awaited]:
        missed = missed if missed else awaited
        resetting = 0
        if armed == 1:
            armed, why = 0, _LATE
            word, awaited = _command(params, inputs, drive, _SAFE)
            ticks = 1
        elif permitted == _QUICK_STOP:
            word = OFF
    if resetting == 1 and params.reset_ticks < ticks <= 2 * params.reset_ticks:
        word = RESET  # low before, low after: only the rising edge resets

    acting = 1 if armed == 1 and word == RUN and drive == ENABLED and awaited == _NOTHING else 0
    if word == RUN and drive == ENABLED:
        word |= inputs.mode_bits & (HALT | MODE_BITS if acting == 1 else HALT)
    after = State(armed, why, missed, inputs.arm, inputs.reset, resetting, floor, awaited, ticks)
    return after, Output(word, inputs.setpoint if acting == 1 else 0, drive, acting)
