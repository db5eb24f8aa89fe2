"""The reading of one set point of the heave law from the set points by columns.

It is generated from the fields of the law's SetPoint: a loop over fields costs time in the tick,
and compiled code has none. The columns are a plain tuple: compiled code on disk refers to a type by
its name, and a generated type has none by which a later process would find that code.
"""

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def setpoint_reader(set_point: Any) -> Callable[[Any, int], Any]:
    """Return the function ``(columns, i) -> SetPoint`` of a law; a column per field, in order."""
    values = ", ".join(f"columns[{place}][i]" for place in range(len(set_point._fields)))
    source = f"def read_setpoint(columns, i):\n    return SetPoint({values})\n"
    names: dict[str, Any] = {"SetPoint": set_point}
    exec(source, names)
    reader: Callable[[Any, int], Any] = names["read_setpoint"]
    return reader
