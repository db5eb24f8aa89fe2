"""The +-10 V command of a servo drive: command -> volts and back, with offset, gain and clamp.

    volts = offset + gain * command, held within [low, high]

The drive reads the voltage as speed or torque, whichever its configuration says; ``command`` is
that quantity in SI. A drive configured for 37.5 rev/s of the motor at 10 V has a gain of
10 V / (2 pi 37.5 rad/s); what gain and offset really are is measured, not read from a label.
Source of the scale: the bench's thesis, eq. 3.1 and 3.2.
"""

import math
from typing import NamedTuple

from drivers.errors import CodecError

_WHAT = "analog command"


class Params(NamedTuple):
    """Calibration of one channel; make it with `calibrated`."""

    offset: float  # V that command nothing
    gain: float  # V per unit of the command, not 0; negative turns the direction
    low: float  # V
    high: float  # V


class Output(NamedTuple):
    """What goes to the analog output."""

    volts: float
    saturated: int  # -1 held at low, +1 held at high, 0 as asked


def calibrated(offset: float, gain: float, low: float, high: float) -> Params:
    """Checked parameters: all finite, gain not 0, and low < offset < high.

    An offset outside the clamp would mean that the drive cannot be told to do nothing.
    CodecError otherwise.
    """
    if not all(math.isfinite(number) for number in (offset, gain, low, high)):
        raise CodecError(_WHAT, "calibration", "finite numbers", (offset, gain, low, high))
    if gain == 0.0 or not math.isfinite(1.0 / gain):
        raise CodecError(_WHAT, "gain", "not 0", gain)
    if not low < offset < high:
        raise CodecError(_WHAT, "offset", f"within {low} to {high} V", offset)
    return Params(offset, gain, low, high)


def to_volts(params: Params, command: float) -> Output:
    """The voltage of a command, held within the clamp and flagged when it is held.

    CodecError for NaN and infinity: `rest` is the voltage to send then, and the caller's to choose.
    """
    if not math.isfinite(command):
        raise CodecError(_WHAT, "command", "a finite number", command)
    volts = params.offset + params.gain * command
    if volts < params.low:
        return Output(params.low, -1)
    if volts > params.high:
        return Output(params.high, 1)
    return Output(volts, 0)


def to_command(params: Params, volts: float) -> float:
    """The command that a voltage stands for, as for a read-back; CodecError when not finite."""
    if not math.isfinite(volts):
        raise CodecError(_WHAT, "volts", "a finite number", volts)
    command = (volts - params.offset) / params.gain
    if not math.isfinite(command):
        raise CodecError(_WHAT, "volts", "a voltage a finite command gives", volts)
    return command


def rest(params: Params) -> float:
    """The voltage (V) that commands nothing: what a stop, an expiry and a refusal send."""
    return params.offset
