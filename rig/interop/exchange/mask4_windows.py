"""Rows of a recorded MASK4 run, as its own scripts find them: by time alone, then checked.

The first row begins 120 s after runCounter's first 1, rows follow each other in equal intervals
until the gain that means the end (MASK4 report (Sandia), 3.2.3). Where the spring changes a row
stands twice, the first time while the stator moves. A file of ours says row and phase itself.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.columns import END_MARK
from rig.interop.exchange.mask4_fields import OWN
from rig.interop.legacy.mask4_rows import Found, structure
from rig.realtime.sequence import NO_ROW, Phase

Floats = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int64]


class Timing(NamedTuple):
    """What a person knows of a test's rows, s."""

    interval: float  # from row to row: 20 for regular waves, 300 for irregular ones
    settle: float  # of it, before the window
    measure: float  # the window
    lead: float = 120.0  # from runCounter's 1 to the first row


class Windows(NamedTuple):
    """Row, phase and attempt of every sample."""

    row: Labels
    phase: Labels
    attempt: Labels
    remarks: tuple[str, ...]


def from_labels(found: dict[str, Any]) -> Windows | None:
    """As the file itself says; None if it does not."""
    names = [f"{OWN}.{name}" for name in ("row", "phase", "attempt")]
    if not all(name in found for name in names):
        return None
    row, phase, attempt = (np.asarray(found[name]).astype(np.int64) for name in names)
    return Windows(row, phase, attempt, ())


def by_time(
    time: Floats, counter: Floats, settings: Floats, columns: tuple[str, ...], timing: Timing
) -> Windows:
    """Rows of equal intervals; ``settings`` (samples by columns) are what a row holds still.

    ``columns`` begins with kp, ki, spring_rate. A window in which a setting changes is left as it
    is, but for its end, so that it counts as cut short. ValueError if there is no first row.
    """
    first, count = _extent(time, counter, settings[:, 0], timing)
    begun = np.asarray(first + timing.interval * np.arange(count + 1), dtype=np.float64)
    edges, begins = _at(time, begun), _at(time, begun[:-1] + timing.settle)
    ends = _at(time, begun[:-1] + timing.settle + timing.measure)
    held = [tuple(settings[i].tolist()) for i in begins]
    kinds = structure(held, columns.index("kp"), columns.index("spring_rate"), 0)
    row, attempt = np.full(len(time), NO_ROW, np.int64), np.zeros(len(time), np.int64)
    phase = np.full(len(time), int(Phase.DONE), np.int64)
    phase[: edges[0]] = Phase.LEAD_IN
    remarks = _remarks(settings[:, 0], kinds)
    number = 0
    for k in range(count):
        row[edges[k] : edges[k + 1]] = number
        if k in kinds.doubled:
            phase[edges[k] : edges[k + 1]] = Phase.MOVING
            continue
        window = settings[begins[k] : ends[k]]
        changed = np.flatnonzero((window != window[0]).any(axis=1))
        if changed.size:
            remarks.append(f"row {number}: a setting changes {changed[0]} samples into its window")
        last = begins[k] + int(changed[0]) if changed.size else ends[k]
        phase[edges[k] : begins[k]] = Phase.SETTLE
        phase[begins[k] : last] = Phase.MEASURE
        phase[last : edges[k + 1]] = Phase.TAIL
        number += 1
    return Windows(row, phase, attempt, tuple(remarks))


def _extent(time: Floats, counter: Floats, kp: Floats, timing: Timing) -> tuple[float, int]:
    """When the first row's interval begins (s), and how many whole ones there are."""
    ones = np.flatnonzero(counter == 1.0)
    if ones.size == 0:
        raise ValueError("expCtrl.runCounter is never 1: the run was not begun")
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


def _remarks(kp: Floats, kinds: Found) -> list[str]:
    """What is remarkable about the intervals, apart from what changes in them."""
    said = []
    if not (kp == END_MARK).any():
        said.append("no end mark (Kp = -999): rows go on to the end of the record")
    if kinds.doubled:
        said.append(f"{len(kinds.doubled)} intervals were held while the spring moved, left out")
    if kinds.undoubled:
        said.append(f"the spring changes {len(kinds.undoubled)} times without an interval for it")
    return said


def _at(time: Floats, moments: Floats) -> Labels:
    """Index of the first sample at or after each moment, half a sample of grace."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    return np.searchsorted(time, moments - 0.5 * step).astype(np.int64)
