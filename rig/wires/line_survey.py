"""Survey of a Modbus line: the units that answer, and their present values. It only reads."""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from drivers.errors import CodecError
from drivers.modbus import registers
from drivers.modbus.line import ExceptionResponseError, Line, LineError
from drivers.modbus.registers import RegisterBlock
from rig.wires.modbus_poller import (
    BUSY_PAUSE_S,
    PolledBlock,
    create_line,
    parse_blocks,
    retry_while_busy,
)
from rig.wires.wire_check import port_problem, tcp_problem


class SurveyedValue(NamedTuple):
    """One present value of a unit."""

    name: str
    value: float
    unit: str
    plausible: bool  # whether the value is plausible


class UnitSurvey(NamedTuple):
    """The survey of one block of registers of a Modbus unit."""

    name: str
    unit: int
    registers: str
    answers: bool
    answered_in_s: float  # from request to answer
    age: float | None  # s, from the request to the end of the line's survey; None: no answer
    written_by_run: bool  # so its content is no measurement
    values: tuple[SurveyedValue, ...]
    trouble: str


class LineSurvey(NamedTuple):
    """The survey of one line."""

    name: str
    kind: str  # tcp, rtu
    address: str
    trouble: str  # why the line is out of reach; empty: it is not
    units: tuple[UnitSurvey, ...]


def unit_troubles(line: LineSurvey) -> Iterator[str]:
    """Yield the problems of a line and of its units."""
    if line.trouble:
        yield f"line {line.name} at {line.address}: {line.trouble}"
        return
    for unit in line.units:
        if unit.trouble:
            yield f"{unit.name} (unit {unit.unit} on {line.name}): {unit.trouble}"


def survey_line(name: str, config: dict[str, Any]) -> LineSurvey:
    """Survey every unit of a Modbus line; ``config`` is that of the line's poller."""
    settings = config["settings"]
    rtu = config["kind"] == "rtu"
    address = settings["port"] if rtu else f"{settings['host']}:{settings['port']}"
    why = port_problem(address) if rtu else tcp_problem(settings["host"], settings["port"])
    survey = LineSurvey(name, config["kind"], address, why, ())
    if why:
        return survey
    units: list[UnitSurvey] = []
    requested_at: list[float] = []
    line = create_line(config, [])
    try:
        for polled_block in parse_blocks(config):
            if not rtu:  # a silent unit costs the connection
                line.close()
                line = create_line(config, [])
            requested_at.append(time.monotonic())
            units.append(_survey_unit(line, polled_block))
            if line.open_count == 0:
                return survey._replace(trouble=units[-1].trouble)
    finally:
        line.close()
    now = time.monotonic()
    return survey._replace(
        units=tuple(
            unit._replace(age=now - at) if unit.answers else unit
            for unit, at in zip(units, requested_at, strict=True)
        )
    )


def _survey_unit(line: Line, polled_block: PolledBlock) -> UnitSurvey:
    block, requested_at = polled_block.block, time.monotonic()
    last = block.first + block.size - 1
    where = f"{block.table} {block.first}" + (f"-{last}" if block.size > 1 else "")
    written = polled_block.written
    survey = UnitSurvey(polled_block.name, block.unit, where, False, 0.0, None, written, (), "")
    try:
        raw = _read_block(line, block)
    except LineError as error:
        if written and isinstance(error, ExceptionResponseError):  # its outputs cannot be read
            return survey._replace(answers=True, answered_in_s=time.monotonic() - requested_at)
        return survey._replace(trouble=str(error).removeprefix(f"{line.name}: unit {block.unit}, "))
    survey = survey._replace(answers=True, answered_in_s=time.monotonic() - requested_at)
    if written:
        return survey
    try:
        numbers = registers.decode(block, raw, polled_block.high_word_first)
    except CodecError as error:
        return survey._replace(trouble=str(error))
    implausible = registers.implausible_values(block, numbers)
    values = tuple(
        SurveyedValue(name, number, unit, name not in implausible)
        for (name, unit), number in zip(polled_block.signals, numbers, strict=True)
    )
    text = ", ".join(f"{each.name} = {each.value:g}" for each in values if not each.plausible)
    return survey._replace(
        values=values, trouble=f"{text} is implausible; swapped words?" if text else ""
    )


def _read_block(line: Line, block: RegisterBlock) -> list[int]:
    """Return a block's registers; repeat the request while the unit is busy."""
    attempts = retry_while_busy(lambda: line.read(block))
    while True:
        try:
            next(attempts)
        except StopIteration as end:
            raw: list[int] = end.value
            return raw
        time.sleep(BUSY_PAUSE_S)
