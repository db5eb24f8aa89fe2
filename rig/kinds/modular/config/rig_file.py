"""The rig file of a modular rig: its axes, its sensors and its power stations."""

import keyword
import re
from collections.abc import Iterable, Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, TupleOf
from rig.config.problems import format_number
from rig.config.rig_file import Axis, PowerRigFile, Rate, RotaryAxis, StopTiming
from rig.config.wiring import TorqueDrive
from rig.kinds.modular.config.wiring import ModularWiring
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


CurrentBandwidth = Annotated[float, Field(ge=1, le=1e5)] | None
"""-3 dB bandwidth of the drive's current loop, Hz; identification corrects the command for it."""


class Translation(Axis):
    """A powered axis that translates."""

    motion: Literal["translation"]
    law: str | dict[str, Any] = "impedance"  # of campaigns without one; checked with them
    stop_damping_n_s_per_m: float = Field(gt=0, le=1e6)  # the force of a stop is -damping * v
    current_bandwidth_hz: CurrentBandwidth = None
    force_sensor: str | None = None  # sensor (N) between drive and body, for identification


class Rotation(RotaryAxis):
    """A powered axis that rotates."""

    motion: Literal["rotation"]
    law: str | dict[str, Any] = "impedance"  # of campaigns without one; checked with them
    stop_damping_n_m_s_per_rad: float = Field(gt=0, le=1e6)  # during a controlled stop
    current_bandwidth_hz: CurrentBandwidth = None
    force_sensor: str | None = None  # sensor (N*m) between drive and body


AnyAxis = Annotated[Translation | Rotation, Field(discriminator="motion")]


class Sensor(FileModel):
    """A sensor besides those of the axes; its value is ``scale * reading + offset``.

    ``source`` is the value of the wiring that it reads; a rehearsal reads the plant's sensor of its
    name.
    """

    label: str = Field(default="", max_length=64)  # on axes of pictures; empty: its name
    unit: Literal[UNITS]  # type: ignore[valid-type]
    scale: float = Field(default=1.0, ge=-1e9, le=1e9)  # factor on the source's value
    offset: float = Field(default=0.0, ge=-1e9, le=1e9)  # added after scaling
    lag_s: float = Field(default=0.0, ge=0, le=1)  # of filter and amplifier, for identification
    source: str | None = None  # DEVICE.VALUE; needed with wiring
    tare: bool = False  # its mean during the tare is its zero
    range: TupleOf[float] = Field(min_length=2, max_length=2, strict=False)  # not tared
    age_limit_s: float = Field(gt=0, le=60)  # age of the value that stops

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
    running_mean: bool = True  # a row of the log has its mean so far
    shown: bool = True  # in pictures

    def as_station(self, name: str, axes: Iterable[str]) -> Station:
        """Return the row of the table of stations; its label says if a force is the command."""
        label = self.label or name
        commands = "|".join(f"{axis}_force" for axis in axes)
        if re.search(rf"\b({commands})\b", self.formula) and "command" not in label:
            label = f"{label} (by command)"
        return Station(
            name, self.formula, label, label, name, running_mean=self.running_mean, shown=self.shown
        )


