"""The rig file of a modular rig: its axes, its sensors and its power stations."""

import keyword
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from rig.config.axis import Axis, RotaryAxis
from rig.config.model import FileModel, RuleViolation, TupleOf
from rig.config.problems import format_number
from rig.config.rig_file import BaseRigFile, Rate, StopTiming
from rig.kinds.modular.tick.compose import reserved_names
from rig.kinds.modular.tick.composition import AXIS_SIGNALS, default_stations, signal_names
from rig.kinds.modular.tick.reasons import MAX_AXES, MAX_SENSORS
from rig.realtime import power
from rig.stations import FIELD_NAME, Station

UNITS = (
    "1", "%", "m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "deg", "N", "N*m", "Pa", "bar", "W",
    "V", "A", "K", "degC", "Hz", "kg", "kg/s", "m^3/s", "count",
)  # fmt: skip
"""Units that a sensor may have."""


class Translation(Axis):
    """A powered axis that translates."""

    motion: Literal["translation"]
    law: str | dict[str, Any] = "impedance"  # of campaigns without one; checked with them
    stop_damping_n_s_per_m: float = Field(gt=0, le=1e6)  # the force of a stop is -damping * v
    force_sensor: str | None = None  # sensor (N) between drive and body, for identification


class Rotation(RotaryAxis):
    """A powered axis that rotates."""

    motion: Literal["rotation"]
    law: str | dict[str, Any] = "impedance"
    stop_damping_n_m_s_per_rad: float = Field(gt=0, le=1e6)
    force_sensor: str | None = None  # sensor (N*m) between drive and body


AnyAxis = Annotated[Translation | Rotation, Field(discriminator="motion")]


class Sensor(FileModel):
    """A sensor besides those of the axes; its value is ``scale * reading + offset``."""

    label: str = Field(default="", max_length=64)  # on axes of pictures; empty: its name
    unit: Literal[UNITS]  # type: ignore[valid-type]
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)
    offset: float = Field(default=0.0, ge=-1e9, le=1e9)
    tare: bool = False  # its mean during the tare is its zero
    range: TupleOf[float] = Field(min_length=2, max_length=2, strict=False)  # not tared
    age_limit_s: float = Field(gt=0, le=60)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not zero and that the range has a width."""
        if self.scale == 0.0:
            yield RuleViolation(("scale",), "0 gives the same value for every reading", 0.0)
        low, high = self.range
        if not low < high:
            message = f"{format_number(low)} .. {format_number(high)} is empty; allowed low < high"
            yield RuleViolation(("range",), message)


class PowerStation(FileModel):
    """A point of the flow of power; power is negative where it is absorbed."""

    formula: str = Field(min_length=1, max_length=500)  # W, of signals: + - * and numbers
    label: str = Field(default="", max_length=64)  # empty: its name
    running_mean: bool = True
    shown: bool = True  # in pictures

    def as_station(self, name: str) -> Station:
        """Return the row of the table of stations."""
        label = self.label or name
        return Station(
            name, self.formula, label, label, name, running_mean=self.running_mean, shown=self.shown
        )


class RigFile(BaseRigFile):
    """A rig of kind `modular`."""

    kind: Literal["modular"]
    rate_hz: Rate
    axes: dict[str, AnyAxis] = Field(min_length=1, max_length=MAX_AXES)
    sensors: dict[str, Sensor] = Field(default={}, max_length=MAX_SENSORS)
    stations: dict[str, PowerStation] = Field(default={}, max_length=20)
    stop: StopTiming

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the names of axes and sensors, and the formulas of the stations."""
        yield from self._name_rules()
        yield from self._force_sensor_rules()
        signals = signal_names(self.axes, self.sensors)
        for name, station in self.stations.items():
            try:
                power.compile_stations([station.as_station(name)], signals, __name__)
            except ValueError as error:
                yield RuleViolation(("stations", name, "formula"), str(error), station.formula)

    def _force_sensor_rules(self) -> Iterator[RuleViolation]:
        for name, axis in self.axes.items():
            unit = "N" if axis.motion == "translation" else "N*m"
            allowed = [each for each, sensor in self.sensors.items() if sensor.unit == unit]
            if axis.force_sensor is not None and axis.force_sensor not in allowed:
                message = f"no sensor with the unit {unit}; allowed {', '.join(allowed) or 'none'}"
                yield RuleViolation(("axes", name, "force_sensor"), message, axis.force_sensor)

    def _name_rules(self) -> Iterator[RuleViolation]:
        taken = dict.fromkeys(reserved_names(), "a field of every log row or of the loop")
        parts = [("axes", name) for name in self.axes] + [
            ("sensors", name) for name in self.sensors
        ]
        derived = (*AXIS_SIGNALS, *_DERIVED)
        taken |= {f"{name}_{each}": f"the axis {name}" for name in self.axes for each in derived}
        for section, name in parts:
            if not FIELD_NAME.fullmatch(name) or keyword.iskeyword(name):
                message = "no name of a log field; allowed [a-z][a-z0-9_]*, no __, no _ at the end"
                yield RuleViolation((section, name), message, name)
            elif name in taken:
                yield RuleViolation(
                    (section, name), f"this name is taken by {taken[name]}; allowed any other", name
                )
            taken[name] = f"one of the {section}"

    @property
    def power_stations(self) -> tuple[Station, ...]:
        """The table of power stations; without any in the file, that of the commanded forces."""
        listed = tuple(station.as_station(name) for name, station in self.stations.items())
        return listed or default_stations(self.axes)


_DERIVED = ("law", "span_stop", "low", "high")  # fields that the composed types add to an axis's
