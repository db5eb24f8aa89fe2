"""The contents of a modular rig's row table beside the columns of its matrix; its axes' channels.

Of each sensor the mean and two percentiles, relative to its tare if it has one; of each further
axis its motion and its force, as of the first one.
"""

import math
from collections.abc import Iterable

from rig.config.law_settings import AxisLaw
from rig.identification.channels import AxisChannels, ForceChannel, command_channel
from rig.kinds.modular.config.rig_file import RigFile, Sensor
from rig.kinds.modular.tick.composition import AXIS_SIGNALS
from rig.row_contents import Check, Column, RowContents


def row_contents(rig: RigFile, columns: Iterable[Column]) -> RowContents:
    """Return the contents of the row table of a rig with the columns of its matrix."""
    first, *others = rig.axes
    checks = [check for name, sensor in rig.sensors.items() for check in _sensor(name, sensor)]
    checks += [check for name in others for check in _axis(name, rig.axes[name].motion)]
    return RowContents(
        first, rig.power_stations, tuple(columns), tuple(checks), signals=signals(rig)
    )


def signals(rig: RigFile) -> dict[str, tuple[str, ...]]:
    """Return the signals of the power stations as log fields."""
    fields = {
        "position": "estimate.position",
        "velocity": "estimate.velocity",
        "force": "command.force",
        "current": "sense.current",
    }
    of_axes = {
        f"{axis}_{signal}": (f"{axis}.{fields[signal]}",)
        for axis in rig.axes
        for signal in AXIS_SIGNALS
    }
    return of_axes | {
        name: (f"{name}.value", *([f"tare.{name}"] if sensor.tare else []))
        for name, sensor in rig.sensors.items()
    }


def _sensor(name: str, sensor: Sensor) -> Iterable[Check]:
    zero = f"tare.{name}" if sensor.tare else ""
    for suffix, statistic in (("mean", "mean"), ("p02", "p02"), ("p98", "p98")):
        yield Check(f"{name}_{suffix}", sensor.unit, statistic, (f"{name}.value",), zero)


def _axis(name: str, motion: str) -> Iterable[Check]:
    length, force = ("rad", "N*m") if motion == "rotation" else ("m", "N")
    position = (f"{name}.estimate.position",)
    yield Check(f"{name}_position_mean", length, "mean", position)
    yield Check(f"{name}_stroke", length, "range", position)
    yield Check(f"{name}_force_rms", force, "rms", (f"{name}.command.force",))


def axis_channels(rig: RigFile, axis: str, axis_laws: Iterable[AxisLaw]) -> AxisChannels:
    """Return the channels of an axis of a rig for `rig identify`, in a campaign with these laws.

    A force sensor that the rig file names between drive and body measures the force on the body
    alone. Without one the drive acts on the body directly, with the commanded force.
    """
    sensor, bandwidth = rig.axes[axis].force_sensor, rig.axes[axis].current_bandwidth_hz
    command = command_channel(axis)._replace(
        hold_s=1.0 / rig.rate_hz,
        time_constant_s=0.0 if bandwidth is None else 1.0 / (2.0 * math.pi * bandwidth),
    )
    body = command
    if sensor is not None:
        own = rig.sensors[sensor]
        body = ForceChannel(
            sensor, own.label or sensor, f"{sensor}.value", f"{sensor}.age", lag_s=own.lag_s
        )
    gains = tuple(column.name for law in axis_laws for column in law.columns)
    return AxisChannels(body, gains=gains, command=command)
