"""The objects of the emulated Compax3: a subset, with format and access.

Source: Parker manuals 192-1201xx, object overview. Not confirmed for a T10, and therefore
parameters: the objects of the set-points (here the first rows of the free array), the order of the
stop bits, and the refusal codes.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.emulators.compax3_records import Format
from sim_plant.units import Flag, Second

ObjectNumber = tuple[int, int]  # index, subindex


class DriveObject(NamedTuple):
    """One object."""

    name: str
    format: Format
    writable: Flag = 0


CONTROL: ObjectNumber = (1100, 3)
STATUS: ObjectNumber = (1000, 3)
LAST_ERROR: ObjectNumber = (550, 1)
SERIAL_NUMBER: ObjectNumber = (1, 4)

OBJECTS: dict[ObjectNumber, DriveObject] = {
    (680, 4): DriveObject("position_demand", "REAL48"),
    (680, 5): DriveObject("position", "REAL48"),
    (680, 6): DriveObject("following_error", "REAL48"),
    (681, 4): DriveObject("speed_demand", "REAL48"),
    (681, 5): DriveObject("speed", "REAL48"),
    (681, 9): DriveObject("speed_filtered", "REAL48"),
    (688, 1): DriveObject("current_demand", "REAL48"),
    (688, 2): DriveObject("current", "REAL48"),
    (683, 2): DriveObject("device_load", "REAL48"),
    (683, 3): DriveObject("motor_load", "REAL48"),
    (684, 1): DriveObject("device_temperature", "REAL48"),
    (684, 2): DriveObject("motor_temperature", "REAL48"),
    (685, 2): DriveObject("bus_voltage", "REAL48"),
    (685, 3): DriveObject("analog_0", "REAL48"),
    (685, 4): DriveObject("analog_1", "REAL48"),
    (170, 2): DriveObject("analog_0_gain", "REAL48", 1),
    (170, 4): DriveObject("analog_0_offset", "REAL48", 1),
    (171, 2): DriveObject("analog_1_gain", "REAL48", 1),
    (171, 4): DriveObject("analog_1_offset", "REAL48", 1),
    LAST_ERROR: DriveObject("last_error", "INT24"),
    STATUS: DriveObject("status", "INT24"),
    CONTROL: DriveObject("control", "INT24", 1),
    SERIAL_NUMBER: DriveObject("serial_number", "INT24"),
    **{
        (index, sub): DriveObject(f"array_{index}_{sub}", "REAL48", 1)
        for index in range(1900, 1911)
        for sub in range(1, 10)
    },
}


class ErrorCodes(NamedTuple):
    """Error codes in o550.1; `undervoltage` and `host_silent` are not confirmed."""

    none: int = 1
    motor_temperature: int = 17168
    following_error: int = 29472
    limit_low: int = 29475
    limit_high: int = 29476
    undervoltage: int = 0x3220
    host_silent: int = 0x8130


class RefusalCodes(NamedTuple):
    """Codes of negative answers, after DS 402 and DriveCom; not confirmed."""

    no_such_object: int = 0x0602
    read_only: int = 0x0601
    bad_value: int = 0x0609
    bad_syntax: int = 0x0604
    bad_sum: int = 0x0504


class Compax3Settings(NamedTuple):
    """Settings of a drive; its objects use motor rev/s for speeds, rev for positions, N m."""

    address: int | None = None  # 0 to 99 on RS-485; None: RS-232
    name: str = "Compax3 S063 V2 F10 I10 T10 M00"
    serial_number: int = 123456
    source: str = "serial"  # or "analog": the ±10 V input is the velocity command
    velocity: ObjectNumber = (1901, 1)  # rev/s; not confirmed
    torque: ObjectNumber = (1902, 1)  # N m; not confirmed
    full_speed: float = 37.5  # rev/s at 10 V (OSWEC thesis)
    full_torque: float = 11.54  # N m: larger set-points are refused (MPP092, OSWEC thesis)
    stop_bits_active_low: Flag = 0  # control word 1, bits 1 and 14; not confirmed
    host_timeout: Second = 0.0  # without a complete record or line; 0: no timeout
    reply_delay: Second = 0.0
    late_by: Second = 0.5
    errors: ErrorCodes = ErrorCodes()
    refusals: RefusalCodes = RefusalCodes()
