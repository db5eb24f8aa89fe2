"""Recorded wave elevation as a sea: one channel of a basin recording, over a window of time."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.config.problems import format_number
from rig.config.sea import RecordedSea
from rig.recording.channel_file import METRES_PER_UNIT, Floats, read_recording, record_error

_RATE_TOLERANCE = 1e-3  # relative; time columns are rounded


class Elevation(NamedTuple):
    """Undisturbed wave elevation over the window of a recorded sea."""

    rate_hz: float
    elevation: Floats  # m, positive upwards, mean removed


def read_elevation(path: Path, sea: RecordedSea) -> Elevation:
    """Return the elevation of a recorded sea; raises `ConfigError` with file and line."""
    rate, value = read_channel_window(path, sea.channel, (sea.start_s, sea.end_s), sea.rate_hz)
    value = value * METRES_PER_UNIT[sea.unit]
    return Elevation(rate, value - value.mean())


def read_channel_window(
    path: Path, channel: str, window: tuple[float, float], expected_rate_hz: float | None
) -> tuple[float, Floats]:
    """Return rate (Hz) and samples of a channel with start <= t < end (s), in the file's unit.

    The rate is that of the file's time column; ``expected_rate_hz`` is the rate in the campaign.
    Raises `ConfigError` with file and line.
    """
    recording = read_recording(path, [channel])
    time, values, rate = recording.time, recording.channels[channel], recording.rate
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        line = int(recording.lines[bad[0]])
        raise record_error(path, line, "", "a sample that is not a finite number")
    if expected_rate_hz is not None and abs(expected_rate_hz - rate) > _RATE_TOLERANCE * rate:
        message = (
            f"the campaign gives {format_number(expected_rate_hz)} Hz, "
            f"the time column {rate:.6g} Hz"
        )
        raise record_error(path, 1, "rate_hz", message)
    start, end = window
    # The limits are shifted by half a sample, because a time column is rounded.
    inside = (time >= start - 0.5 / rate) & (time < end - 0.5 / rate)
    samples = values[inside]
    if len(samples) != round((end - start) * rate):
        raise record_error(
            path,
            1,
            channel,
            f"the window {format_number(start)} .. {format_number(end)} s is not in the "
            f"record; it has {time[0]:.6g} .. {time[-1] + 1.0 / rate:.6g} s",
        )
    return rate, samples
