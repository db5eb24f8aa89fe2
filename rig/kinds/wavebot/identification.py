"""The channels of the WaveBot's axes for `rig identify`.

The column load cell measures the force on the hull alone, the torque sensor on the motor's shaft
that on hull and drivetrain in series. Surge has no load cell between drive and hull.
"""

from collections.abc import Iterable

from controllers.law import Column
from rig.identification.channels import AxisChannels, ForceChannel


def axis_channels(axis: str, law_columns: Iterable[Column]) -> AxisChannels:
    """Return the channels of an axis in a campaign with a heave law's columns."""
    gains = (*(column.name for column in law_columns), "surge_kp", "surge_ki")
    if axis == "surge":
        return AxisChannels(gains=gains, spring="spring_rate")
    return AxisChannels(
        body=ForceChannel("lcb", "load cell", "load.lcb", "load.age"),
        drive=(ForceChannel("trs", "torque sensor", "load.trs", "load.age"),),
        gains=gains,
        spring="spring_rate",
        saturated="drive_sense.saturated",
    )
