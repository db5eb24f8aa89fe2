"""Recorded wave elevation as a sea: one channel of a basin's record, over the window asked for."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.config.problems import number_text
from rig.config.sea import RecordedSea
from rig.interop.basin.recording import METRES, Floats, read_recording, refused

_RATE_TOLERANCE = 1e-3  # of the rate; time columns are rounded


class Elevation(NamedTuple):
    """Undisturbed wave elevation over the window of a recorded sea."""

    rate_hz: float
    elevation: Floats  # m, up positive, mean taken out


def read_elevation(path: Path, sea: RecordedSea) -> Elevation:
    """Elevation of a recorded sea's channel; raises `ConfigError` naming file and line."""
    rate, value = read_window(path, sea.channel, (sea.start_s, sea.end_s), sea.rate_hz)
    value = value * METRES[sea.unit]
    return Elevation(rate, value - value.mean())


def read_window(
    path: Path, channel: str, window: tuple[float, float], said_hz: float | None
) -> tuple[float, Floats]:
    """Rate (Hz) and samples of a channel with start <= t < end (s), in the file's own unit.

    The rate is that of the file's time column; ``said_hz`` is what the campaign says it is.
    Raises `ConfigError` naming file and line.
    """
    read = read_recording(path, [channel])
    time, values, rate = read.time, read.channels[channel], read.rate
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        line = int(read.lines[bad[0]])
        raise refused(path, line, "", "a sample that is not a finite number")
    if said_hz is not None and abs(said_hz - rate) > _RATE_TOLERANCE * rate:
        message = f"the campaign says {number_text(said_hz)} Hz, the time column {rate:.6g} Hz"
        raise refused(path, 1, "rate_hz", message)
    start, end = window
    # Half a sample of grace: a time column is rounded.
    inside = (time >= start - 0.5 / rate) & (time < end - 0.5 / rate)
    value = values[inside]
    wanted = round((end - start) * rate)
    if len(value) != wanted:
        raise refused(
            path,
            1,
            channel,
            f"the window {number_text(start)} .. {number_text(end)} s is not in the "
            f"record; it has {time[0]:.6g} .. {time[-1] + 1.0 / rate:.6g} s",
        )
    return rate, value
