"""Values of an even record between its samples."""

from typing import Any

import numpy as np

from rig.interop.basin.recording import Floats


def cubic(time: Floats, value: Floats, at: Floats) -> Floats:
    """``value`` at times ``at`` by the cubic through the four samples around each; NaN outside.

    ``time`` rises evenly. Of a wave of 1 Hz at 50 Hz this leaves 6e-6 of its amplitude; a straight
    line would leave 2e-3. A sample that is NaN spoils only what lies within two samples of it.
    """
    count = len(time)
    rate = (count - 1) / float(time[-1] - time[0])
    place = (at - time[0]) * rate
    inside = (place >= -1e-6) & (place <= count - 1 + 1e-6)
    if count < 4:
        return np.where(inside, np.interp(at, time, value), np.nan)
    first = np.clip(np.floor(np.where(inside, place, 0.0)).astype(np.int64) - 1, 0, count - 4)
    x: Any = place - first  # 1 .. 2 but at the ends
    a, b, c, d = (value[first + i] for i in range(4))
    found = (
        -a * (x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0
        + b * x * (x - 2.0) * (x - 3.0) / 2.0
        - c * x * (x - 1.0) * (x - 3.0) / 2.0
        + d * x * (x - 1.0) * (x - 2.0) / 6.0
    )
    return np.asarray(np.where(inside, found, np.nan), dtype=np.float64)
