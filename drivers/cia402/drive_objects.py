"""The drive objects that are checked before arming, with their types and access.

Indices and types after CiA 301 and CiA 402; 0x2000 to 0x5FFF are manufacturer-specific (Nanotec and
AMC manuals, Nanotec C5-E EDS). A drive may lack some; its configuration then sets each to null.
"""

from enum import IntEnum
from typing import NamedTuple


class Access(IntEnum):
    """The access to an object before arming."""

    SET = 0  # written, then read back
    VERIFY = 1  # only read: the drive's value must agree with the configuration
    TRANSIENT = 2  # written, overwritten by a later step, not read back


class DriveObject(NamedTuple):
    """One entry of the object dictionary."""

    object: int  # index
    sub: int
    type: str  # as in pdo.TYPES
    name: str
    access: int  # `Access`
    mask: int  # bits compared when read back; -1: all
    guard: int  # 1: a protection, which 0 would disable


_SET, _VERIFY = Access.SET, Access.VERIFY
_COB_ID = 0x6000_07FF  # 11-bit identifier, no producer (bit 30), no 29-bit frame (bit 29)

# fmt: off
OBJECTS = tuple(DriveObject(*row) for row in (
    # index   sub  type   name                          access   mask     guard
    (0x1000, 0x0, "u32", "device_type",                 _VERIFY, 0xFFFF,  1),  # 402
    (0x1005, 0x0, "u32", "sync_cob_id",                 _SET,    _COB_ID, 1),  # it consumes SYNC
    (0x1016, 0x1, "u32", "heartbeat_consumer",          _SET,    -1,      1),  # node << 16 | ms
    (0x1017, 0x0, "u16", "heartbeat_producer",          _SET,    -1,      1),  # ms
    (0x1029, 0x1, "u8",  "communication_error",         _SET,    -1,      0),  # 0: PRE-OP, 2: stop
    (0x6007, 0x0, "i16", "abort_connection",            _SET,    -1,      1),  # 1 fault, 3 stop
    (0x605A, 0x0, "i16", "quick_stop_option",           _SET,    -1,      0),  # 5..8: stays there
    (0x605B, 0x0, "i16", "shutdown_option",             _SET,    -1,      0),
    (0x605C, 0x0, "i16", "disable_operation_option",    _SET,    -1,      0),
    (0x605D, 0x0, "i16", "halt_option",                 _SET,    -1,      1),
    (0x605E, 0x0, "i16", "fault_reaction_option",       _SET,    -1,      0),
    (0x6085, 0x0, "u32", "quick_stop_deceleration",     _SET,    -1,      1),
    # Scale from counts to motion: a wrong value scales every motion without any error.
    (0x608F, 0x1, "u32", "encoder_increments",          _VERIFY, -1,      1),
    (0x608F, 0x2, "u32", "encoder_motor_revolutions",   _VERIFY, -1,      1),
    (0x6091, 0x1, "u32", "gear_motor_revolutions",      _SET,    -1,      1),
    (0x6091, 0x2, "u32", "gear_shaft_revolutions",      _SET,    -1,      1),
    (0x6092, 0x1, "u32", "feed",                        _SET,    -1,      1),
    (0x6092, 0x2, "u32", "feed_shaft_revolutions",      _SET,    -1,      1),
    (0x60A8, 0x0, "u32", "position_unit",               _SET,    -1,      1),  # Nanotec
    (0x60A9, 0x0, "u32", "velocity_unit",               _SET,    -1,      1),  # Nanotec
    (0x2030, 0x0, "u32", "pole_pairs",                  _VERIFY, -1,      1),  # Nanotec
    (0x6060, 0x0, "i8",  "mode_of_operation",           _SET,    -1,      1),  # 10: cyclic torque
    # Limits of force and motion.
    (0x6072, 0x0, "u16", "max_torque",                  _SET,    -1,      1),  # 0.1 % of 0x6076
    (0x6073, 0x0, "u16", "max_current",                 _SET,    -1,      1),  # 0.1 % of 0x6075
    (0x2031, 0x0, "u32", "max_motor_current",           _SET,    -1,      1),  # Nanotec, mA
    (0x607D, 0x1, "i32", "position_low",                _SET,    -1,      0),  # counts
    (0x607D, 0x2, "i32", "position_high",               _SET,    -1,      0),
    (0x6065, 0x0, "u32", "following_error_window",      _SET,    -1,      1),
    (0x6066, 0x0, "u16", "following_error_time",        _SET,    -1,      0),  # ms
    (0x6067, 0x0, "u32", "position_window",             _SET,    -1,      0),
    (0x6068, 0x0, "u16", "position_window_time",        _SET,    -1,      0),  # ms
    (0x6080, 0x0, "u32", "max_motor_speed",             _SET,    -1,      1),
    (0x6083, 0x0, "u32", "profile_acceleration",        _SET,    -1,      1),
    (0x6084, 0x0, "u32", "profile_deceleration",        _SET,    -1,      1),
    (0x2034, 0x0, "u32", "voltage_high_warning",        _SET,    -1,      1),  # Nanotec, mV
    (0x2035, 0x0, "u32", "voltage_low_warning",         _SET,    -1,      1),  # Nanotec, mV
    # Scale of the command.
    (0x6075, 0x0, "u32", "rated_current",               _VERIFY, -1,      1),  # mA
    (0x6076, 0x0, "u32", "rated_torque",                _VERIFY, -1,      1),  # mN m
    (0x20D8, 0xC, "u16", "amc_peak_current",            _VERIFY, -1,      1),  # AMC Kp, 0.1 A
    (0x60C2, 0x1, "u8",  "interpolation_time",          _SET,    -1,      1),  # x 10^exponent s
    (0x60C2, 0x2, "i8",  "interpolation_exponent",      _SET,    -1,      0),
    (0x6098, 0x0, "i8",  "homing_method",               _SET,    -1,      1),
    (0x6099, 0x1, "u32", "homing_speed_switch",         _SET,    -1,      1),
    (0x6099, 0x2, "u32", "homing_speed_zero",           _SET,    -1,      1),
    (0x609A, 0x0, "u32", "homing_acceleration",         _SET,    -1,      1),
    (0x607C, 0x0, "i32", "home_offset",                 _SET,    -1,      0),
))
# fmt: on

BY_NAME = {item.name: item for item in OBJECTS}

# Objects that every drive's configuration must contain: a value, or null if the drive lacks it.
REQUIRED = frozenset((
    "device_type", "sync_cob_id", "heartbeat_consumer", "heartbeat_producer", "abort_connection",
    "quick_stop_option", "fault_reaction_option", "encoder_increments",
    "encoder_motor_revolutions", "gear_motor_revolutions", "gear_shaft_revolutions", "feed",
    "feed_shaft_revolutions", "max_torque", "max_current", "position_low", "position_high",
))  # fmt: skip
