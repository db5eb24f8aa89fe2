"""Conversion between amperes, metres and a drive's raw numbers.

The raw steps of current in the command and in the feedback may differ:

                command 0x6071                  feedback 0x6077
    AMC         raw = i 2^15 / Kp  (DC2)        i = raw Kp / 2^13  (DC1)
    standard    raw = 1000 Kt i / T_rated       i = raw T_rated / (1000 Kt)

Kp is the drive's peak current, always read back from 0x20D8:0C in 0.1 A, never configured by hand.
Confusing DC1 and DC2 makes a current wrong by a factor of 4 (AMC CANopen manual, drive units).
T_rated is 0x6076 in mN m; for a drive with 0x6075 (rated current, mA), raw = 1000 i / i_rated.

A current that is not finite becomes zero with a flag, one beyond the range is clamped with a flag:
no function here that runs in a tick raises.
"""

from enum import IntFlag
from math import isfinite
from typing import NamedTuple


class LimitFlag(IntFlag):
    """The reasons why a raw number differs from the request."""

    SATURATED = 1
    NOT_FINITE = 2


_SATURATED, _NOT_FINITE = LimitFlag.SATURATED.value, LimitFlag.NOT_FINITE.value
_I16 = 0x7FFF  # -0x8000 is not used, so that both directions have the same range
_I32 = 0x7FFFFFFF


class CurrentScale(NamedTuple):
    """Drive current between amperes and raw numbers."""

    raw_per_ampere: float  # of the command 0x6071
    ampere_per_raw: float  # of the feedback 0x6077
    raw_limit: int  # > 0, largest command in either direction


class PositionScale(NamedTuple):
    """Scale between a position in the rig's unit and counts of the drive (0x6064, 0x607A)."""

    counts_per_unit: float  # with sign, not 0
    zero: int  # counts at position 0
    low: int  # counts, soft limits (0x607D); low <= high
    high: int


class RawCommand(NamedTuple):
    """A raw number to send."""

    value: int
    limit_flags: int  # set of `LimitFlag`; 0: equal to the request


class ScalingError(ValueError):
    """An invalid scale; names the object or parameter."""


def _positive(name: str, value: float) -> float:
    if not (value > 0.0 and isfinite(value)):
        raise ScalingError(f"{name} is {value}; it must be above 0")
    return value


def _scale(command: float, feedback: float, limit: float) -> CurrentScale:
    raw_limit = min(int(_positive("current limit, A", limit) * command), _I16)
    if raw_limit < 1:
        raise ScalingError(f"current limit {limit} A is below one step of the command")
    return CurrentScale(command, feedback, raw_limit)


def amc_current(kp_raw: int, limit: float) -> CurrentScale:
    """Return the scale of an AMC drive from Kp as read from 0x20D8:0C (0.1 A) and a limit (A)."""
    kp = _positive("Kp, 0x20D8:0C", kp_raw / 10.0)
    return _scale(32768.0 / kp, kp / 8192.0, limit)


def rated_torque_current(rated_torque: int, kt: float, limit: float) -> CurrentScale:
    """Return a per-mille scale from 0x6076 (mN m), Kt (N m/A at the motor) and a limit (A)."""
    torque = 1e-3 * _positive("rated torque, 0x6076", float(rated_torque))
    per_ampere = 1000.0 * _positive("Kt, N m/A", kt) / torque
    return _scale(per_ampere, 1.0 / per_ampere, limit)


def rated_current(rated: int, limit: float) -> CurrentScale:
    """Return a per-mille scale from 0x6075 (mA) and a limit (A)."""
    per_ampere = 1000.0 / (1e-3 * _positive("rated current, 0x6075", float(rated)))
    return _scale(per_ampere, 1.0 / per_ampere, limit)


def kt_of_drive(rated_torque: int, rated_current_ma: int) -> float:
    """Return the Kt (N m/A) that a drive's 0x6076 (mN m) and 0x6075 (mA) imply, for comparison."""
    torque = _positive("rated torque, 0x6076", float(rated_torque))
    return torque / _positive("rated current, 0x6075", float(rated_current_ma))


def current_command(scale: CurrentScale, current: float) -> RawCommand:
    """Return the raw command for a drive current (A), to the nearest step."""
    if not isfinite(current):
        return RawCommand(0, _NOT_FINITE)
    return _clamp(current * scale.raw_per_ampere, -scale.raw_limit, scale.raw_limit)


def current_feedback(scale: CurrentScale, raw: int) -> float:
    """Return the drive current (A) of a raw feedback."""
    return raw * scale.ampere_per_raw


def position_scale(counts_per_unit: float, zero: int, low: int, high: int) -> PositionScale:
    """Return a checked scale; ScalingError for limits that cross or exceed 32 bits, or factor 0."""
    if not (isfinite(counts_per_unit) and counts_per_unit != 0.0):
        raise ScalingError(f"counts per unit is {counts_per_unit}; it must be finite and not 0")
    if not -_I32 <= low <= high <= _I32:
        raise ScalingError(f"position limits {low} to {high} counts, 0x607D: not an i32 range")
    return PositionScale(counts_per_unit, zero, low, high)


def position_command(scale: PositionScale, position: float) -> RawCommand:
    """Return the target in counts for a position; a target flagged NOT_FINITE must not be sent."""
    if not isfinite(position):
        return RawCommand(scale.zero, _NOT_FINITE)
    return _clamp(position * scale.counts_per_unit + scale.zero, scale.low, scale.high)


def position_feedback(scale: PositionScale, counts: int) -> float:
    """Return the position of a number of counts."""
    return (counts - scale.zero) / scale.counts_per_unit


def unwrap_counts(before: int, raw: int) -> int:
    """Return the unwrapped counts of an i32 that wraps, nearest to the count ``before``."""
    return before + ((raw - before + 0x80000000) & 0xFFFFFFFF) - 0x80000000


def _clamp(value: float, low: int, high: int) -> RawCommand:
    if value > high:
        return RawCommand(high, _SATURATED)
    if value < low:
        return RawCommand(low, _SATURATED)
    return RawCommand(round(value), 0)
