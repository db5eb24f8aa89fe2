"""Find the rows of a recorded MASK4 run by time, as the test's scripts do, and check them.

The first row begins 120 s after runCounter's first 1. Rows follow each other in equal intervals
until the gain that marks the end (MASK4 report (Sandia), 3.2.3). Where the spring rate changes, a
row occurs twice, the first time while the stator moves. Files exported by this package hold row and
phase as labels.
"""

from typing import Any, NamedTuple

import numpy as np

from rig.config.matrix import END_MARK
from rig.interop.legacy.mask4 import RowRoles, classify_rows
from rig.kinds.wavebot.mask4.fields import RIG_BUS
from rig.realtime.sequence import NO_ROW, Phase
from rig.spectra.periods import Floats, Ticks


class RowTiming(NamedTuple):
    """Timing of a test's rows, s."""

    interval: float  # from row to row: 20 for regular waves, 300 for irregular ones
    settle: float  # from the start of the interval to the window
    measure: float  # length of the window
    lead: float = 120.0  # from runCounter's 1 to the first row


class RowWindows(NamedTuple):
    """Row, phase and attempt of every sample."""

    row: Ticks
    phase: Ticks
    attempt: Ticks
    remarks: tuple[str, ...]


def from_labels(variables: dict[str, Any]) -> RowWindows | None:
    """Return the windows that the labels of the file give; None without labels."""
    names = [f"{RIG_BUS}.{name}" for name in ("row", "phase", "attempt")]
    if not all(name in variables for name in names):
        return None
    row, phase, attempt = (np.asarray(variables[name]).astype(np.int64) for name in names)
    return RowWindows(row, phase, attempt, ())


def find_by_time(
    time: Floats, counter: Floats, settings: Floats, columns: tuple[str, ...], timing: RowTiming
) -> RowWindows:
    """Return the windows of rows of equal intervals.

    ``settings`` (samples by columns) are constant within a row; ``columns`` contains kp, ki and
    spring_rate, with kp first. A window in which a setting changes ends there, so that it counts as
    cut short. Raises ValueError if no row is found.
    """
    first, count = _extent(time, counter, settings[:, 0], timing)
    starts = np.asarray(first + timing.interval * np.arange(count + 1), dtype=np.float64)
    edges = _sample_index(time, starts)
    window_starts = _sample_index(time, starts[:-1] + timing.settle)
    window_ends = _sample_index(time, starts[:-1] + timing.settle + timing.measure)
    set_points = [tuple(settings[i].tolist()) for i in window_starts]
    roles = classify_rows(set_points, columns.index("kp"), columns.index("spring_rate"), 0)
    row, attempt = np.full(len(time), NO_ROW, np.int64), np.zeros(len(time), np.int64)
    phase = np.full(len(time), int(Phase.DONE), np.int64)
    phase[: edges[0]] = Phase.LEAD_IN
    remarks = _remarks(settings[:, 0], roles)
    number = 0
    for k in range(count):
        row[edges[k] : edges[k + 1]] = number
        if k in roles.doubled:
            phase[edges[k] : edges[k + 1]] = Phase.MOVING
            continue
        window = settings[window_starts[k] : window_ends[k]]
        changed = np.flatnonzero((window != window[0]).any(axis=1))
        if changed.size:
            remarks.append(f"row {number}: a setting changes {changed[0]} samples into its window")
        last = window_starts[k] + int(changed[0]) if changed.size else window_ends[k]
        phase[edges[k] : window_starts[k]] = Phase.SETTLE
        phase[window_starts[k] : last] = Phase.MEASURE
        phase[last : edges[k + 1]] = Phase.TAIL
        number += 1
    return RowWindows(row, phase, attempt, tuple(remarks))


def _extent(time: Floats, counter: Floats, kp: Floats, timing: RowTiming) -> tuple[float, int]:
    """Return the start of the first row's interval (s) and the number of whole intervals."""
    ones = np.flatnonzero(counter == 1.0)
    if ones.size == 0:
        raise ValueError("expCtrl.runCounter is never 1: the run did not start")
    start = float(time[ones[0]]) + timing.lead
    ended = np.flatnonzero(kp == END_MARK)
    end = float(time[ended[0]]) if ended.size else float(time[-1])
    count = int((end - start) / timing.interval + 1e-6)
    if count < 1:
        raise ValueError(
            f"no row of {timing.interval:g} s between {start:.1f} s, where rows begin, and "
            f"{end:.1f} s, where the gains end"
        )
    return start, count


def _remarks(kp: Floats, roles: RowRoles) -> list[str]:
    """Return remarks on the end mark and the auxiliary rows."""
    remarks = []
    if not (kp == END_MARK).any():
        remarks.append("no end mark (Kp = -999): rows go on to the end of the record")
    if roles.doubled:
        remarks.append(f"{len(roles.doubled)} intervals during which the spring moved are left out")
    if roles.not_doubled:
        remarks.append(
            f"the spring changes {len(roles.not_doubled)} times without an interval for it"
        )
    return remarks


def _sample_index(time: Floats, moments: Floats) -> Ticks:
    """Return the index of the first sample at or after each moment (half a sample tolerance)."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    return np.searchsorted(time, moments - 0.5 * step).astype(np.int64)
