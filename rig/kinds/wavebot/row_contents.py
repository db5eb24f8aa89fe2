"""The contents of a WaveBot's row table beside the columns of its matrix, and its axes' channels.

The scripts of the MASK4 test store the following columns together with power (public fbWecCntrl
repository, MASK4/MHKDRCode): minimum stator force, mean slew force, percentiles of the load cells
and of velocity, mean bus voltage. This rig adds the share of ticks in which the drive saturated,
was gated off or burned power in the dump resistors, and the motion and force of surge. Forces are
relative to their tare. The stator force is not: it is not zero at rest, and its sign matters.
"""

from collections.abc import Iterable

from controllers.law import Column as LawColumn
from rig.identification.channels import AxisChannels, ForceChannel
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.row_contents import Check, RowContents

_VELOCITY = ("heave.estimate.velocity",)
_SURGE_POSITION = ("surge.estimate.position",)

CHECKS = (
    Check("stator_force_min", "N", "min", ("load.stator_a", "load.stator_b")),
    Check("slew_force_mean", "N", "mean", ("load.slew",), "tare.slew"),
    Check("lcb_p02", "N", "p02", ("load.lcb",), "tare.lcb"),
    Check("lcb_p98", "N", "p98", ("load.lcb",), "tare.lcb"),
    Check("trs_p01", "N", "p01", ("load.trs",), "tare.trs"),
    Check("trs_p98", "N", "p98", ("load.trs",), "tare.trs"),
    Check("velocity_p01", "m/s", "p01", _VELOCITY),
    Check("velocity_p98", "m/s", "p98", _VELOCITY),
    Check("bus_voltage_mean", "V", "mean", ("power_sense.bus_voltage",)),
    Check("share_saturated", "1", "share on", ("drive_sense.saturated",)),
    Check("share_gated", "1", "share off", ("drive_command.conducting",)),
    Check("share_dump_on", "1", "share on", ("drive_sense.dump",)),
    Check("surge_position_mean", "m", "mean", _SURGE_POSITION),
    Check("surge_stroke", "m", "range", _SURGE_POSITION),
    Check("surge_force_rms", "N", "rms", ("surge.command.force",)),
)

CONTROL = ("surge", "station_keeping", "surge_hold")

SIGNALS = {  # of the power stations, as log fields
    "lcb": ("load.lcb", "tare.lcb"),
    "trs": ("load.trs", "tare.trs"),
    "slew": ("load.slew", "tare.slew"),
    "force": ("heave.command.force",),
    "velocity": ("heave.estimate.velocity",),
    "surge_force": ("surge.command.force",),
    "surge_velocity": ("surge.estimate.velocity",),
    "ac": ("power_sense.ac",),
    "dc": ("power_sense.dc",),
}


def row_contents(law_columns: Iterable[LawColumn]) -> RowContents:
    """Return the contents of the row table of a campaign with a heave law's columns."""
    columns = COLUMNS.with_law(law_columns)
    return RowContents("heave", STATIONS, columns, CHECKS, CONTROL, SIGNALS)


def axis_channels(axis: str, law_columns: Iterable[LawColumn]) -> AxisChannels:
    """Return the channels of an axis for `rig identify`, in a campaign with a heave law's columns.

    The column load cell measures the force on the hull alone, the torque sensor on the motor's
    shaft that on hull and drivetrain in series. Surge has no load cell between drive and hull.
    """
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
