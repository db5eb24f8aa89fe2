"""Power stations: the points along the flow of power at which a rig knows its power.

A kind of rig declares its stations as one table in the order of the flow, from the body to the DC
bus. The loop's code, the fields of the log row, the row table, pictures and reports all follow
from the table (`rig.realtime.power` compiles it); a run records its table in its plan. Power is
negative where it is absorbed.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

FIELD_NAME = re.compile(r"[a-z](_?[a-z0-9])*")  # ROS field names: no "__", no trailing "_"


class Station(NamedTuple):
    """One power station, a row of its kind's table."""

    name: str  # the log field is ``power.NAME``, the variable of the row table ``power_NAME``
    formula: str  # power in W from the signals of a tick, e.g. "force * velocity"
    label: str  # full name, in tables
    short_label: str  # on axes of pictures
    heading: str  # of a narrow column
    alias: str = ""  # a second, short name
    running_mean: bool = False  # the row carries ``power.mean_NAME``: its mean so far
    force: str = ""  # log field of the force whose constant offset `power_NAME_demeaned` removes
    shown: bool = False  # in pictures by default

    @property
    def name_in_text(self) -> str:
        """Name in a sentence, e.g. "mechanical power"."""
        return self.alias or self.heading

    @property
    def reference(self) -> str:
        """Label and id, e.g. "electrical DC [dc]"; `find` knows the station by both."""
        return f"{self.label} [{self.name}]"

    @property
    def names(self) -> tuple[str, ...]:
        """All names by which people know it: id, alias, labels, and column of the row table."""
        labels = (self.label, self.short_label, self.heading)
        return (self.name, *filter(None, [self.alias]), *labels, f"power_{self.name}")

    def uses(self, signal: str) -> bool:
        """Return whether the formula contains a signal."""
        return signal in re.findall(r"\w+", self.formula)


def as_records(stations: Iterable[Station]) -> list[dict[str, Any]]:
    """Return stations as JSON values, as in a run's plan."""
    return [station._asdict() for station in stations]


def from_records(records: Iterable[Mapping[str, Any]]) -> tuple[Station, ...]:
    """Return the stations of a recorded table; fields that today's `Station` lacks are ignored."""
    return tuple(
        Station(**{name: each[name] for name in Station._fields if name in each})
        for each in records
    )


def find(stations: Sequence[Station], name: str) -> Station:
    """Return a station by one of its `names`, whatever their case; an id counts first.

    Raises ValueError, with label and id of all stations, for a name of none of them or of several.
    """
    key = name.strip().casefold()
    for candidates in (
        [each for each in stations if key in (each.name, each.alias)],
        [each for each in stations if key in map(str.casefold, each.names)],
    ):
        if len(candidates) == 1:
            return candidates[0]
    problem = "ambiguous" if candidates else "unknown"
    allowed = ", ".join(station.reference for station in stations)
    raise ValueError(f"{problem} station {name!r}; allowed {allowed}")


def station_names(stations: Iterable[Station]) -> list[str]:
    """Return the names of stations, in their order."""
    return [station.name for station in stations]


def shown(stations: Iterable[Station]) -> tuple[Station, ...]:
    """Return the stations that pictures show by default."""
    return tuple(station for station in stations if station.shown)


def in_tables(stations: Iterable[Station]) -> tuple[Station, ...]:
    """Return the stations that tables of a terminal's width show.

    These are the shown ones with a running mean; without any, all shown ones.
    """
    found = shown(stations)
    return tuple(station for station in found if station.running_mean) or found
