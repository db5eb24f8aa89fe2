"""Reading of a six-axis load cell, common to all boxes, and the tare on the host.

A box may have a bias of its own. The tare here is the host's and independent of it: it survives a
restart of the box, its numbers are known, and it can be removed.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.force_torque.wrench import Vector6, Wrench

NO_BIAS: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ZERO_WRENCH = Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Phase(IntEnum):
    """Phase of the conversation."""

    STOPPING = 0  # stopping a stream that may run, and waiting for a quiet line
    READING = 1  # reading the calibration from the box
    STARTING = 2  # start sent, no sample received yet
    STREAMING = 3
    REFUSED = 4  # not the configured sensor; not used


class LoadCellReading(NamedTuple):
    """The last good sample, and the flags of the last sample."""

    wrench: Wrench  # N and N m in the sensor's frame, tared
    age: float  # s since its earliest possible arrival; very large before the first sample
    saturated: int  # of the last sample, good or not: 0, or a mask of gauges (Net F/T: 1)
    fault: int  # 1: the box flagged the last sample as faulty
    phase: Phase


class Tare(NamedTuple):
    """The host's bias, in counts, and the running sum for the next one."""

    bias: Vector6
    remaining: int  # samples still missing for the next bias; 0: no tare is running
    total: int  # samples of the next bias
    sum: Vector6  # of the samples received so far, in counts


def no_tare() -> Tare:
    """Return a tare with zero bias."""
    return Tare(NO_BIAS, 0, 0, NO_BIAS)


def begin_tare(tare: Tare, samples: int) -> Tare:
    """Return a tare whose next bias is the mean of the next ``samples`` (at least 1) good ones."""
    count = max(1, samples)
    return Tare(tare.bias, count, count, NO_BIAS)


def add_tare_sample(tare: Tare, counts: Vector6) -> Tare:
    """Return the tare after one good sample; the bias changes with the last one."""
    bias, left, total, partial_sum = tare
    if left == 0:
        return tare
    a, b, c, d, e, f = (old + new for old, new in zip(partial_sum, counts, strict=True))
    if left > 1:
        return Tare(bias, left - 1, total, (a, b, c, d, e, f))
    return Tare((a / total, b / total, c / total, d / total, e / total, f / total), 0, 0, NO_BIAS)
