"""The first signal of a run that was NaN or infinite, and whether a law demanded it."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from rig.realtime.reasons import Reason
from rig.realtime.sequence import NO_ROW

ROWS = 64
"""Newest rows of a run that are searched: without power the loop logs 20 more and ends."""
_DEMAND = ".demand."


def first_not_finite(
    rows: Sequence[Mapping[str, float]], units: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return a message with the signal of a trip by NaN or infinity; empty without one.

    ``rows``: the newest of a log by dotted field name, oldest first; ``units`` of their fields. A
    demand is given with the row of the plan and the motion in its tick. The trip follows a value
    that was measured in its tick, or demanded in the tick before. Fields have the order of the
    cycle: sensors, estimate, demand, so the first one is the cause of the others.
    """
    trips = [i for i, row in enumerate(rows) if row["safety.reason"] == Reason.NOT_FINITE]
    if not trips:
        return ""
    trip = trips[0]
    usual = rows[max(0, trip - 2)]
    for row in rows[max(0, trip - 1) : trip + 1]:
        for name, value in row.items():
            # Some fields are NaN before their first value.
            if math.isfinite(value) or (row is not usual and not math.isfinite(usual[name])):
                continue
            at, field = f"at {row['time']:.3f} s", f" (log field {name})"
            if _DEMAND in name:
                axis = name.split(_DEMAND)[0]
                law = f"the law of the axis {axis} demanded {value} {at}"
                return law + _circumstances(row, axis, units) + field
            return f"the first value that is no number was {value} {at}{field}"
    return ""


def _circumstances(row: Mapping[str, float], axis: str, units: Mapping[str, str]) -> str:
    """Return the row of the plan and the motion of an axis in a tick, as far as they are logged."""
    number = int(row.get("plan.row", NO_ROW))
    text = "" if number == NO_ROW else f", row {number}"
    names = {each: f"{axis}.estimate.{each}" for each in ("position", "velocity")}
    motion = [
        f"{each} {row[name]:.2g} {units.get(name, '')}".rstrip()
        for each, name in names.items()
        if name in row
    ]
    return f"{text}, at {' and '.join(motion)}" if motion else text
