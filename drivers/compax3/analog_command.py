"""The +-10 V command of a servo drive: command -> volts and back, with offset, gain and clamp.

    volts = offset + gain * command, clamped to [low, high]

The drive interprets the voltage as speed or torque, depending on its configuration; ``command`` is
that quantity in SI. A drive configured for 37.5 rev/s of the motor at 10 V has a gain of
10 V / (2 pi 37.5 rad/s); measure the actual gain and offset instead of using nominal ones.
Source of the scale: the bench's thesis, eq. 3.1 and 3.2.
"""

import math
from typing import NamedTuple

from drivers.errors import CodecError

_SUBJECT = "analog command"


class Params(NamedTuple):
    """Calibration of one channel; `make_params` returns a checked one."""

    offset: float  # V at zero command
    gain: float  # V per unit of the command, not 0; negative reverses the direction
    low: float  # V
    high: float  # V


class Output(NamedTuple):
    """Value for the analog output."""

    volts: float
    saturated: int  # -1: clamped to low, +1: clamped to high, 0: not clamped


def make_params(offset: float, gain: float, low: float, high: float) -> Params:
    """Return checked parameters: all finite, gain not 0, and low < offset < high.

    CodecError otherwise. With an offset outside the clamp, a zero command could not be sent.
    """
    if not all(math.isfinite(number) for number in (offset, gain, low, high)):
        raise CodecError(_SUBJECT, "calibration", "finite numbers", (offset, gain, low, high))
    if gain == 0.0 or not math.isfinite(1.0 / gain):
        raise CodecError(_SUBJECT, "gain", "not 0", gain)
    if not low < offset < high:
        raise CodecError(_SUBJECT, "offset", f"within {low} to {high} V", offset)
    return Params(offset, gain, low, high)


def to_volts(params: Params, command: float) -> Output:
    """Return the voltage of a command, clamped and flagged when clamped.

    CodecError for NaN and infinity; the caller should then send `rest_voltage`.
    """
    if not math.isfinite(command):
        raise CodecError(_SUBJECT, "command", "a finite number", command)
    volts = params.offset + params.gain * command
    if volts < params.low:
        return Output(params.low, -1)
    if volts > params.high:
        return Output(params.high, 1)
    return Output(volts, 0)


def to_command(params: Params, volts: float) -> float:
    """Return the command for a voltage, for example a read-back; CodecError when not finite."""
    if not math.isfinite(volts):
        raise CodecError(_SUBJECT, "volts", "a finite number", volts)
    command = (volts - params.offset) / params.gain
    if not math.isfinite(command):
        raise CodecError(_SUBJECT, "volts", "a voltage a finite command gives", volts)
    return command


def rest_voltage(params: Params) -> float:
    """Return the voltage (V) at zero command, sent on a stop, an expiry and a refusal."""
    return params.offset
