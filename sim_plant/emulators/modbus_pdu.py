"""The application layer of a Modbus device: the answer to one request.

Modbus application protocol V1.1b3: functions 1-6, 15, 16, 22, 23 and the exceptions.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

MAX_REGISTERS_READ = 125
MAX_REGISTERS_WRITTEN = 123
MAX_BITS_READ = 2000
MAX_BITS_WRITTEN = 1968


class Table(IntEnum):
    """The four address spaces of a unit."""

    COILS = 0
    DISCRETE_INPUTS = 1
    HOLDING = 2
    INPUT = 3


class ExceptionCode(IntEnum):
    """Exception codes."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    BUSY = 6
    NO_ANSWER_BEHIND_GATEWAY = 11


class ModbusRefusalError(Exception):
    """A request that is answered by an exception code."""

    def __init__(self, code: ExceptionCode) -> None:
        """`code`: exception code for the host."""
        super().__init__(code.name)
        self.code = code


class Registers(Protocol):
    """Registers of a unit; addresses are those on the wire, from 0."""

    def read(self, table: Table, first: int, count: int) -> Sequence[int]:
        """Return `count` bits (0 or 1) or words. Raises ModbusRefusalError for undefined ones."""
        ...

    def write(self, table: Table, first: int, values: Sequence[int]) -> None:
        """Write all values or none. Raises ModbusRefusalError if one may not be written."""
        ...


READS = {1: Table.COILS, 2: Table.DISCRETE_INPUTS, 3: Table.HOLDING, 4: Table.INPUT}


def exception(function: int, code: ExceptionCode) -> bytes:
    """Return the exception response to a function."""
    return bytes((function | 0x80, code))


def answer_request(unit: Registers, pdu: bytes) -> bytes:
    """Return the answer to one request (function code and data, without address and check sum)."""
    function = pdu[0] if pdu else 0
    try:
        return _execute(unit, function, pdu[1:])
    except ModbusRefusalError as refusal:
        return exception(function, refusal.code)
    except struct.error:
        return exception(function, ExceptionCode.ILLEGAL_VALUE)


def _execute(unit: Registers, function: int, body: bytes) -> bytes:
    if function in READS:
        first, count = struct.unpack(">HH", body)
        return bytes((function,)) + _read(unit, READS[function], first, count)
    if function in (5, 6):
        first, value = struct.unpack(">HH", body)
        if function == 5:
            _require_valid(value in (0x0000, 0xFF00))
            unit.write(Table.COILS, first, [value >> 15])
        else:
            unit.write(Table.HOLDING, first, [value])
        return bytes((function,)) + body
    if function in (15, 16):
        first, count, size = struct.unpack(">HHB", body[:5])
        table = Table.COILS if function == 15 else Table.HOLDING
        _write(unit, table, first, count, size, body[5:])
        return bytes((function,)) + body[:4]
    if function == 22:
        address, keep, change = struct.unpack(">HHH", body)
        value = unit.read(Table.HOLDING, address, 1)[0]
        unit.write(Table.HOLDING, address, [(value & keep) | (change & ~keep & 0xFFFF)])
        return bytes((function,)) + body
    if function == 23:
        first, count, target, amount, size = struct.unpack(">HHHHB", body[:9])
        _write(unit, Table.HOLDING, target, amount, size, body[9:])
        return bytes((function,)) + _read(unit, Table.HOLDING, first, count)
    raise ModbusRefusalError(ExceptionCode.ILLEGAL_FUNCTION)


def _require_valid(valid: bool) -> None:
    if not valid:
        raise ModbusRefusalError(ExceptionCode.ILLEGAL_VALUE)


def _read(unit: Registers, table: Table, first: int, count: int) -> bytes:
    bits = table in (Table.COILS, Table.DISCRETE_INPUTS)
    _require_valid(1 <= count <= (MAX_BITS_READ if bits else MAX_REGISTERS_READ))
    values = unit.read(table, first, count)
    if not bits:
        return bytes((2 * count,)) + struct.pack(f">{count}H", *values)
    packed = sum(bit << place for place, bit in enumerate(values))
    size = (count + 7) // 8
    return bytes((size,)) + packed.to_bytes(size, "little")


def _write(unit: Registers, table: Table, first: int, count: int, size: int, data: bytes) -> None:
    if table is Table.COILS:
        _require_valid(1 <= count <= MAX_BITS_WRITTEN and size == len(data) == (count + 7) // 8)
        packed = int.from_bytes(data, "little")
        unit.write(table, first, [packed >> place & 1 for place in range(count)])
    else:
        _require_valid(1 <= count <= MAX_REGISTERS_WRITTEN and size == len(data) == 2 * count)
        unit.write(table, first, struct.unpack(f">{count}H", data))
