"""Access of compiled code to the records in flat memory (`rig.realtime.tick_memory`).

Compiled NamedTuples of numbers have the layout of that memory, so that a whole record is one load.
Reading number by number takes the compiler several times as long.
"""

from collections.abc import Iterator
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from rig.compilation.column_type import ColumnType

_LLVM: Any = vars(cgutils)["ir"]  # llvmlite.ir, with which numba builds its code
_NUMBERS = {types.float64: _LLVM.DoubleType(), types.int64: _LLVM.IntType(64)}

FLOAT, INT = types.float64, types.int64
FLOATS, INTS = ColumnType(types.float64), ColumnType(types.int64)  # address and length


def record(kind: Any, *members: Any) -> Any:
    """Return the type of a NamedTuple ``kind`` whose members have these types."""
    if members and all(member == members[0] for member in members):
        return types.NamedUniTuple(members[0], len(members), kind)
    return types.NamedTuple(members, kind)


def plain(*members: Any) -> Any:
    """Return the type of a tuple whose members have these types."""
    return types.Tuple(members)


def loader(kind: Any) -> Any:
    """Return the function that reads a record of a type at an address."""

    @intrinsic
    def load(context: Any, address: Any) -> Any:
        def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = target.get_value_type(kind).as_pointer()
            return builder.load(builder.inttoptr(arguments[0], pointer))

        return kind(types.int64), code

    return load


def storer(kind: Any) -> Any:
    """Return the procedure that writes a record to an address where one of a type stands."""
    expected = tuple(_leaves(kind))

    @intrinsic
    def store(context: Any, address: Any, value: Any) -> Any:
        given = tuple(_leaves(value))
        if len(given) != len(expected):
            raise TypingError(f"a record of {len(expected)} numbers becomes {value}")
        for number, before in zip(given, expected, strict=True):
            allowed = (types.Integer, types.Boolean, *([types.Float] if before == FLOAT else []))
            if not isinstance(number, allowed):
                raise TypingError(f"a number that starts as {before} becomes {number}")

        def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            where, record = arguments
            numbers = _extract(builder, record, value)
            for i, (number, own, stored) in enumerate(zip(numbers, given, expected, strict=True)):
                place = builder.inttoptr(where, _NUMBERS[stored].as_pointer())
                index = _LLVM.Constant(_LLVM.IntType(64), i)
                cast = target.cast(builder, number, own, stored)
                builder.store(cast, builder.gep(place, [index]))

        return types.void(types.int64, value), code

    return store


def _leaves(kind: Any) -> Iterator[Any]:
    """Yield the types of the numbers of a record in order."""
    members = getattr(kind, "types", None)
    if members is None:
        yield kind
        return
    for member in members:
        yield from _leaves(member)


def _extract(builder: Any, value: Any, kind: Any) -> Iterator[Any]:
    """Yield the numbers of a compiled record in order."""
    members = getattr(kind, "types", None)
    if members is None:
        yield value
        return
    for i, member in enumerate(members):
        yield from _extract(builder, builder.extract_value(value, i), member)
