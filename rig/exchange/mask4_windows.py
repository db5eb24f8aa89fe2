"""Rows of a recorded MASK4 run, as its own scripts find them: by time alone, then checked.

The first row begins 120 s after runCounter's first 1, rows follow each other in equal intervals
until the gain that means the end (MASK4 report (Sandia), 3.2.3). Where the spring changes a row
stands twice, the first time while the stator moves. A file of ours says row and phase itself.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.columns import END_MARK
from rig.exchange.mask4_fields import OWN
from rig.legacy.mask4_rows import structure
from rig.sequence import NO_ROW, Phase

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
    ones = np.flatnonzero(counter == 1.0)
    if ones.size == 0:
        raise ValueError("expCtrl.runCounter is never 1: the run was not begun")
    start = time[ones[0]] + timing.lead
    ended = np.flatnonzero(settings[:, 0] == END_MARK)
    end = float(time[ended[0]]) if ended.size else float(time[-1])
    count = int((end - start) / timing.interval + 1e-6)
    if count < 1:
        raise ValueError(
            f"no row of {timing.interval:g} s between {start:.1f} s, where rows begin, and "
            f"{end:.1f} s, where the gains end"
        )
    edges = _at(time, start + timing.interval * np.arange(count + 1))
    begins = _at(time, start + timing.interval * np.arange(count) + timing.settle)
    ends = _at(time, start + timing.interval * np.arange(count) + timing.settle + timing.measure)
    held = [tuple(settings[i].tolist()) for i in begins]
    kinds = structure(held, columns.index("kp"), columns.index("spring_rate"), 0)
    row, phase, attempt = (np.full(len(time), label, np.int64) for label in (NO_ROW, 0, 0))
    phase[:] = Phase.DONE
    phase[: edges[0]] = Phase.LEAD_IN
    remarks = [] if ended.size else ["no end mark (Kp = -999): rows go on to the end of the record"]
    number = 0
    for k in range(count):
        inside = slice(edges[k], edges[k + 1])
        row[inside] = number
        if k in kinds.doubled:
            phase[inside] = Phase.MOVING
            continue
        phase[inside] = Phase.TAIL
        phase[edges[k] : begins[k]] = Phase.SETTLE
        window = settings[begins[k] : ends[k]]
        still = np.flatnonzero((window != window[0]).any(axis=1))
        last = begins[k] + int(still[0]) if still.size else ends[k]
        phase[begins[k] : last] = Phase.MEASURE
        if still.size:
            remarks.append(f"row {number}: a setting changes {still[0]} samples into its window")
        number += 1
    if kinds.doubled:
        remarks.append(f"{len(kinds.doubled)} intervals were held while the spring moved, left out")
    if kinds.undoubled:
        remarks.append(
            f"the spring changes {len(kinds.undoubled)} times without an interval for it"
        )
    return Windows(row, phase, attempt, tuple(remarks))


def _at(time: Floats, moments: Floats) -> Labels:
    """Index of the first sample at or after each moment, half a sample of grace."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    return np.searchsorted(time, moments - 0.5 * step).astype(np.int64)
