"""Differences between two configurations, as a run records them."""

from collections.abc import Iterator
from typing import Any


def key_differences(before: Any, now: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield each key whose value is not the same, as SECTION.KEY, with both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in dict.fromkeys([*before, *now]):
            place = f"{key}.{name}" if key else str(name)
            yield from key_differences(before.get(name), now.get(name), place)
    elif before != now:
        yield key, before, now
