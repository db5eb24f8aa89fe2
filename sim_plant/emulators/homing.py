"""Homing of an emulated actuator: the supported methods of 0x6098, as phases. Pure.

Methods 35, 37: home at the present position. 17, 18: move to the negative, positive limit switch
and slowly off it. -17, -18: move against the negative, positive end stop; these two numbers are an
assumption [NC].
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from sim_plant.units import Second

CURRENT_POSITION_METHODS = (35, 37)
SEARCH_DIRECTION = {17: -1, -17: -1, 18: 1, -18: 1}  # direction of the search


class Phase(Enum):
    """Phase of the homing; the value is bits 10, 12, 13 of the statusword at standstill."""

    IDLE = 0x0400
    SEARCHING = 0x0000
    LEAVING = 0x0001  # moving slowly off the switch; bits as SEARCHING
    DONE = 0x1400
    FAILED = 0x2400


class Homing(NamedTuple):
    """State of the homing."""

    phase: Phase = Phase.IDLE
    method: int = 35
    blocked_time: Second = 0.0  # time without motion although commanded to move


class HomingInputs(NamedTuple):
    """Inputs of one step of the homing."""

    negative_switch: bool  # limit switches
    positive_switch: bool
    moving: bool  # the actuator, not its demand
    block_timeout: Second  # 203A:02: time without motion that means an end stop


def start(method: int) -> Homing:
    """Start homing; an unsupported method fails at once."""
    if method in CURRENT_POSITION_METHODS:
        return Homing(Phase.DONE, method)
    return Homing(Phase.SEARCHING if method in SEARCH_DIRECTION else Phase.FAILED, method)


def step(homing: Homing, inputs: HomingInputs, elapsed: Second) -> Homing:
    """Advance the homing by the present inputs."""
    phase, method, blocked = homing
    if phase not in (Phase.SEARCHING, Phase.LEAVING):
        return homing
    closed = inputs.negative_switch if SEARCH_DIRECTION[method] < 0 else inputs.positive_switch
    if phase is Phase.LEAVING:
        return homing if closed else Homing(Phase.DONE, method)
    if method > 0:
        return Homing(Phase.LEAVING, method) if closed else homing
    blocked = 0.0 if inputs.moving else blocked + elapsed
    if blocked > inputs.block_timeout:
        return Homing(Phase.DONE, method)
    return Homing(phase, method, blocked)


def direction(homing: Homing) -> int:
    """Return the direction of motion: -1, 0, 1; LEAVING moves back, at the slow speed."""
    if homing.phase is Phase.SEARCHING:
        return SEARCH_DIRECTION[homing.method]
    return -SEARCH_DIRECTION[homing.method] if homing.phase is Phase.LEAVING else 0


def status_bits(homing: Homing) -> int:
    """Return bits 10, 12, 13 of the statusword."""
    return homing.phase.value & 0x3400
