"""Flat memory of compiled ticks: the numbers of their inputs, their state and their results.

Every number takes 8 bytes, int64 or float64, in the order of its tree of NamedTuples. Tables
(``tuple[float, ...]`` or ``tuple[int, ...]``) stand in memory of their own; the parameters hold
their address and length, so the code of a tick does not depend on the length of a plan.
`rig.compilation.tick_source` generates code for this layout.
"""

import ctypes
import struct
import sys
from array import array
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Annotated, Any, NamedTuple, Protocol, get_args, get_origin, get_type_hints

from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST, Request


class Table(NamedTuple):
    """Numbers outside of the memory of a tick."""

    address: int
    length: int
    code: str  # "d" float64, "q" int64


class TickHeader(NamedTuple):
    """The inputs of a tick besides parameters, state and readings."""

    request: Request = NO_REQUEST
    tick: int = 0
    lateness: float = 0.0  # s
    work: float = 0.0  # s
    skipped: int = 0
    periods: int = 1
    dt: float = 0.0  # s
    row: int = 0  # address to which the tick writes its row


_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


class Numbers(Protocol):
    """Numbers in memory of their own, such as `rig.compilation.column.Column`."""

    address: int
    length: int
    code: str  # as of `Table`


class Section(NamedTuple):
    """A tree in flat memory."""

    tree: Any  # an example with the same types
    start: int  # first byte
    layout: struct.Struct


class FlatMemory:
    """Trees of NamedTuples, section by section in one piece of memory."""

    def __init__(self, **trees: Any) -> None:
        """Store the trees; those named `params` and `plant` may hold tables."""
        self._owners: dict[str, list[Any]] = {}  # of the tables, whose memory must stay
        self.sections: dict[str, Section] = {}
        size = 0
        for name, tree in trees.items():
            stored = self._as_stored(name, tree)
            self.sections[name] = Section(stored, size, _layout(stored))
            size += self.sections[name].layout.size
        self.buffer = bytearray(size)
        self.address = ctypes.addressof(ctypes.c_char.from_buffer(self.buffer))
        for section in self.sections.values():
            section.layout.pack_into(self.buffer, section.start, *_numbers(section.tree))

    def own(self) -> bytes:
        """Return the address as compiled code takes it (`rig.realtime.object_code.function_at`)."""
        return self.address.to_bytes(8, "little")

    def set(self, name: str, tree: Any) -> None:
        """Replace the numbers of a section."""
        _, start, layout = self.sections[name]
        layout.pack_into(self.buffer, start, *_numbers(self._as_stored(name, tree)))

    def get(self, name: str) -> Any:
        """Return the present numbers of a section, which has no tables, as a tree."""
        return self.getter(name)()

    def setter(self, name: str) -> Callable[[Any], None]:
        """Return ``set(tree)`` as generated code, for a section without tables."""
        tree, start, _ = self.sections[name]
        return partial(packer(tree), self.buffer, start)

    def getter(self, name: str) -> Callable[[], Any]:
        """Return ``get()`` as generated code, for a section without tables."""
        tree, start, layout = self.sections[name]
        build, unpack = builder(tree), partial(layout.unpack_from, self.buffer, start)
        return lambda: build(unpack())

    def writers(self, name: str) -> Any:
        """Return a record like a section; its members are functions that store a part in place.

        A function takes the numbers of its part in order, of all levels: ``w.panel(0, 0, 0.001)``.
        """
        return self._accesses(name, "pack_into")

    def readers(self, name: str) -> Any:
        """Return a record like a section; its members are functions that return a part.

        A function returns the numbers of its part in order, of all levels, as a tuple.
        """
        return self._accesses(name, "unpack_from")

    def _accesses(self, name: str, access: str) -> Any:
        tree = self.sections[name].tree
        parts = (self._part(name, field) for field in tree._fields)
        return type(tree)(
            *(partial(getattr(_layout((part,)), access), self.buffer, at) for part, at in parts)
        )

    def bytes_of(self, name: str, *path: str) -> "memoryview[int]":
        """Return the bytes of a part of a section, as they stand in memory."""
        part, start = self._part(name, *path)
        return memoryview(self.buffer)[start : start + _layout((part,)).size]

    def number(self, name: str, *path: str) -> "memoryview[int] | memoryview[float]":
        """Return one number of a section as it stands in memory, a view of length 1."""
        part, _ = self._part(name, *path)
        return self.bytes_of(name, *path).cast("q" if isinstance(part, int) else "d")

    def start_of(self, name: str, *path: str) -> int:
        """Return the first byte of a part of a section."""
        return self._part(name, *path)[1]

    def numbers_of(self, name: str, table: Table) -> "array[Any]":
        """Return the numbers of a table of a section; the code reads what is written to them."""
        owned = (each for each in self._owners[name] if isinstance(each, array))
        return next(each for each in owned if each.buffer_info()[0] == table.address)

    def _part(self, name: str, *path: str) -> tuple[Any, int]:
        """Return a part of a section, and its first byte."""
        tree, start, _ = self.sections[name]
        for field in path:
            index = tree._fields.index(field)
            start += _layout(tree[:index]).size
            tree = tree[index]
        return tree, start

    def _as_stored(self, name: str, tree: Any) -> Any:
        if name not in ("params", "plant"):
            return _as_stored(tree)
        self._owners[name] = []
        return _as_stored(tree, tables=self._owners[name])


