"""Decoding of the CiA 402 statusword 0x6041.

Coding after CiA 402 as printed in drive manuals (Nanotec and AMC agree, statusword 0x6041).
"""

from enum import IntEnum


class DriveState(IntEnum):
    """State of the drive's state machine."""

    UNKNOWN = 0  # no pattern of the table matches, or no fresh statusword
    NOT_READY_TO_SWITCH_ON = 1
    SWITCH_ON_DISABLED = 2
    READY_TO_SWITCH_ON = 3
    SWITCHED_ON = 4
    OPERATION_ENABLED = 5  # the only state with torque on command
    QUICK_STOP_ACTIVE = 6
    FAULT_REACTION_ACTIVE = 7
    FAULT = 8


# Plain ints for the tick: looking up an enum member costs 0.1 us, and a tick compares many.
(
    UNKNOWN,
    NOT_READY,
    DISABLED,
    READY,
    SWITCHED_ON,
    ENABLED,
    QUICK_STOPPING,
    FAULT_REACTION,
    FAULT,
) = (int(state) for state in DriveState)

# fmt: off
CODING: tuple[tuple[int, int, DriveState], ...] = (
    # mask  value  the drive is in this state if statusword & mask == value
    (0x4F, 0x00, DriveState.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x6F, 0x21, DriveState.READY_TO_SWITCH_ON),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, 0x27, DriveState.OPERATION_ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, DriveState.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, DriveState.FAULT),
)
# fmt: on

TARGET_REACHED = 1 << 10
MODE_BIT_12 = 1 << 12  # cyclic modes: follows the command; profile position: set-point acknowledge
MODE_BIT_13 = 1 << 13  # profile position: following error; homing: homing error

BITS: tuple[tuple[int, str], ...] = (
    (1 << 4, "voltage enabled"),
    (1 << 7, "warning"),
    (1 << 9, "remote"),
    (TARGET_REACHED, "target reached"),
    (1 << 11, "internal limit active"),
    (MODE_BIT_12, "mode bit 12"),
    (MODE_BIT_13, "mode bit 13"),
)


def _coded(word: int) -> DriveState:
    for mask, value, state in CODING:
        if word & mask == value:
            return state
    return DriveState.UNKNOWN


_STATES = tuple(int(_coded(word)) for word in range(0x80))  # no mask reaches beyond bit 6


def decode(statusword: int) -> int:
    """Return the `DriveState` of any statusword; UNKNOWN if the table lists no pattern for it."""
    return _STATES[statusword & 0x7F]


def describe(statusword: int) -> str:
    """Return the statusword for people: hexadecimal, state, and the other bits that are set."""
    name = DriveState(decode(statusword)).name.lower().replace("_", " ")
    return ", ".join(
        [f"{statusword:#06x} {name}", *(text for bit, text in BITS if statusword & bit)]
    )
