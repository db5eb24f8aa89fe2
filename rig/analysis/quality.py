"""Columns of the row table that tell whether a row can be trusted.

They are those that the test's own scripts keep beside power (public fbWecCntrl repository,
MASK4/MHKDRCode): least stator force, mean slew force, percentiles of the load cells and of
velocity, mean bus voltage; and what this rig logs besides: how often the drive saturated, rested
or burned power, and what surge did. Forces are from their tared zeros, but for the stator's: it is
not zero at rest, and what matters of it is its sign.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs.mcap_file import Records


class Check(NamedTuple):
    """One column: the log fields it is made of, and how."""

    unit: str
    fields: tuple[str, ...]
    of: Callable[..., Any]  # of the fields' values over the measured ticks, in that order


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


def fields(there: Iterable[str]) -> list[str]:
    """The log fields that the columns need, of those a run has."""
    needed = dict.fromkeys(name for check in CHECKS.values() for name in check.fields)
    known = set(there)
    return [name for name in needed if name in known]


def columns(data: Records) -> dict[str, float]:
    """Each column's value over a window; NaN where the run did not log what it is made of."""
    known = set(data.dtype.names or ())
    return {
        name: float(check.of(*(data[field] for field in check.fields)))
        if known.issuperset(check.fields)
        else float("nan")
        for name, check in CHECKS.items()
    }
