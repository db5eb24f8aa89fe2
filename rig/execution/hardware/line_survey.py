"""Who answers on a Modbus line, and what each unit gives now. It only reads."""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple, get_type_hints

from drivers.errors import CodecError
from drivers.modbus import registers
from drivers.modbus.line import Line, LineError, RefusedError
from drivers.modbus.registers import Block
from rig.execution.hardware.messages import SLOTS
from rig.execution.hardware.modbus_poller import BUSY_PAUSE, Polled, blocks_of, line_of, repeated
from rig.execution.hardware.wire_check import port_trouble, tcp_trouble


class ValueFound(NamedTuple):
    """One value as a unit gives it now."""

    name: str
    value: float
    unit: str
    believed: bool  # it can be


class UnitFound(NamedTuple):
    """One block of registers of a Modbus unit."""

    name: str
    unit: int
    registers: str
    answers: bool
    took: float  # s from question to answer
    asked: float  # s, monotonic
    told: bool  # a run writes it: what is read is no measurement
    values: tuple[ValueFound, ...]
    trouble: str


class LineFound(NamedTuple):
    """One line."""

    name: str
    kind: str  # tcp, rtu
    address: str
    trouble: str  # why nobody could be asked
    units: tuple[UnitFound, ...]


def unit_troubles(line: LineFound) -> Iterator[str]:
    """What is wrong with a line, or with units on it."""
    if line.trouble:
        yield f"line {line.name} at {line.address}: {line.trouble}"
        return
    for unit in line.units:
        if unit.trouble:
            yield f"{unit.name} (unit {unit.unit} on {line.name}): {unit.trouble}"


def look_at_line(name: str, config: dict[str, Any]) -> LineFound:
    """Every unit of a Modbus line, as `rig.execution.hardware.modbus_poller` would ask it."""
    settings = config["settings"]
    rtu = config["kind"] == "rtu"
    address = settings["port"] if rtu else f"{settings['host']}:{settings['port']}"
    why = port_trouble(address) if rtu else tcp_trouble(settings["host"], settings["port"])
    found = LineFound(name, config["kind"], address, why, ())
    if why:
        return found
    units = []
    line = line_of(config, [])
    try:
        for polled in blocks_of(config):
            if not rtu:  # a unit that is silent costs the connection
                line.close()
                line = line_of(config, [])
            units.append(_unit(line, polled))
            if line.opened == 0:
                return found._replace(trouble=units[-1].trouble)
    finally:
        line.close()
    return found._replace(units=tuple(units))


def _unit(line: Line, polled: Polled) -> UnitFound:
    block, asked = polled.block, time.monotonic()
    last = block.first + block.size - 1
    where = f"{block.table} {block.first}" + (f"-{last}" if block.size > 1 else "")
    found = UnitFound(polled.name, block.unit, where, False, 0.0, asked, polled.written, (), "")
    try:
        raw = _read(line, block)
    except LineError as error:
        if polled.written and isinstance(error, RefusedError):  # its outputs are not to be read
            return found._replace(answers=True, took=time.monotonic() - asked)
        return found._replace(trouble=str(error).removeprefix(f"{line.name}: unit {block.unit}, "))
    found = found._replace(answers=True, took=time.monotonic() - asked)
    if polled.written:
        return found
    try:
        numbers = registers.decode(block, raw, polled.high_first)
    except CodecError as error:
        return found._replace(trouble=str(error))
    wrong = registers.implausible(block, numbers)
    units = units_of(SLOTS[polled.name])
    values = tuple(
        ValueFound(value.name, number, units.get(value.name, ""), value.name not in wrong)
        for value, number in zip(block.values, numbers, strict=True)
    )
    text = ", ".join(f"{one.name} = {one.value:g}" for one in values if not one.believed)
    return found._replace(
        values=values, trouble=f"{text} cannot be; swapped words?" if text else ""
    )


def _read(line: Line, block: Block) -> list[int]:
    """A block's registers, also of a unit that is busy now and then."""
    asking = repeated(lambda: line.read(block))
    while True:
        try:
            next(asking)
        except StopIteration as end:
            found: list[int] = end.value
            return found
        time.sleep(BUSY_PAUSE)


def units_of(word: type) -> dict[str, str]:
    """The unit of each value of a word."""
    hints = get_type_hints(word, include_extras=True)
    return {field: hint.__metadata__[0] for field, hint in hints.items()}
