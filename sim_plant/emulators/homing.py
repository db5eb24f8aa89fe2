"""How an emulated actuator finds its home: the methods of 0x6098 that it has, as phases. Pure.

35, 37: where it stands. 17, 18: to the negative, positive limit switch and slowly off it. -17, -18:
onto the negative, positive block; these two numbers are an assumption [NC].
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from sim_plant.units import Second

HERE = (35, 37)
SIDES = {17: -1, -17: -1, 18: 1, -18: 1}  # direction of the search


class Phase(Enum):
    """How far it is; the value is bits 10, 12, 13 of the statusword, standing still."""

    IDLE = 0x0400
    SEARCHING = 0x0000
    LEAVING = 0x0001  # the switch, slowly; bits as SEARCHING
    DONE = 0x1400
    FAILED = 0x2400


class Homing(NamedTuple):
    """What the search remembers."""

    phase: Phase = Phase.IDLE
    method: int = 35
    blocked: Second = 0.0  # how long it has not moved though led


class Sight(NamedTuple):
    """What it goes by at one look."""

    negative: bool  # limit switches
    positive: bool
    moving: bool  # the actuator, not its demand
    patience: Second  # 203A:02: standing this long is a block


def started(method: int) -> Homing:
    """Begin; a method that the device does not have fails at once."""
    if method in HERE:
        return Homing(Phase.DONE, method)
    return Homing(Phase.SEARCHING if method in SIDES else Phase.FAILED, method)


def look(homing: Homing, sight: Sight, elapsed: Second) -> Homing:
    """Move on by what is seen now."""
    phase, method, blocked = homing
    if phase not in (Phase.SEARCHING, Phase.LEAVING):
        return homing
    closed = sight.negative if SIDES[method] < 0 else sight.positive
    if phase is Phase.LEAVING:
        return homing if closed else Homing(Phase.DONE, method)
    if method > 0:
        return Homing(Phase.LEAVING, method) if closed else homing
    blocked = 0.0 if sight.moving else blocked + elapsed
    if blocked > sight.patience:
        return Homing(Phase.DONE, method)
    return Homing(phase, method, blocked)


def direction(homing: Homing) -> int:
    """Give where it moves: -1, 0, 1; leaving goes back, at the slow speed."""
    if homing.phase is Phase.SEARCHING:
        return SIDES[homing.method]
    return -SIDES[homing.method] if homing.phase is Phase.LEAVING else 0


def bits(homing: Homing) -> int:
    """Give bits 10, 12, 13 of the statusword."""
    return homing.phase.value & 0x3400
