"""The number formats of Compax3 objects in binary records, all big-endian.

FRACT24 and DFRACT48 are left out on purpose: the manuals give their width, not their scale.
Source: Compax3 manual 192-120100 (I10T10), 5.2.3 binary record.
"""

import math
import struct
from enum import IntEnum

from drivers.errors import CodecError


class Form(IntEnum):
    """How an object's value stands in a record."""

    INT24 = 0  # DSP format, 3 bytes, signed
    REAL48 = 1  # DSP format, 3 bytes of integer and 3 of fraction, signed as one number
    DINT48 = 2  # DSP format, 6 bytes, signed
    U16 = 3  # PLC format
    U32 = 4  # PLC format
    F32 = 5  # PLC format, IEEE 754


WIDTH = {Form.INT24: 3, Form.REAL48: 6, Form.DINT48: 6, Form.U16: 2, Form.U32: 4, Form.F32: 4}
PLC_FORMS = frozenset({Form.U16, Form.U32, Form.F32})
_SIGNED = frozenset({Form.INT24, Form.REAL48, Form.DINT48})
_REAL48_ONE = float(1 << 24)
_LARGEST = float(1 << 48)  # of any integer format; keeps the scaling below finite
_F32_MAX = 3.4028234663852886e38


def is_plc(form: Form) -> bool:
    """True when a request for this format must set the PLC bit of its start code."""
    return form in PLC_FORMS


def encode_value(form: Form, value: float) -> bytes:
    """The bytes of a number; REAL48 rounds to 2**-24, the integer formats take whole numbers only.

    CodecError for NaN, infinity, a fraction in an integer format, and what does not fit.
    """
    what = f"Compax3 {form.name}"
    if not math.isfinite(value):
        raise CodecError(what, "value", "a finite number", value)
    if form is Form.F32:
        if abs(value) > _F32_MAX:
            raise CodecError(what, "value", "a magnitude of 3.4e38 at most", value)
        return struct.pack(">f", value)
    if abs(value) > _LARGEST:
        raise CodecError(what, "value", "a magnitude of 2**48 at most", value)
    scaled = value * _REAL48_ONE if form is Form.REAL48 else value
    number = round(scaled)
    if form is not Form.REAL48 and number != scaled:
        raise CodecError(what, "value", "a whole number", value)
    width, signed = WIDTH[form], form in _SIGNED
    low = -(1 << 8 * width - 1) if signed else 0
    high = (1 << 8 * width - signed) - 1
    if not low <= number <= high:
        raise CodecError(what, "value", f"{low} to {high} steps", number)
    return number.to_bytes(width, "big", signed=signed)


def decode_value(form: Form, data: bytes) -> float:
    """The number in ``data``, exact; CodecError for a wrong length, NaN or infinity."""
    what = f"Compax3 {form.name}"
    if len(data) != WIDTH[form]:
        raise CodecError(what, "length", f"{WIDTH[form]} bytes", data.hex(" ") or "none")
    if form is Form.F32:
        value = float(struct.unpack(">f", data)[0])
        if not math.isfinite(value):
            raise CodecError(what, "value", "a finite number", value)
        return value
    number = int.from_bytes(data, "big", signed=form in _SIGNED)
    return number / _REAL48_ONE if form is Form.REAL48 else float(number)


def decode_values(forms: tuple[Form, ...], data: bytes) -> tuple[float, ...]:
    """The numbers of a response, in the order in which their objects were asked for."""
    wanted = sum(WIDTH[form] for form in forms)
    if len(data) != wanted:
        raise CodecError("Compax3 response", "data", f"{wanted} bytes", data.hex(" ") or "none")
    values, at = [], 0
    for form in forms:
        values.append(decode_value(form, data[at : at + WIDTH[form]]))
        at += WIDTH[form]
    return tuple(values)
