"""JSON as its standard has it, without the NaN and infinity that Python adds.

A browser does not read a message that has one.
"""

import json
import math
from typing import Any


class NotFiniteError(ValueError):
    """A JSON text has a number that is not finite."""


def loads(text: str | bytes) -> Any:
    """Return the value of a JSON text.

    Raises NotFiniteError for NaN, infinity and numbers beyond the range of floats, ValueError for
    a text that is no JSON.
    """
    return json.loads(text, parse_constant=_refuse, parse_float=_finite)


def dumps(value: Any, *, ensure_ascii: bool = True) -> str:
    """Return a value as JSON, with `"NaN"`, `"Infinity"` and `"-Infinity"` as texts."""
    try:
        return json.dumps(value, ensure_ascii=ensure_ascii, allow_nan=False)
    except ValueError:  # rare, so that the check costs nothing
        return json.dumps(_as_texts(value), ensure_ascii=ensure_ascii, allow_nan=False)


def _refuse(constant: str) -> float:
    raise NotFiniteError(f"{constant}: not a finite number")


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _refuse(text[:40])


def _as_texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _as_texts(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_as_texts(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return json.dumps(value)
    return value
