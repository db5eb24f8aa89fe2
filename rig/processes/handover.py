"""Handing frozen parameters from the supervisor to the loop as JSON text, not pickle.

NamedTuples become lists in field order; reading builds them again from the type hints, so a float
that was written as an int comes back as a float. Python's JSON keeps every float to the bit.
"""

import json
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints


class HandoverError(ValueError):
    """The text does not fit the type; names the path at fault."""


def dumps(value: Any) -> str:
    """JSON text of a NamedTuple tree of floats, ints, strings and tuples."""
    return json.dumps(value)


def loads(kind: Any, text: str, **any_fields: type) -> Any:
    """Build ``kind`` from `dumps` text; ``any_fields`` types the fields annotated `Any`."""
    return _build(kind, json.loads(text), kind.__name__, any_fields)


def _build(hint: Any, data: Any, where: str, any_fields: dict[str, type]) -> Any:
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, UnionType):
        raise HandoverError(f"{where}: unions are not handed over")
    if hint is float and isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    if hint in (int, str) and type(data) is hint:
        return data
    if get_origin(hint) is tuple and isinstance(data, list):
        item, *rest = get_args(hint)
        if rest != [...]:
            raise HandoverError(f"{where}: only tuples of one kind of item are handed over")
        return tuple(_build(item, d, f"{where}[{i}]", any_fields) for i, d in enumerate(data))
    fields = getattr(hint, "_fields", None)
    if fields is None or not isinstance(data, list) or len(data) != len(fields):
        raise HandoverError(f"{where}: {type(data).__name__} does not fit {hint}")
    hints = get_type_hints(hint, include_extras=True)
    made = []
    for name, item in zip(fields, data, strict=True):
        kind = any_fields.get(name) if hints[name] is Any else hints[name]
        if kind is None:
            raise HandoverError(f"{where}.{name}: its type was not given")
        made.append(_build(kind, item, f"{where}.{name}", any_fields))
    return hint(*made)
