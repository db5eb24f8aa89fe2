"""Serialisation of frozen values as JSON text, for the way from one process to another.

NamedTuples become lists in field order. Reading builds them again from the type hints, so a float
that was written as an int comes back as a float. Python's JSON keeps every float to the bit.
Pickle is not used.
"""

import json
from collections.abc import Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints


class HandoverError(ValueError):
    """The text does not fit the type; the message names the path of the faulty value."""


def dumps(value: Any) -> str:
    """Return the JSON text of a NamedTuple tree of numbers, strings, tuples and dicts."""
    return json.dumps(value)


def loads(kind: Any, text: str, **any_fields: type) -> Any:
    """Build a ``kind`` from the text of `dumps`; ``any_fields`` types the fields annotated `Any`.

    Raises HandoverError if the text does not fit the type.
    """
    return build(kind, json.loads(text), kind.__name__, any_fields)


def read_field(kind: Any, text: str, name: str) -> Any:
    """Return one plain field of the text of a ``kind``, whose other types may depend on it."""
    return json.loads(text)[kind._fields.index(name)]


def build(hint: Any, data: Any, path: str, any_fields: Mapping[str, type]) -> Any:
    """Build a value of a type from JSON values; ``path``: its name in the message of an error."""
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if get_origin(hint) in (Union, UnionType):
        raise HandoverError(f"{path}: unions are not supported")
    if hint is float and isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    if hint in (int, str, bool) and type(data) is hint:
        return data
    if get_origin(hint) is tuple and isinstance(data, list):
        item, *rest = get_args(hint)
        if rest != [...]:
            raise HandoverError(f"{path}: only tuples of one item type are supported")
        return tuple(build(item, d, f"{path}[{i}]", any_fields) for i, d in enumerate(data))
    if get_origin(hint) is dict and isinstance(data, dict):
        _, item = get_args(hint)
        if item is Any:  # plain JSON values
            return data
        return {key: build(item, d, f"{path}[{key!r}]", any_fields) for key, d in data.items()}
    fields = getattr(hint, "_fields", None)
    if fields is None or not isinstance(data, list) or len(data) != len(fields):
        raise HandoverError(f"{path}: {type(data).__name__} does not fit {hint}")
    hints = get_type_hints(hint, include_extras=True)
    values = []
    for name, item in zip(fields, data, strict=True):
        kind = any_fields.get(name) if hints[name] is Any else hints[name]
        if kind is None:
            raise HandoverError(f"{path}.{name}: no type was given for this field")
        values.append(build(kind, item, f"{path}.{name}", any_fields))
    return hint(*values)