class TickMemory(FlatMemory):
    """The memory of one tick."""

    def __init__(self, params: Any, state: Any, sense: Any, command: Any, dt: float) -> None:
        """Store parameters and state; ``sense`` and ``command`` are examples, ``dt`` is in s."""
        super().__init__(
            header=TickHeader(dt=dt), sense=sense, params=params, state=state, command=command
        )

    def set_state(self, state: Any) -> None:
        """Store the state before the next tick."""
        self.set("state", state)

    def state(self) -> Any:
        """Return the state after the last tick."""
        return self.get("state")


def of_kind(kind: cycle.Kind, params: cycle.Params, state: cycle.State, dt: float) -> TickMemory:
    """Return the memory for the ticks of a kind of rig from a state on.

    Its ``sense_type`` must be known.
    """
    return TickMemory(params, state, *examples(kind, params, dt), dt)


def examples(kind: cycle.Kind, params: cycle.Params, dt: float) -> tuple[Any, Any]:
    """Return readings that are all zero, and the command of the first tick for them."""
    sense = example(kind.sense_type)
    start = cycle.start(kind, params, 0)
    step = cycle.make(kind)
    _, command, _ = step(params, start, sense, NO_REQUEST, 0, _NO_TIMING, 1, dt)
    return sense, command


def is_named(tree: Any) -> bool:
    """Return whether a tree is a NamedTuple."""
    return isinstance(tree, tuple) and hasattr(tree, "_fields")


def example(kind: Any) -> Any:
    """Return a NamedTuple of a type whose numbers are all zero."""
    hints = (_number_type(hint) for hint in _hints(kind).values())
    return kind(*(hint() if hint in (int, float) else example(hint) for hint in hints))


def packer(tree: Any) -> Callable[[Any, int, Any], None]:
    """Return ``pack(buffer, at, tree)``, which stores the numbers of such trees at byte ``at``.

    The code is generated as one call of `struct.Struct.pack_into`.
    """
    pack: Callable[[Any, int, Any], None] = eval(
        f"lambda buffer, at, tree: pack_into(buffer, at, {_spread(tree, 'tree')})",
        {"__builtins__": {}, "pack_into": _layout(tree).pack_into},
    )
    return pack


def _spread(tree: Any, name: str) -> str:
    """Return source text of the numbers of a tree in order, as arguments of a call.

    Unpacking sub-tuples costs a few nanoseconds a number, while visiting the fields by name would
    cost as much as the cycle.
    """

    def parts(part: Any, text: str) -> Iterator[str]:
        if not any(isinstance(member, tuple) for member in part):
            yield f"*{text}"
            return
        for i, member in enumerate(part):
            here = f"{text}[{i}]"
            yield from parts(member, here) if isinstance(member, tuple) else [here]

    return ", ".join(parts(tree, name))


def builder(tree: Any) -> Callable[[Any], Any]:
    """Return ``build(numbers)``, which returns a tree of the same types, by generated code."""
    types: dict[str, Any] = {"new": tuple.__new__}
    at = iter(range(sys.maxsize))

    def text(part: Any) -> str:
        if not isinstance(part, tuple):
            return f"n[{next(at)}]"
        inside = "".join(f"{text(each)}," for each in part)
        if not is_named(part):
            return f"({inside})"
        name = f"T{len(types)}"
        types[name] = type(part)
        return f"new({name}, ({inside}))"

    build: Callable[[Any], Any] = eval(f"lambda n: {text(tree)}", {"__builtins__": {}, **types})
    return build


def _as_stored(tree: Any, hint: Any = None, tables: list[Any] | None = None) -> Any:
    """Return a tree whose numbers have the types of their annotations, as memory and code have.

    With a list ``tables``, `Table` stands in place of tables, whose numbers are added to the list.
    The parameters of a law keep their tuples: a law may iterate over them.
    """
    if tables is not None and hasattr(tree, "address"):
        numbers: Numbers = tree
        tables.append(numbers)
        return Table(numbers.address, numbers.length, numbers.code)
    if is_named(tree):
        kind: Any = type(tree)
        if hasattr(sys.modules.get(kind.__module__), "COLUMNS"):  # the module is a law
            tables = None
        hints = _hints_found(kind)
        parts = zip(tree._fields, tree, strict=True)
        return kind(*(_as_stored(part, hints.get(name), tables) for name, part in parts))
    if not isinstance(tree, tuple):
        return float(tree) if isinstance(tree, int) and _number_type(hint) is float else tree
    item = _item_type(hint)
    if tables is not None and item in (float, int):
        tables.append(array("q" if item is int else "d", tree))
        address, length = tables[-1].buffer_info()
        return Table(address, length, tables[-1].typecode)
    return tuple(_as_stored(part, item, tables) for part in tree)


def _item_type(hint: Any) -> Any:
    """Return the type of the items of ``tuple[item, ...]``; None for another hint."""
    items = get_args(hint) if get_origin(hint) is tuple else ()
    return _number_type(items[0]) if len(items) == 2 and items[1] is ... else None


def _number_type(hint: Any) -> Any:
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def _hints_found(kind: Any) -> dict[str, Any]:
    """Return the annotations of a NamedTuple; none if a law has some that cannot be evaluated."""
    try:
        return _hints(kind)
    except (NameError, TypeError):
        return {}


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _numbers(tree: Any) -> Iterator[float]:
    """Yield the numbers of a tree in order; of a table its address and its length."""
    if isinstance(tree, Table):
        yield from tree[:2]
    elif isinstance(tree, tuple):
        for part in tree:
            yield from _numbers(part)
    else:
        yield tree


def _layout(tree: Any) -> struct.Struct:
    codes = ("q" if isinstance(number, int) else "d" for number in _numbers(tree))
    return struct.Struct("@" + "".join(codes))
