"""The composition of a modular rig: the parts of its rig file that decide what a tick computes."""

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

from rig import stations
from rig.stations import Station

ROTATION = "rotation"
TRANSLATION = "translation"


class AxisPart(NamedTuple):
    """A powered axis."""

    name: str
    motion: str  # `TRANSLATION` or `ROTATION`: rad for m and N*m for N
    law: str  # for `rig.laws.from_request`; empty for the impedance law


class SensorPart(NamedTuple):
    """A sensor besides those of the axes."""

    name: str
    unit: str
    tared: bool


class Composition(NamedTuple):
    """The parts of a rig, in the order of its rig file."""

    axes: tuple[AxisPart, ...]
    sensors: tuple[SensorPart, ...]
    stations: tuple[Station, ...]

    @classmethod
    def default(cls) -> "Composition":
        """Return the smallest rig: one axis that moves up and down."""
        axes = (AxisPart("heave", TRANSLATION, ""),)
        return cls(axes, (), default_stations(["heave"]))

    def to_text(self) -> str:
        """Return the composition as text for another process."""
        parts: dict[str, Any] = {
            "axes": self.axes,
            "sensors": self.sensors,
            "stations": stations.as_records(self.stations),
        }
        return json.dumps(parts)

    @classmethod
    def from_text(cls, text: str) -> "Composition":
        """Return the composition of `to_text`."""
        parts = json.loads(text)
        return cls(
            tuple(AxisPart(*each) for each in parts["axes"]),
            tuple(SensorPart(*each) for each in parts["sensors"]),
            stations.from_records(parts["stations"]),
        )


AXIS_SIGNALS = ("position", "velocity", "force", "current")
"""Signals of each axis: estimated motion, commanded force on the body, measured drive current."""


def signal_names(axes: Iterable[str], sensors: Iterable[str]) -> tuple[str, ...]:
    """Return the signals that the formula of a power station may use, by the names of the parts."""
    return (*(f"{axis}_{signal}" for axis in axes for signal in AXIS_SIGNALS), *sensors)


def default_stations(axes: Iterable[str]) -> tuple[Station, ...]:
    """Return the only station of a rig whose file has none: the power of the commanded forces."""
    formula = " + ".join(f"{name}_force * {name}_velocity" for name in axes)
    label = "mechanical (commanded force)"
    return (
        Station("mechanical", formula, label, "mechanical", "mech", running_mean=True, shown=True),
    )
