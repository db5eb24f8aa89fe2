"""The CiA 402 state machine as the master sees it, in two tables: controlword and next transition.

Controlwords (0x6040) and transitions after CiA 402, numbered as in drive manuals.
"""

from enum import IntEnum


class Goal(IntEnum):
    """Requested state of the drive."""

    SAFE = 0  # SWITCH ON DISABLED: no power
    READY = 1  # READY TO SWITCH ON
    ENABLED = 2  # OPERATION ENABLED: torque on command
    QUICK_STOP = 3  # the drive's own stop, 0x605A; needs no permission, and ends an existing one


class Awaited(IntEnum):
    """Next transition of the drive; the numbers in the comments are transitions of CiA 402."""

    NOTHING = 0
    BOOT = 1  # 0, 1: automatic
    SHUTDOWN = 2  # 2, 6, 8
    SWITCH_ON = 3  # 3
    ENABLE = 4  # 4, 16
    MODE = 5  # 0x6061 displays the requested mode
    FOLLOW = 6  # bit 12 in a cyclic mode: the drive follows the command
    DISABLE_VOLTAGE = 7  # 7, 9, 10, 12
    QUICK_STOP = 8  # 7, 10, 11
    RAMP_END = 9  # 12, automatic at the end of the quick-stop ramp
    FAULT_REACTION = 10  # 14, automatic
    FAULT_RESET = 11  # 15


OFF, STOP, SHUT, ON, RUN, RESET = 0x00, 0x02, 0x06, 0x07, 0x0F, 0x80  # controlwords
HALT = 1 << 8
MODE_BITS = 0x0070  # controlword bits 4 to 6, of the mode
CYCLIC = (8, 9, 10)  # modes in which bit 12 may say that the drive follows: CSP, CSV, CST

# fmt: off
CONTROLWORDS: tuple[tuple[int, int, int, int], ...] = (
    # SAFE  READY  ENABLED QUICK_STOP
    (OFF,  OFF,  OFF,   STOP),  # UNKNOWN: quick stop enables from no state
    (OFF,  OFF,  OFF,   OFF),   # NOT_READY_TO_SWITCH_ON
    (OFF,  SHUT, SHUT,  OFF),   # SWITCH_ON_DISABLED
    (OFF,  SHUT, ON,    STOP),  # READY_TO_SWITCH_ON
    (OFF,  SHUT, RUN,   STOP),  # SWITCHED_ON
    (OFF,  SHUT, RUN,   STOP),  # OPERATION_ENABLED
    (OFF,  OFF,  OFF,   STOP),  # QUICK_STOP_ACTIVE: 0x00 here would cut the ramp
    (OFF,  OFF,  OFF,   OFF),   # FAULT_REACTION_ACTIVE
    (OFF,  OFF,  OFF,   OFF),   # FAULT
)

_NIL, _BOOT, _SHD, _SWO, _ENA, _MOD, _FOL, _DIS, _QST, _END, _FRE, _RES = (int(a) for a in Awaited)

AWAITED: tuple[tuple[int, int, int, int], ...] = (
    # SAFE  READY  ENABLED QUICK_STOP
    (_NIL,  _NIL,  _NIL,   _NIL),   # UNKNOWN
    (_BOOT, _BOOT, _BOOT,  _BOOT),  # NOT_READY_TO_SWITCH_ON
    (_NIL,  _SHD,  _SHD,   _NIL),   # SWITCH_ON_DISABLED
    (_DIS,  _NIL,  _SWO,   _QST),   # READY_TO_SWITCH_ON
    (_DIS,  _SHD,  _ENA,   _QST),   # SWITCHED_ON
    (_DIS,  _SHD,  _NIL,   _QST),   # OPERATION_ENABLED
    (_DIS,  _DIS,  _DIS,   _END),   # QUICK_STOP_ACTIVE
    (_FRE,  _FRE,  _FRE,   _FRE),   # FAULT_REACTION_ACTIVE
    (_NIL,  _NIL,  _NIL,   _NIL),   # FAULT
)

#       UNKNOWN NOT_READY DISABLED READY SWITCHED_ON ENABLED QUICK_STOP REACTION FAULT
LEVEL = (-1,     -1,       0,       1,    2,          3,      -1,        -1,      -1)
#      SAFE READY ENABLED QUICK_STOP: the highest level that a goal permits
MAX_LEVEL = (0,   1,    3,      0)
# fmt: on
