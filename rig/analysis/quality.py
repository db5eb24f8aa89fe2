"""Data-quality columns of the row table.

The scripts of the MASK4 test store the following columns together with power (public fbWecCntrl
repository, MASK4/MHKDRCode): minimum stator force, mean slew force, percentiles of the load cells
and of velocity, mean bus voltage. This rig adds the share of ticks in which the drive saturated,
was gated off or burned power in the dump resistors, and the motion and force of surge. Forces are
relative to their tare. The stator force is not: it is not zero at rest, and its sign matters.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs.mcap_file import Records


class Check(NamedTuple):
    """One quality column: its unit, its log fields and the function that reduces them."""

    unit: str
    fields: tuple[str, ...]
    compute: Callable[..., Any]  # takes the values of the fields over the window, in that order


def _percentile(percent: float) -> Callable[..., Any]:
    return lambda values: np.percentile(values, percent)


def _tared_percentile(percent: float) -> Callable[..., Any]:
    return lambda values, zeros: np.percentile(values - zeros, percent)


_VELOCITY = ("heave.estimate.velocity",)
_LCB, _TRS = ("load.lcb", "tare.lcb"), ("load.trs", "tare.trs")
_STATOR = ("load.stator_a", "load.stator_b")

CHECKS = {
    "stator_force_min": Check("N", _STATOR, lambda a, b: np.min(a + b)),
    "slew_force_mean": Check("N", ("load.slew", "tare.slew"), lambda f, zero: np.mean(f - zero)),
    "lcb_p02": Check("N", _LCB, _tared_percentile(2.0)),
    "lcb_p98": Check("N", _LCB, _tared_percentile(98.0)),
    "trs_p01": Check("N", _TRS, _tared_percentile(1.0)),
    "trs_p98": Check("N", _TRS, _tared_percentile(98.0)),
    "velocity_p01": Check("m/s", _VELOCITY, _percentile(1.0)),
    "velocity_p98": Check("m/s", _VELOCITY, _percentile(98.0)),
    "bus_voltage_mean": Check("V", ("power_sense.bus_voltage",), np.mean),
    "share_saturated": Check("1", ("drive_sense.saturated",), lambda on: np.mean(on != 0)),
    "share_gated": Check("1", ("drive_command.conducting",), lambda on: np.mean(on == 0)),
    "share_dump_on": Check("1", ("drive_sense.dump",), lambda on: np.mean(on != 0)),
    "surge_position_mean": Check("m", ("surge.estimate.position",), np.mean),
    "surge_stroke": Check("m", ("surge.estimate.position",), np.ptp),
    "surge_force_rms": Check(
        "N", ("surge.command.force",), lambda force: np.sqrt(np.mean(force * force))
    ),
}

UNITS = {name: check.unit for name, check in CHECKS.items()}


def required_fields(available: Iterable[str]) -> list[str]:
    """Return the log fields that the columns need, out of those ``available``."""
    needed = dict.fromkeys(name for check in CHECKS.values() for name in check.fields)
    names = set(available)
    return [name for name in needed if name in names]


def quality_columns(data: Records) -> dict[str, float]:
    """Return the value of each column over a window; NaN if the run did not log its fields."""
    logged = set(data.dtype.names or ())
    return {
        name: float(check.compute(*(data[field] for field in check.fields)))
        if logged.issuperset(check.fields)
        else float("nan")
        for name, check in CHECKS.items()
    }
