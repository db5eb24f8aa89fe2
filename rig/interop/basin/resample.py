"""Cubic interpolation of an evenly sampled record."""

from typing import Any

import numpy as np

from rig.recording.channel_file import Floats


def interpolate_cubic(time: Floats, value: Floats, at: Floats) -> Floats:
    """Return ``value`` at times ``at`` by the cubic through the four nearest samples; NaN outside.

    ``time`` must be evenly spaced. The error for a 1 Hz wave sampled at 50 Hz is 6e-6 of its
    amplitude; linear interpolation would give 2e-3. A NaN sample affects only results within two
    samples of it.
    """
    count = len(time)
    rate = (count - 1) / float(time[-1] - time[0])
    position = (at - time[0]) * rate
    inside = (position >= -1e-6) & (position <= count - 1 + 1e-6)
    if count < 4:
        return np.where(inside, np.interp(at, time, value), np.nan)
    first = np.clip(np.floor(np.where(inside, position, 0.0)).astype(np.int64) - 1, 0, count - 4)
    x: Any = position - first  # 1 .. 2 except at the ends
    a, b, c, d = (value[first + i] for i in range(4))
    result = (
        -a * (x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0
        + b * x * (x - 2.0) * (x - 3.0) / 2.0
        - c * x * (x - 1.0) * (x - 3.0) / 2.0
        + d * x * (x - 1.0) * (x - 2.0) / 6.0
    )
    return np.asarray(np.where(inside, result, np.nan), dtype=np.float64)
