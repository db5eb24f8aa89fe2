"""The objects of the Compax3 that the rig uses, its status and control words, and set-points.

The object numbers are those of the I12T11 and T30/T40 manuals. Which of them an I10T10 (the +-10 V
drive) has, in which number format and unit, is not confirmed: an `ObjectChannel` defines it for one
rig, and the device must read each back before it is used. No object for velocity or torque
set-points is common to all drives (it is a free array cell read by the drive's program, or the
analog command), so these channels have no default.
"""

import math
from typing import NamedTuple

from drivers.compax3.codec import (
    NO_ADDRESS,
    Kind,
    Object,
    Record,
    read_request,
    write_request,
)
from drivers.compax3.values import NumberFormat, decode_values, encode_value, is_plc
from drivers.errors import CodecError

SERIAL_NUMBER = Object(1, 4)
STORE = Object(20, 11)  # to flash
DC_BUS_VOLTAGE = Object(85, 2)
ANALOG_0_GAIN, ANALOG_0_OFFSET = Object(170, 2), Object(170, 4)
ANALOG_1_GAIN, ANALOG_1_OFFSET = Object(171, 2), Object(171, 4)
LAST_ERROR = Object(550, 1)
TORQUE_ACTUAL = Object(670, 2)
POSITION_DEMAND, POSITION_ACTUAL, FOLLOWING_ERROR = Object(680, 4), Object(680, 5), Object(680, 6)
SPEED_DEMAND, SPEED_ACTUAL, SPEED_FILTERED = Object(681, 4), Object(681, 5), Object(681, 9)
ACCELERATION_ACTUAL = Object(682, 5)
DEVICE_LOAD, MOTOR_LOAD = Object(683, 2), Object(683, 3)  # %
POWER_STAGE_TEMPERATURE, MOTOR_TEMPERATURE = Object(684, 1), Object(684, 2)
BUS_VOLTAGE = Object(685, 2)
ANALOG_0, ANALOG_1 = Object(685, 3), Object(685, 4)  # V at the inputs, as the drive reads them
CURRENT_DEMAND, CURRENT_ACTUAL = Object(688, 1), Object(688, 2)
STATUS_WORD = Object(1000, 3)
CONTROL_WORD = Object(1100, 3)

NO_ERROR = 1  # value of LAST_ERROR without an error; it is never 0
ERROR_NAMES = {
    NO_ERROR: "none",
    17168: "motor temperature",
    29472: "following error",
    29475: "position beyond the positive end limit",
    29476: "position beyond the negative end limit",
    29479: "change of direction during movement",
}

# Control word 1. The stop bits are active low: clearing one stops.
POWERED_BIT, NOT_STOP_1_BIT, NOT_STOP_2_BIT = 0x0001, 0x0002, 0x4000
POWER_OFF = 0  # stops and removes power
ENABLED = POWERED_BIT | NOT_STOP_1_BIT | NOT_STOP_2_BIT
# A rising edge of the power bit acknowledges an error and also powers the axis. So write POWER_OFF
# first, and write ENABLED only on an explicit request.


class Status(NamedTuple):
    """The bits of status word 1 that the rig uses, each 0 or 1."""

    no_error: int
    position_reached: int
    powerless: int
    standstill: int  # powered, and at rest
    homed: int


class ObjectChannel(NamedTuple):
    """Object, format and scale of one quantity in one drive, from the rig's configuration."""

    target: Object
    number_format: NumberFormat
    per_unit: float  # drive units per SI unit, not 0; negative where the drive counts the other way


def decode_status(word: float) -> Status:
    """Return the bits of a status word as read (0 to 65535); CodecError unless it is 16-bit."""
    if not (math.isfinite(word) and 0 <= word <= 0xFFFF and word == int(word)):
        raise CodecError("Compax3 status word", "value", "0 to 65535", word)
    bits = int(word)
    return Status(bits >> 8 & 1, bits >> 9 & 1, bits >> 10 & 1, bits >> 11 & 1, bits >> 12 & 1)


def error_name(number: int) -> str:
    """Return the text of an error number, as far as public sources list it."""
    return ERROR_NAMES.get(number, f"error {number} (see the drive's manual)")


def encode_set_point(channel: ObjectChannel, value: float, address: int = NO_ADDRESS) -> bytes:
    """Return the record that writes ``value`` (SI); CodecError for NaN and overflow."""
    scale = _scale(channel)
    raw = value * scale
    if channel.number_format not in (NumberFormat.REAL48, NumberFormat.F32) and math.isfinite(raw):
        raw = float(round(raw))
    data = encode_value(channel.number_format, raw)
    return write_request(channel.target, data, address, int(is_plc(channel.number_format)))


def encode_read(channels: tuple[ObjectChannel, ...], address: int = NO_ADDRESS) -> bytes:
    """Return the record that reads several quantities; CodecError unless all DSP or all PLC."""
    families = {is_plc(channel.number_format) for channel in channels}
    if len(families) != 1:
        raise CodecError("Compax3 request", "formats", "all DSP or all PLC", len(channels))
    objects = tuple(channel.target for channel in channels)
    return read_request(objects, address, int(families.pop()))


def decode_actual_values(channels: tuple[ObjectChannel, ...], record: Record) -> tuple[float, ...]:
    """Return the SI values in a response to `encode_read` of these channels; else CodecError."""
    if record.kind is not Kind.RESPONSE:
        raise CodecError("Compax3 response", "kind", "RESPONSE", record.kind.name)
    raw = decode_values(tuple(channel.number_format for channel in channels), record.data)
    return tuple(value / _scale(channel) for value, channel in zip(raw, channels, strict=True))


def _scale(channel: ObjectChannel) -> float:
    if not math.isfinite(channel.per_unit) or abs(channel.per_unit) < 1e-12:
        raise CodecError("Compax3 channel", "scale", "a finite number, not 0", channel.per_unit)
    return channel.per_unit
