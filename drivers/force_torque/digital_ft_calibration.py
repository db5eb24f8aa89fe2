"""The calibration stored in an ATI Digital F/T: 169 registers, and the requests that read them.

One request reads at most 125 registers, so the block takes at least two requests.
Source: ATI 9620-05-Digital FT, section 8, from two public implementations that agree; both take
floats and integers as big-endian and the matrix row by row.
"""

import math
import struct
from typing import NamedTuple

from drivers.checksums import modbus_crc16
from drivers.errors import CodecError
from drivers.force_torque.digital_ft import UNIT
from drivers.force_torque.wrench import Matrix, Scale, Vector6, make_scale

FIRST_REGISTER, REGISTERS, MAX_REGISTERS = 0x00E3, 169, 125
BLOCK_SIZE = 2 * REGISTERS
_READ_HOLDING = 0x03
_LAYOUT = struct.Struct(">8s32s4s20s36fBB6fii6H6H6B6B6H16s16s16s")
_SUBJECT = "Digital F/T calibration"


class Calibration(NamedTuple):
    """The manufacturer's calibration of one sensor."""

    serial: str
    part: str
    family: str
    time: str
    matrix: Matrix  # counts of force and torque per gauge count
    force_unit: int  # code of the box; its meaning is not confirmed
    torque_unit: int
    ratings: Vector6  # largest permitted loads, in those units
    per_force: int  # counts per force unit
    per_torque: int
    gains: tuple[int, ...]  # of the gauges' amplifiers
    offsets: tuple[int, ...]


def encode_read(first: int, count: int, unit: int = UNIT) -> bytes:
    """Return the request that reads holding registers; CodecError for more than 125."""
    if not (1 <= count <= MAX_REGISTERS and first >= 0 and first + count <= 0x10000):
        raise CodecError("register read", "range", "1 to 125 registers", (first, count))
    body = struct.pack(">BBHH", unit, _READ_HOLDING, first, count)
    return body + modbus_crc16(body).to_bytes(2, "little")


def decode_read(count: int, reply: bytes, unit: int = UNIT) -> bytes:
    """Return the 2 * count bytes in the answer to `encode_read`; CodecError for any other one."""
    if len(reply) < 5:
        raise CodecError("register reply", "length", "5 bytes or more", len(reply))
    body = reply[:-2]
    expected, received = modbus_crc16(body), int.from_bytes(reply[-2:], "little")
    if expected != received:
        raise CodecError("register reply", "check sum", f"{expected:04x}", f"{received:04x}")
    if body[0] != unit:
        raise CodecError("register reply", "unit", str(unit), body[0])
    if body[1] == _READ_HOLDING | 0x80:
        raise CodecError("register reply", "function", "registers", f"exception {body[2]}")
    if body[1] != _READ_HOLDING or body[2] != 2 * count or len(body) != 3 + 2 * count:
        raise CodecError("register reply", "header", f"03 {2 * count:02x}", body[1:3].hex(" "))
    return body[3:]


def decode_calibration(block: bytes) -> Calibration:
    """Return the calibration in the 338 bytes of the block; CodecError for an invalid number."""
    if len(block) != BLOCK_SIZE:
        raise CodecError(_SUBJECT, "length", f"{BLOCK_SIZE} bytes", len(block))
    fields = _LAYOUT.unpack(block)
    cells, ratings = fields[4:40], fields[42:48]
    if not all(math.isfinite(number) for number in (*cells, *ratings)):
        raise CodecError(_SUBJECT, "matrix and ratings", "finite numbers", "NaN or infinity")
    per_force, per_torque = fields[48], fields[49]
    if per_force <= 0 or per_torque <= 0:
        raise CodecError(_SUBJECT, "counts per unit", "above 0", (per_force, per_torque))
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


def calibration_scale(calibration: Calibration, force_unit: str, torque_unit: str) -> Scale:
    """Return the scale from calibrated counts to SI; unit names as on the sensor's certificate."""
    return make_scale(calibration.per_force, calibration.per_torque, force_unit, torque_unit)


def _six(numbers: tuple[float, ...]) -> Vector6:
    a, b, c, d, e, f = numbers
    return a, b, c, d, e, f


def _text(field: bytes) -> str:
    return field.split(b"\x00")[0].decode("ascii", "replace").strip()
