"""Recorded wave elevation as a sea: one channel of a basin's record, over the window asked for."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.basin.recording import METRES, Floats, read_recording, refused
from rig.config.problems import number_text
from rig.config.sea import RecordedSea

_RATE_TOLERANCE = 1e-3  # of the rate; time columns are rounded


class Elevation(NamedTuple):
    """Undisturbed wave elevation over the window of a recorded sea."""

    rate_hz: float
    elevation: Floats  # m, up positive, mean taken out


def read_elevation(path: Path, sea: RecordedSea) -> Elevation:
    """Elevation of a recorded sea's channel, samples with start_s <= t < end_s.

    The rate is that of the file's time column. Raises `ConfigError` naming file and line.
    """
    read = read_recording(path, [sea.channel])
    time, values, rate = read.time, read.channels[sea.channel], read.rate
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        line = int(read.lines[bad[0]])
        raise refused(path, line, "", "a sample that is not a finite number")
    if sea.rate_hz is not None and abs(sea.rate_hz - rate) > _RATE_TOLERANCE * rate:
        said = number_text(sea.rate_hz)
        message = f"the campaign says {said} Hz, the time column {rate:.6g} Hz"
        raise refused(path, 1, "rate_hz", message)
    # Half a sample of grace: a time column is rounded.
    inside = (time >= sea.start_s - 0.5 / rate) & (time < sea.end_s - 0.5 / rate)
    value = values[inside] * METRES[sea.unit]
    wanted = round((sea.end_s - sea.start_s) * rate)
    if len(value) != wanted:
        raise refused(
            path,
            1,
            sea.channel,
            f"the window {number_text(sea.start_s)} .. {number_text(sea.end_s)} s is not in the "
            f"record; it has {time[0]:.6g} .. {time[-1] + 1.0 / rate:.6g} s",
        )
    return Elevation(rate, value - value.mean())
