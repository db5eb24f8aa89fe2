"""The heave law's set points by columns, as the loop uses them, and the reading of one of them.

Both are generated from the fields of the law's SetPoint: a loop over fields costs time in the tick,
and compiled code has none.
"""

import sys
from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def columns_type(set_point: Any) -> Any:
    """Return the NamedTuple type with a tuple of floats for each field of a law's SetPoint.

    A module that can be imported gets it as `LawColumns`: compiled code on disk refers to a type by
    its name. If the name led nowhere, no later process would find that code again. The module of a
    law's file cannot be imported, so its type is stored by value and each process compiles.
    """
    names: list[str] = list(set_point._fields)
    columns: Any = namedtuple("LawColumns", names)  # type: ignore[misc]
    columns.__annotations__ = dict.fromkeys(set_point._fields, tuple[float, ...])
    columns.__module__ = set_point.__module__
    module = sys.modules[set_point.__module__]
    if module.__spec__ is not None:
        module.LawColumns = columns  # type: ignore[attr-defined]
    return columns


@cache
def setpoint_reader(set_point: Any) -> Callable[[Any, int], Any]:
    """Return the function ``(columns, i) -> SetPoint`` of a law."""
    values = ", ".join(f"columns.{name}[i]" for name in set_point._fields)
    source = f"def read_setpoint(columns, i):\n    return SetPoint({values})\n"
    names: dict[str, Any] = {"SetPoint": set_point}
    exec(source, names)
    reader: Callable[[Any, int], Any] = names["read_setpoint"]
    return reader
