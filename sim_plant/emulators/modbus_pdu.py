"""The application layer of Modbus, device's side: one request to one answer.

Modbus application protocol V1.1b3: functions 1-6, 15, 16, 22, 23 and the exceptions.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

MOST_WORDS_READ = 125
MOST_WORDS_WRITTEN = 123
MOST_BITS_READ = 2000
MOST_BITS_WRITTEN = 1968


class Table(IntEnum):
    """The four address spaces of a unit."""

    COILS = 0
    DISCRETE_INPUTS = 1
    HOLDING = 2
    INPUT = 3


class Refused(IntEnum):
    """Exception codes."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    BUSY = 6
    NO_ANSWER_BEHIND_GATEWAY = 11


class RefusalError(Exception):
    """A request that is answered by an exception code."""

    def __init__(self, code: Refused) -> None:
        """`code`: what the host is told."""
        super().__init__(code.name)
        self.code = code


class Registers(Protocol):
    """What a unit holds; addresses are those of the wire, from 0."""

    def read(self, table: Table, first: int, count: int) -> Sequence[int]:
        """Give `count` bits (0 or 1) or words; RefusalError where one is not defined."""
        ...

    def write(self, table: Table, first: int, values: Sequence[int]) -> None:
        """Take all values or none; RefusalError where one may not be written."""
        ...


READS = {1: Table.COILS, 2: Table.DISCRETE_INPUTS, 3: Table.HOLDING, 4: Table.INPUT}


def exception(function: int, code: Refused) -> bytes:
    """Give the exception answer to a function."""
    return bytes((function | 0x80, code))


def answer(unit: Registers, pdu: bytes) -> bytes:
    """Give the answer to one request (function code and data, without address and check sum)."""
    function = pdu[0] if pdu else 0
    try:
        return _answered(unit, function, pdu[1:])
    except RefusalError as refusal:
        return exception(function, refusal.code)
    except struct.error:
        return exception(function, Refused.ILLEGAL_VALUE)


def _answered(unit: Registers, function: int, body: bytes) -> bytes:
    if function in READS:
        first, count = struct.unpack(">HH", body)
        return bytes((function,)) + _read(unit, READS[function], first, count)
    if function in (5, 6):
        first, value = struct.unpack(">HH", body)
        if function == 5:
            _expect(value in (0x0000, 0xFF00))
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
    raise RefusalError(Refused.ILLEGAL_FUNCTION)


def _expect(valid: bool) -> None:
    if not valid:
        raise RefusalError(Refused.ILLEGAL_VALUE)


def _read(unit: Registers, table: Table, first: int, count: int) -> bytes:
    bits = table in (Table.COILS, Table.DISCRETE_INPUTS)
    _expect(1 <= count <= (MOST_BITS_READ if bits else MOST_WORDS_READ))
    values = unit.read(table, first, count)
    if not bits:
        return bytes((2 * count,)) + struct.pack(f">{count}H", *values)
    packed = sum(bit << place for place, bit in enumerate(values))
    size = (count + 7) // 8
    return bytes((size,)) + packed.to_bytes(size, "little")


def _write(unit: Registers, table: Table, first: int, count: int, size: int, data: bytes) -> None:
    if table is Table.COILS:
        _expect(1 <= count <= MOST_BITS_WRITTEN and size == len(data) == (count + 7) // 8)
        packed = int.from_bytes(data, "little")
        unit.write(table, first, [packed >> place & 1 for place in range(count)])
    else:
        _expect(1 <= count <= MOST_WORDS_WRITTEN and size == len(data) == 2 * count)
        unit.write(table, first, struct.unpack(f">{count}H", data))
