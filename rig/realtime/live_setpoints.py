"""Set points that people choose while the loop runs: two more entries in the kind's table.

A set point with an odd number has one entry, one with an even number the other, so a new set point
never changes the entry that is in force. The cycle takes it up like that of a new row
(`rig.realtime.sequence`). It travels as its numbers, one for each column of the table. A nested
NamedTuple in the table is no column: it holds what the set points share.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rig.realtime import cycle, tick_memory
from rig.realtime.tick_memory import FlatMemory

Numbers = Sequence[float]


def with_live_entries(params: cycle.Params) -> cycle.Params:
    """Return the parameters with two more set points, copies of the first one."""
    length = len(next(_columns(params.rig.setpoints)))
    longer = _with_table(params, lambda column: (*column, column[0], column[0]))
    return longer._replace(live_setpoint=length)


def numbers_at(table: Any, index: int) -> tuple[float, ...]:
    """Return the numbers of one set point of a table."""
    return tuple(column[index] for column in _columns(table))


def live_columns(params: cycle.Params) -> tuple[float, ...]:
    """Return the numbers of a set point, for their types; none if people choose none."""
    return () if params.live_setpoint < 0 else numbers_at(params.rig.setpoints, 0)


def with_live_setpoint(params: cycle.Params, number: int, numbers: Numbers) -> cycle.Params:
    """Return the parameters with the set point of a number."""
    at, values = params.live_setpoint + (number & 1), iter(numbers)
    return _with_table(params, lambda column: (*column[:at], next(values), *column[at + 1 :]))


def write_live_setpoint(memory: FlatMemory, number: int, numbers: Numbers) -> None:
    """Store the set point of a number in the memory of compiled ticks."""
    params = memory.sections["params"].tree
    at = params.live_setpoint + (number & 1)
    for table, value in zip(_columns(params.rig.setpoints), numbers, strict=True):
        memory.numbers_of("params", table)[at] = value  # of the column's type


def copy_live_setpoints(params: cycle.Params, memory: FlatMemory) -> None:
    """Store the set points of people that are in parameters in the memory of compiled ticks."""
    if params.live_setpoint < 0:
        return
    for at in (params.live_setpoint, params.live_setpoint + 1):
        numbers = numbers_at(params.rig.setpoints, at)
        write_live_setpoint(memory, at - params.live_setpoint, numbers)


def _with_table(params: cycle.Params, change: Callable[[Any], Any]) -> cycle.Params:
    """Return the parameters with each column of the table of set points changed."""
    table = params.rig.setpoints
    changed = type(table)(*(_map(part, change) for part in table))
    return params._replace(rig=params.rig._replace(setpoints=changed))


def _columns(part: Any) -> Iterator[Any]:
    """Yield the columns of a table, tuples or as they are stored in memory."""
    if _is_column(part):
        yield part
        return
    for each in part:
        if not tick_memory.is_named(each) or isinstance(each, tick_memory.Table):
            yield from _columns(each)


def _map(part: Any, change: Callable[[Any], Any]) -> Any:
    if _is_column(part):
        return change(part)
    return part if tick_memory.is_named(part) else tuple(_map(each, change) for each in part)


def _is_column(part: Any) -> bool:
    is_table = isinstance(part, tick_memory.Table)
    return is_table or (len(part) > 0 and isinstance(part[0], int | float))
