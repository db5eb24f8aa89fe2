"""The first signal of a run that was NaN or infinite, and whether a law demanded it."""

import math
from collections.abc import Mapping, Sequence

from rig.realtime.reasons import Reason

ROWS = 64
"""Newest rows of a run that are searched: without power the loop logs 20 more and ends."""
_DEMAND = ".demand."


def first_not_finite(rows: Sequence[Mapping[str, float]]) -> str:
    """Return a message with the signal of a trip by NaN or infinity; empty without one.

    ``rows``: the newest of a log by dotted field name, oldest first. The trip follows a value that
    was measured in its tick, or demanded in the tick before. Fields have the order of the cycle:
    sensors, estimate, demand, so the first one is the cause of the others.
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
            at = f"at {row['time']:.3f} s (log field {name})"
            if _DEMAND in name:
                return f"the law of the axis {name.split(_DEMAND)[0]} demanded {value} {at}"
            return f"the first value that is no number was {value} {at}"
    return ""