class RigFile(PowerRigFile):
    """A rig of kind `modular`."""

    kind: Literal["modular"]
    rate_hz: Rate
    axes: dict[str, AnyAxis] = Field(min_length=1, max_length=MAX_AXES)
    """Powered axes by name; laws, limits and log fields use the name."""
    sensors: dict[str, Sensor] = Field(default={}, max_length=MAX_SENSORS)
    stations: dict[str, PowerStation] = Field(default={}, max_length=20)
    stop: StopTiming
    wiring: ModularWiring | None = None  # None: the rig can only be rehearsed

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the names of axes and sensors, the formulas of the stations, and the wiring."""
        yield from super().check_rules()
        yield from self._name_rules()
        if self.wiring is not None:
            yield from self._drive_rules(self.wiring)
            yield from self._source_rules(self.wiring)
        yield from self._force_sensor_rules()
        signals = signal_names(self.axes, self.sensors)
        for name, station in self.stations.items():
            try:
                power.compile_stations([station.as_station(name, self.axes)], signals, __name__)
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

    def _drive_rules(self, wiring: ModularWiring) -> Iterator[RuleViolation]:
        known = ", ".join(self.axes)
        for name in self.axes:
            if name not in wiring.axes:
                yield RuleViolation(("wiring", "axes"), f"the axis {name} has no drive here")
        for name in wiring.axes:
            if name not in self.axes:
                message = f"the rig has no axis {name}; allowed {known}"
                yield RuleViolation(("wiring", "axes", name), message)

        for name, drive in wiring.axes.items():
            counts = _drive_counts(drive)
            axis = self.axes.get(name)
            if counts and axis and counts != axis.counts_per_revolution:
                message = (
                    f"feed and gear give {format_number(counts)} counts per revolution of the "
                    f"motor; allowed {axis.counts_per_revolution}, as axes.{name} has"
                )
                yield RuleViolation(("wiring", "axes", name, "objects", "feed"), message)
            increments = _encoder_increments(drive)
            if increments and axis and increments < axis.counts_per_revolution:
                given = drive.objects["encoder_increments"]
                message = (
                    f"{given} gives {format_number(increments)} increments per revolution of the "
                    f"motor; allowed at least the counts_per_revolution of axes.{name}, "
                    f"{axis.counts_per_revolution}"
                )
                key = ("wiring", "axes", name, "objects", "encoder_increments")
                yield RuleViolation(key, message, given)

    def _source_rules(self, wiring: ModularWiring) -> Iterator[RuleViolation]:
        """Check that sensors and values of the wiring belong to each other one by one."""
        sources = wiring.sources()
        given = [sensor.source for sensor in self.sensors.values()]
        free = ", ".join(source for source in sources if source not in given) or "none that is free"
        users: dict[str, str] = {}
        for name, sensor in self.sensors.items():
            key, source = ("sensors", name, "source"), sensor.source
            if source is None:
                message = f"has no source, which a rig with wiring needs; allowed {free}"
                yield RuleViolation(key[:-1], message)
            elif source not in sources:
                message = f"{source} is no value of the wiring; allowed {free}"
                yield RuleViolation(key, message, source)
            elif source in users:
                message = f"{source} is the source of {users[source]} already; allowed {free}"
                yield RuleViolation(key, message, source)
            else:
                users[source] = name
        for source, (_, _, place) in wiring.unused_sources(users).items():
            message = f"no sensor has the source {source}: add one, or remove this"
            yield RuleViolation(("wiring", *place), message)

    @property
    def power_stations(self) -> tuple[Station, ...]:
        """The table of power stations; without any in the file, that of the commanded forces."""
        listed = tuple(each.as_station(name, self.axes) for name, each in self.stations.items())
        return listed or default_stations(self.axes)


def _drive_counts(drive: TorqueDrive) -> float | None:
    """Return a drive's position steps per revolution of the motor (CiA 402-2, factor group).

    None if the drive lacks one of the objects, or the file does not set it.
    """
    names = ("feed", "gear_shaft_revolutions", "gear_motor_revolutions", "feed_shaft_revolutions")
    values = [drive.objects.get(name) for name in names]
    if not all(values):
        return None
    feed, gear_shaft, gear_motor, feed_shaft = (float(value) for value in values if value)
    return feed * gear_shaft / (gear_motor * feed_shaft)


def _encoder_increments(drive: TorqueDrive) -> float | None:
    """Return the encoder's increments per revolution of the motor; None if the file lacks them.

    A drive may scale them to fewer counts, but not to more.
    """
    increments = drive.objects.get("encoder_increments")
    revolutions = drive.objects.get("encoder_motor_revolutions") or 1
    return None if increments is None else increments / revolutions


_DERIVED = ("law", "span_stop", "low", "high")  # fields that the composed types add to an axis's
