"""The number formats of Compax3 objects in binary records, all big-endian.

FRACT24 and DFRACT48 are left out on purpose: the manuals give their width, not their scale.
Source: Compax3 manual 192-120100 (I10T10), 5.2.3 binary record.
"""

import math
import struct
from enum import IntEnum

from drivers.errors import CodecError


class NumberFormat(IntEnum):
    """Number format of an object's value in a record."""

    INT24 = 0  # DSP format, 3 bytes, signed
    REAL48 = 1  # DSP format, 3 bytes of integer and 3 of fraction, signed as one number
    DINT48 = 2  # DSP format, 6 bytes, signed
    U16 = 3  # PLC format
    U32 = 4  # PLC format
    F32 = 5  # PLC format, IEEE 754


WIDTH = {
    NumberFormat.INT24: 3,
    NumberFormat.REAL48: 6,
    NumberFormat.DINT48: 6,
    NumberFormat.U16: 2,
    NumberFormat.U32: 4,
    NumberFormat.F32: 4,
}
PLC_FORMATS = frozenset({NumberFormat.U16, NumberFormat.U32, NumberFormat.F32})
_SIGNED = frozenset({NumberFormat.INT24, NumberFormat.REAL48, NumberFormat.DINT48})
_REAL48_ONE = float(1 << 24)
_LARGEST = float(1 << 48)  # of any integer format; keeps the scaling below finite
_F32_MAX = 3.4028234663852886e38


def is_plc(number_format: NumberFormat) -> bool:
    """Return True when a request for this format must set the PLC bit of its start code."""
    return number_format in PLC_FORMATS


def encode_value(number_format: NumberFormat, value: float) -> bytes:
    """Return the bytes of a number; REAL48 rounds to 2**-24.

    CodecError for NaN, infinity, a fraction in an integer format, and a value out of range.
    """
    what = f"Compax3 {number_format.name}"
    if not math.isfinite(value):
        raise CodecError(what, "value", "a finite number", value)
    if number_format is NumberFormat.F32:
        if abs(value) > _F32_MAX:
            raise CodecError(what, "value", "a magnitude of 3.4e38 at most", value)
        return struct.pack(">f", value)
    if abs(value) > _LARGEST:
        raise CodecError(what, "value", "a magnitude of 2**48 at most", value)
    scaled = value * _REAL48_ONE if number_format is NumberFormat.REAL48 else value
    number = round(scaled)
    if number_format is not NumberFormat.REAL48 and number != scaled:
        raise CodecError(what, "value", "a whole number", value)
    width, signed = WIDTH[number_format], number_format in _SIGNED
    low = -(1 << 8 * width - 1) if signed else 0
    high = (1 << 8 * width - signed) - 1
    if not low <= number <= high:
        raise CodecError(what, "value", f"{low} to {high} steps", number)
    return number.to_bytes(width, "big", signed=signed)


def decode_value(number_format: NumberFormat, data: bytes) -> float:
    """Return the number in ``data``, exact; CodecError for a wrong length, NaN or infinity."""
    what = f"Compax3 {number_format.name}"
    if len(data) != WIDTH[number_format]:
        raise CodecError(what, "length", f"{WIDTH[number_format]} bytes", data.hex(" ") or "none")
    if number_format is NumberFormat.F32:
        value = float(struct.unpack(">f", data)[0])
        if not math.isfinite(value):
            raise CodecError(what, "value", "a finite number", value)
        return value
    number = int.from_bytes(data, "big", signed=number_format in _SIGNED)
    return number / _REAL48_ONE if number_format is NumberFormat.REAL48 else float(number)


def decode_values(number_formats: tuple[NumberFormat, ...], data: bytes) -> tuple[float, ...]:
    """Return the numbers of a response, in the order of the requested objects."""
    expected = sum(WIDTH[form] for form in number_formats)
    if len(data) != expected:
        raise CodecError("Compax3 response", "data", f"{expected} bytes", data.hex(" ") or "none")
    values, at = [], 0
    for form in number_formats:
        values.append(decode_value(form, data[at : at + WIDTH[form]]))
        at += WIDTH[form]
    return tuple(values)
