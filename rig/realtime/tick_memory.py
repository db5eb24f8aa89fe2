"""Flat memory of a compiled tick: the numbers of its inputs, its state and its results.

Every number takes 8 bytes, int64 or float64, in the order of its tree of NamedTuples. Tables
(``tuple[float, ...]`` or ``tuple[int, ...]``) stand in memory of their own; the parameters hold
their address and length, so the code of a tick does not depend on the length of a plan.
`rig.compilation.tick_code` generates the code for the same layout.
"""

import ctypes
import struct
import sys
from array import array
from collections.abc import Callable, Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


class Table(NamedTuple):
    """Numbers outside of the memory of a tick."""

    address: int
    length: int
    code: str  # "d" float64, "q" int64


class Header(NamedTuple):
    """The numbers of a tick besides those of the kind of rig."""

    request: int = 0
    tick: int = 0
    lateness: float = 0.0  # s
    work: float = 0.0  # s
    skipped: int = 0
    periods: int = 1
    dt: float = 0.0  # s
    row: int = 0  # address to which the tick writes its row


class Sections(NamedTuple):
    """The parts of a tick's memory, each a tree of numbers and tables."""

    header: Any
    params: Any
    state: Any
    sense: Any
    command: Any


def is_law(kind: type) -> bool:
    """Return whether a type belongs to the module of a control law."""
    return hasattr(sys.modules.get(kind.__module__), "COLUMNS")


def is_named(tree: Any) -> bool:
    """Return whether a tree is a NamedTuple that has fields."""
    return isinstance(tree, tuple) and hasattr(tree, "_fields")


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _number_type(hint: Any) -> Any:
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def _is_table(hint: Any) -> bool:
    items = get_args(hint) if get_origin(hint) is tuple else ()
    return len(items) == 2 and items[1] is ... and _number_type(items[0]) in (float, int)


def with_tables(tree: Any, arrays: "list[array[Any]]", hint: Any = None) -> Any:
    """Return a tree with its tables replaced by `Table`; their numbers are added to ``arrays``.

    The parameters of a law keep their tuples: a law may iterate over them.
    """
    if is_named(tree):
        if is_law(type(tree)):
            return tree
        hints = _hints(type(tree))
        parts = zip(tree._fields, tree, strict=True)
        return type(tree)(*(with_tables(part, arrays, hints[name]) for name, part in parts))
    if not isinstance(tree, tuple):
        return tree
    if _is_table(hint):
        code = "q" if _number_type(get_args(hint)[0]) is int else "d"
        arrays.append(array(code, tree))
        return Table(*arrays[-1].buffer_info(), code)
    items = get_args(hint)
    item = items[0] if len(items) == 2 and items[1] is ... else None
    return tuple(with_tables(part, arrays, item) for part in tree)


def numbers(tree: Any) -> Iterator[float]:
    """Yield the numbers of a tree in order: address and length of a table."""
    if isinstance(tree, Table):
        yield from tree[:2]
    elif isinstance(tree, tuple):
        for part in tree:
            yield from numbers(part)
    else:
        yield tree


def layout(tree: Any) -> struct.Struct:
    """Return the layout of a tree."""
    codes = ("q" if isinstance(number, int) else "d" for number in numbers(tree))
    return struct.Struct("=" + "".join(codes))


def example(kind: Any) -> Any:
    """Return a NamedTuple whose numbers are all zero."""
    hints = (_number_type(hint) for hint in _hints(kind).values())
    return kind(*(hint() if hint in (int, float) else example(hint) for hint in hints))


def builder(tree: Any) -> Callable[[Any], Any]:
    """Return ``build(numbers)``, which gives a tree of the same types from a sequence of numbers.

    The code is generated as one expression: a loop over the fields would take longer than a tick.
    """
    types: dict[str, type] = {}
    at = iter(range(sys.maxsize))

    def text(part: Any) -> str:
        if not isinstance(part, tuple):
            return f"n[{next(at)}]"
        inside = "".join(f"{text(each)}," for each in part)
        if not is_named(part):
            return f"({inside})"
        name = f"T{len(types)}"
        types[name] = type(part)
        return f"{name}({inside})"

    made: Callable[[Any], Any] = eval(f"lambda n: {text(tree)}", {"__builtins__": {}, **types})
    return made


class TickMemory:
    """The memory of one tick, and access to its sections."""

    def __init__(self, params: Any, state: Any, sense: Any, command: Any, dt: float) -> None:
        """Store parameters and state; ``sense`` and ``command`` are examples."""
        self._arrays: list[Any] = []
        given = with_tables(params, self._arrays)
        self.sections = Sections(Header(dt=dt), given, state, sense, command)
        layouts = [layout(section) for section in self.sections]
        self.starts = []
        total = 0
        for each in layouts:
            self.starts.append(total)
            total += each.size
        self._buffer = bytearray(total)
        self.address = ctypes.addressof(ctypes.c_char.from_buffer(self._buffer))
        for at, form, section in zip(self.starts, layouts, self.sections, strict=True):
            form.pack_into(self._buffer, at, *numbers(section))
        header, self._params, self._state, self._sense, self._command = layouts
        self._build_command = builder(command)
        self._build_state = builder(state)
        self._header = header

    def set_header(self, header: Header) -> None:
        """Store the numbers of the next tick."""
        self._header.pack_into(self._buffer, 0, *header)

    def set_sense(self, sense: Any) -> None:
        """Store the readings of the next tick."""
        self._sense.pack_into(self._buffer, self.starts[3], *numbers(sense))

    def state(self) -> Any:
        """Return the state after the last tick."""
        return self._build_state(self._state.unpack_from(self._buffer, self.starts[2]))

    def command(self) -> Any:
        """Return the command of the last tick."""
        return self._build_command(self._command.unpack_from(self._buffer, self.starts[4]))
