"""Differences between two configurations, as a run records them, and their values as text."""

from collections.abc import Iterator
from typing import Any

from rig.config.problems import format_number

ABSENT = "absent"


def value_text(value: Any) -> str:
    """Return a value of a configuration in words: no brackets, quotes or names of Python."""
    if value is None:
        return ABSENT
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return format_number(value)
    if isinstance(value, dict):
        return ", ".join(f"{str(k).replace('_', ' ')} {value_text(v)}" for k, v in value.items())
    if isinstance(value, list | tuple):
        joint = "; " if any(isinstance(each, dict | list | tuple) for each in value) else ", "
        return joint.join(map(value_text, value)) or "none"
    return str(value)


def key_differences(before: Any, now: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield each key whose value is not the same, as SECTION.KEY, with both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys([*before, *now]):
            place = f"{key}.{name}" if key else str(name)
            yield from key_differences(before.get(name), now.get(name), place)
    elif before != now:
        yield key, before, now
