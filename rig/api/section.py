"""Nested values of files and results, with attributes in place of keys."""

import json
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from html import escape
from typing import Any

from rig.api.named_values import NamedValues

_MAX_LINES = 60  # of a representation
_MAX_ITEMS = 8  # of a list in one line


class Section(NamedValues[Any]):
    """A part of a configuration or of a result, such as `run.config.rig.heave`.

    Values are read as attributes (`section.rate_hz`) or by key (`section["rate_hz"]`); parts of it
    are sections, too, and lists are tuples. Keys that are no names of Python, or that a mapping
    uses itself (`keys`, `items`, `values`, `get`), are read by key.

    Raises:
        AttributeError: For a name that is not there; the message lists the names. By key it is a
            KeyError with the same message.
    """

    def __init__(self, values: Mapping[str, Any], name: str = "section") -> None:
        self._values = dict(values)
        self._name = name

    def __getitem__(self, key: str) -> Any:
        if key not in self._values:
            raise KeyError(self._unknown(key))
        return _wrapped(self._values[key], f"{self._name}.{key}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        lines = [f"<{self._name}>", *_lines(self._values)]
        more = len(lines) - _MAX_LINES
        return "\n".join(lines[:_MAX_LINES] + ([f"... and {more} more lines"] if more > 0 else []))

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"

    def as_dict(self) -> dict[str, Any]:
        """Return the values as plain dictionaries and lists, a copy."""
        copied: dict[str, Any] = json.loads(json.dumps(self._values))
        return copied

    def _unknown(self, key: str) -> str:
        near = get_close_matches(key, self._values, 3, 0.5)
        hint = f"near: {', '.join(near)}; " if near else ""
        return f"{self._name} has no {key}; {hint}allowed {', '.join(self._values) or 'none'}"


class Summary(Section):
    """The summary of a run as values; `str()` of it, and a notebook, give the text for people."""

    def __init__(self, values: Mapping[str, Any], text: str) -> None:
        super().__init__(values, "summary")
        self._text = text

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return self._text


def _wrapped(value: Any, name: str) -> Any:
    if isinstance(value, Mapping):
        return Section(value, name)
    if isinstance(value, list | tuple):
        return tuple(_wrapped(each, f"{name}[{place}]") for place, each in enumerate(value))
    return value


def _lines(values: Mapping[str, Any], indent: str = "  ") -> Iterator[str]:
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield f"{indent}{key}:"
            yield from _lines(value, f"{indent}  ")
        else:
            yield f"{indent}{key}: {_text(value)}"


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{...}" if value else "{}"
    if isinstance(value, list | tuple):
        shown = ", ".join(map(_text, value[:_MAX_ITEMS]))
        more = f", ... ({len(value)} in all)" if len(value) > _MAX_ITEMS else ""
        return f"[{shown}{more}]"
    return "-" if value is None else str(value)
