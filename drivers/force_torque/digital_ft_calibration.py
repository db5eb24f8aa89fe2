"""The calibration stored in an ATI Digital F/T: 169 registers, and how to ask for them.

A register read carries 125 registers at most, so the block comes in two reads or more.
Source: ATI 9620-05-Digital FT, section 8, in two public readings that agree; that floats and
integers are big-endian and the matrix row by row is theirs too.
"""

import math
import struct
from typing import NamedTuple

from drivers.checksums import modbus_crc16
from drivers.errors import CodecError
from drivers.force_torque.digital_ft import UNIT
from drivers.force_torque.wrench import Matrix, Scale, Six, scale

FIRST_REGISTER, REGISTERS, MOST_REGISTERS = 0x00E3, 169, 125
BLOCK_SIZE = 2 * REGISTERS
_READ_HOLDING = 0x03
_LAYOUT = struct.Struct(">8s32s4s20s36fBB6fii6H6H6B6B6H16s16s16s")
_WHAT = "Digital F/T calibration"


class Calibration(NamedTuple):
    """What the maker measured for this sensor."""

    serial: str
    part: str
    family: str
    time: str
    matrix: Matrix  # counts of force and torque per gauge count
    force_unit: int  # the box's code; which unit it means is not confirmed
    torque_unit: int
    ratings: Six  # the largest loads, in those units
    per_force: int  # counts per force unit
    per_torque: int
    gains: tuple[int, ...]  # of the gauges' amplifiers
    offsets: tuple[int, ...]


def read_registers(first: int, count: int, unit: int = UNIT) -> bytes:
    """The request for holding registers; CodecError beyond 125 of them."""
    if not (1 <= count <= MOST_REGISTERS and first >= 0 and first + count <= 0x10000):
        raise CodecError("register read", "range", "1 to 125 registers", (first, count))
    body = struct.pack(">BBHH", unit, _READ_HOLDING, first, count)
    return body + modbus_crc16(body).to_bytes(2, "little")


def decode_registers(count: int, reply: bytes, unit: int = UNIT) -> bytes:
    """The 2 * count bytes in the answer to `read_registers`; CodecError for any other answer."""
    if len(reply) < 5:
        raise CodecError("register reply", "length", "5 bytes or more", len(reply))
    body = reply[:-2]
    wanted, found = modbus_crc16(body), int.from_bytes(reply[-2:], "little")
    if wanted != found:
        raise CodecError("register reply", "check sum", f"{wanted:04x}", f"{found:04x}")
    if body[0] != unit:
        raise CodecError("register reply", "unit", str(unit), body[0])
    if body[1] == _READ_HOLDING | 0x80:
        raise CodecError("register reply", "function", "registers", f"exception {body[2]}")
    if body[1] != _READ_HOLDING or body[2] != 2 * count or len(body) != 3 + 2 * count:
        raise CodecError("register reply", "header", f"03 {2 * count:02x}", body[1:3].hex(" "))
    return body[3:]


def decode_calibration(block: bytes) -> Calibration:
    """The calibration in the 338 bytes of the block; CodecError when a number makes no sense."""
    if len(block) != BLOCK_SIZE:
        raise CodecError(_WHAT, "length", f"{BLOCK_SIZE} bytes", len(block))
    fields = _LAYOUT.unpack(block)
    cells, ratings = fields[4:40], fields[42:48]
    if not all(math.isfinite(number) for number in (*cells, *ratings)):
        raise CodecError(_WHAT, "matrix and ratings", "finite numbers", "NaN or infinity")
    per_force, per_torque = fields[48], fields[49]
    if per_force <= 0 or per_torque <= 0:
        raise CodecError(_WHAT, "counts per unit", "above 0", (per_force, per_torque))
    rows = [_six(cells[at : at + 6]) for at in range(0, 36, 6)]
    return Calibration(
        serial=_text(fields[0]),
        part=_text(fields[1]),
        family=_text(fields[2]),
        time=_text(fields[3]),
        matrix=(rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]),
        force_unit=fields[40],
        torque_unit=fields[41],
        ratings=_six(ratings),
        per_force=per_force,
        per_torque=per_torque,
        gains=fields[50:56],
        offsets=fields[56:62],
    )


def scaling(calibration: Calibration, force_unit: str, torque_unit: str) -> Scale:
    """SI per calibrated count; the units by name, from the sensor's certificate."""
    return scale(calibration.per_force, calibration.per_torque, force_unit, torque_unit)


def _six(numbers: tuple[float, ...]) -> Six:
    a, b, c, d, e, f = numbers
    return a, b, c, d, e, f


def _text(field: bytes) -> str:
    return field.split(b"\x00")[0].decode("ascii", "replace").strip()
