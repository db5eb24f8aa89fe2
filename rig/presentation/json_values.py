"""Values of results as JSON values."""

import math
from typing import Any


def json_value(value: Any) -> Any:
    """Return a value without what JSON lacks: NaN and infinity are None, NamedTuples are dicts."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {str(key): json_value(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(each) for each in value]
    return value
