"""What a six-axis load cell gives, whichever box it hangs on, and the tare of this side.

A box may have a bias of its own; the one here is the host's, kept beside it: it survives a box that
restarts, it is known as numbers, and it can be taken back.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.force_torque.wrench import Six, Wrench

NO_BIAS: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NOTHING = Wrench(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Phase(IntEnum):
    """Where the conversation stands."""

    STOPPING = 0  # a stream that may run is stopped, and the line falls quiet
    READING = 1  # the calibration is read from the box
    STARTING = 2  # told to stream, and has not yet
    STREAMING = 3
    REFUSED = 4  # not the sensor that was agreed; not used


class Reading(NamedTuple):
    """The last good sample, and what speaks against the one after it."""

    wrench: Wrench  # N and N m in the sensor's frame, tared
    age: float  # s since it was on this side at the latest; very large before the first
    saturated: int  # of the last sample, good or not: 0, or which gauges (1: which is not told)
    fault: int  # 1: the box called the last sample faulty
    phase: Phase


class Tare(NamedTuple):
    """The host's bias, in counts, and the mean that will be the next one."""

    bias: Six
    left: int  # samples to come until it is taken
    total: int  # of them
    sum: Six


def untared() -> Tare:
    """No bias."""
    return Tare(NO_BIAS, 0, 0, NO_BIAS)


def begin_tare(tare: Tare, samples: int) -> Tare:
    """Take the mean of so many good samples from now on as the bias (at least one)."""
    count = max(1, samples)
    return Tare(tare.bias, count, count, NO_BIAS)


def take_tare(tare: Tare, counts: Six) -> Tare:
    """Take in one good sample; the bias changes when the last has come."""
    bias, left, total, so_far = tare
    if left == 0:
        return tare
    a, b, c, d, e, f = (old + new for old, new in zip(so_far, counts, strict=True))
    if left > 1:
        return Tare(bias, left - 1, total, (a, b, c, d, e, f))
    return Tare((a / total, b / total, c / total, d / total, e / total, f / total), 0, 0, NO_BIAS)
