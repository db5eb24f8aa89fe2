"""Between amperes, metres and a drive's raw numbers.

A drive is told and tells current in raw steps, and the two need not be the same step:

                command 0x6071                  feedback 0x6077
    AMC         raw = i 2^15 / Kp  (DC2)        i = raw Kp / 2^13  (DC1)
    standard    raw = 1000 Kt i / T_rated       i = raw T_rated / (1000 Kt)

Kp is the drive's peak current, read back from 0x20D8:0C in 0.1 A, never typed: read with the wrong
one of DC1 and DC2 a current is off by a factor of 4 (AMC CANopen manual, drive units). T_rated is
0x6076 in mN m; where a drive has 0x6075 (rated current, mA) instead, raw = 1000 i / i_rated.

A current that is not finite becomes zero with a flag, one beyond the range is held with a flag: no
function here that runs in a tick raises anything.
"""

from enum import IntFlag
from math import isfinite
from typing import NamedTuple


class Held(IntFlag):
    """Why a raw number is not what was asked for."""

    SATURATED = 1
    NOT_FINITE = 2


_SATURATED, _NOT_FINITE = Held.SATURATED.value, Held.NOT_FINITE.value
_I16 = 0x7FFF  # -0x8000 is not used, so that both directions reach equally far
_I32 = 0x7FFFFFFF


class CurrentScale(NamedTuple):
    """Drive current between amperes and raw numbers."""

    raw_per_ampere: float  # of the command 0x6071
    ampere_per_raw: float  # of the feedback 0x6077
    raw_limit: int  # > 0, most of the command in either direction


class PositionScale(NamedTuple):
    """A position between a unit of ours and counts of the drive (0x6064, 0x607A)."""

    counts_per_unit: float  # sign included, not 0
    zero: int  # counts where our position is 0
    low: int  # counts, soft limits (0x607D); low <= high
    high: int


class Raw(NamedTuple):
    """A number for the wire."""

    value: int
    held: int  # set of `Held`; 0: it is what was asked for


class ScalingError(ValueError):
    """A scale that cannot be, with the object or parameter named."""


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
    """Scale of an AMC drive from Kp as read from 0x20D8:0C (0.1 A), held at ``limit`` (A)."""
    kp = _positive("Kp, 0x20D8:0C", kp_raw / 10.0)
    return _scale(32768.0 / kp, kp / 8192.0, limit)


def rated_torque_current(rated_torque: int, kt: float, limit: float) -> CurrentScale:
    """Per-mille scale from 0x6076 (mN m) and Kt (N m/A at the motor), held at ``limit`` (A)."""
    torque = 1e-3 * _positive("rated torque, 0x6076", float(rated_torque))
    per_ampere = 1000.0 * _positive("Kt, N m/A", kt) / torque
    return _scale(per_ampere, 1.0 / per_ampere, limit)


def rated_current(rated: int, limit: float) -> CurrentScale:
    """Per-mille scale from 0x6075 (mA), held at ``limit`` (A)."""
    per_ampere = 1000.0 / (1e-3 * _positive("rated current, 0x6075", float(rated)))
    return _scale(per_ampere, 1.0 / per_ampere, limit)


def kt_of_drive(rated_torque: int, rated_current_ma: int) -> float:
    """Kt (N m/A) that a drive's own 0x6076 (mN m) and 0x6075 (mA) imply, to hold against ours."""
    torque = _positive("rated torque, 0x6076", float(rated_torque))
    return torque / _positive("rated current, 0x6075", float(rated_current_ma))


def current_command(scale: CurrentScale, current: float) -> Raw:
    """The raw command for a drive current (A), to the nearest step."""
    if not isfinite(current):
        return Raw(0, _NOT_FINITE)
    return _held(current * scale.raw_per_ampere, -scale.raw_limit, scale.raw_limit)


def current_feedback(scale: CurrentScale, raw: int) -> float:
    """The drive current (A) that a raw feedback means."""
    return raw * scale.ampere_per_raw


def position_scale(counts_per_unit: float, zero: int, low: int, high: int) -> PositionScale:
    """A checked scale; ScalingError if its limits cross, leave 32 bits, or the factor is no use."""
    if not (isfinite(counts_per_unit) and counts_per_unit != 0.0):
        raise ScalingError(f"counts per unit is {counts_per_unit}; it must be finite and not 0")
    if not -_I32 <= low <= high <= _I32:
        raise ScalingError(f"position limits {low} to {high} counts, 0x607D: not an i32 range")
    return PositionScale(counts_per_unit, zero, low, high)


def position_command(scale: PositionScale, position: float) -> Raw:
    """The target in counts for a position; NOT_FINITE is no target at all and must not be sent."""
    if not isfinite(position):
        return Raw(scale.zero, _NOT_FINITE)
    return _held(position * scale.counts_per_unit + scale.zero, scale.low, scale.high)


def position_feedback(scale: PositionScale, counts: int) -> float:
    """The position that counts mean."""
    return (counts - scale.zero) / scale.counts_per_unit


def unwrapped(before: int, raw: int) -> int:
    """Counts without end from an i32 that wraps, the nearest to the count ``before``."""
    return before + ((raw - before + 0x80000000) & 0xFFFFFFFF) - 0x80000000


def _held(wanted: float, low: int, high: int) -> Raw:
    if wanted > high:
        return Raw(high, _SATURATED)
    if wanted < low:
        return Raw(low, _SATURATED)
    return Raw(round(wanted), 0)
