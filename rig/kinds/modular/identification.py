"""The channels of a modular rig's axes for `rig identify`.

A force sensor that the rig file names between drive and body measures the force on the body alone.
Without one the drive acts on the body directly, with the commanded force.
"""

from collections.abc import Iterable

from rig.config.law_settings import AxisLaw
from rig.identification.channels import AxisChannels, ForceChannel, command_channel
from rig.kinds.modular.config.rig_file import RigFile


def axis_channels(rig: RigFile, axis: str, axis_laws: Iterable[AxisLaw]) -> AxisChannels:
    """Return the channels of an axis of a rig in a campaign with these laws."""
    sensor = rig.axes[axis].force_sensor
    body = command_channel(axis)
    if sensor is not None:
        label = rig.sensors[sensor].label or sensor
        body = ForceChannel(sensor, label, f"{sensor}.value", f"{sensor}.age")
    return AxisChannels(
        body, gains=tuple(column.name for law in axis_laws for column in law.columns)
    )
