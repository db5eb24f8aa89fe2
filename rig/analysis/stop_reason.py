"""Where in its plan a run began to stop, and what the host had done to it before."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.analysis import phrases
from rig.realtime.safety import Reason
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import reader

Counts = NDArray[np.int64]

WINDOW = 2.0
"""Seconds before a trip in which lost ticks are counted: devices answer a gap within one."""
LONG_GAP = 0.020
"""Gap (s) that can be the cause of a trip by itself: the shortest age limit that is shipped."""
MANY = 0.02
"""Share of lost periods in the window from which short gaps together can be the cause."""
_NO_TRIP = (Reason.NONE, Reason.PLAN_END, Reason.OPERATOR_STOP, Reason.OPERATOR_ABORT)


class LostTicks(NamedTuple):
    """Periods without a tick in the seconds before a trip, enough to be its cause."""

    lost: int
    longest_gap_s: float
    share: float  # of the periods of the window
    window_s: float


class Stop(NamedTuple):
    """The first tick with a stop reason."""

    where: str  # time, row and phase in words; empty where the plan was walked to its end
    lost: LostTicks | None


NO_STOP = Stop("", None)


class Ending(NamedTuple):
    """How a run ended, for people."""

    title: str
    reason: str

    @property
    def description(self) -> str:
        """Both, without a full stop."""
        return f"{self.title}: {self.reason}"


ENDINGS = {
    "complete": "Complete",
    "stopped": "Stopped early",
    "fault": "Stopped by a fault",
    "crashed": "Crashed",
    "refused": "Refused",
}
NO_END = Ending(
    "No end recorded",
    "the record just stops: power cut, killed processes, or a run that still goes on; once it is "
    "over, `rig recover` finishes the record",
)


def ending_of(status: Mapping[str, Any], lost: LostTicks | None) -> Ending:
    """How a run ended, by its ``status`` and by the ticks ``lost`` before a trip."""
    said = str(status.get("status", "running"))
    if said == "running":
        return NO_END
    reason = reason_text(str(status.get("reason") or ""), lost)
    if moved := str(status.get("moved") or ""):  # it says why the log was lost, and where it is
        reason = f"{reason}; {moved}"
    return Ending(ENDINGS.get(said, NO_END.title), reason)


def lost_before(ticks: Counts, skipped: Counts, dt: float) -> LostTicks | None:
    """Lost ticks that may have caused the trip in the last of these rows; None if none did.

    ``ticks``: numbers of the rows up to the trip; ``skipped``: periods lost since the run began, as
    each row has it (``timing.skipped``; rows that only the log lost do not count); ``dt``: period,
    s.
    """
    if len(ticks) < 2:
        return None
    first = max(0, int(np.searchsorted(ticks, ticks[-1] - round(WINDOW / dt))) - 1)
    gaps = np.diff(skipped[first:])
    periods = int(ticks[-1] - ticks[first])
    lost, longest = int(gaps.sum()), dt * int(gaps.max())
    share = lost / periods
    if longest < LONG_GAP - 0.5 * dt and share <= MANY:
        return None
    return LostTicks(lost, longest, share, min(WINDOW, dt * periods))


def reason_text(reason: str, lost: LostTicks | None) -> str:
    """A stop reason, given by name, in plain words; lost ticks that may be its cause come first."""
    plain = phrases.reason_text(reason)
    if lost is None:
        return plain
    said = (
        f"the host lost {lost.lost} ticks (longest gap {1e3 * lost.longest_gap_s:.0f} ms) in the "
        f"{lost.window_s:.2g} s before the rig tripped"
    )
    if reason == Reason.LOST_TICKS.name:
        return f"{said}: {plain}; see `rig doctor`"
    return f"{said}: {reason} ({plain}) may only be what followed; see `rig doctor`"


def stop_of(run: Path, status: Mapping[str, Any]) -> Stop:
    """Where a run stopped, and the ticks its host had lost before if they may be the cause.

    A run that is complete by its ``status`` is not read for it.
    """
    if status.get("status") == "complete":
        return NO_STOP
    ticks, skipped = np.empty(0, np.int64), np.empty(0, np.int64)
    for block in reader.blocks(reader.source(run)):
        stopping = np.flatnonzero(block["safety.reason"] != Reason.NONE)
        end = int(stopping[0]) + 1 if stopping.size else len(block)
        dt = float(block["time"][-1]) / max(1, int(block["tick"][-1]))
        keep = round(WINDOW / dt) + 2 if dt > 0.0 else 0
        ticks = np.concatenate((ticks, block["tick"][:end]))[-keep:]
        skipped = np.concatenate((skipped, block["timing.skipped"][:end]))[-keep:]
        if not stopping.size:
            continue
        tick = block[stopping[0]]
        tripped = tick["safety.reason"] not in _NO_TRIP
        return Stop(_where(tick), lost_before(ticks, skipped, dt) if tripped else None)
    return NO_STOP


def _where(tick: np.void) -> str:
    if tick["safety.reason"] == Reason.PLAN_END:
        return ""
    phase = Phase(int(tick["plan.phase"])).name.lower().replace("_", "-")
    row = "before the first row" if tick["plan.row"] == NO_ROW else f"row {tick['plan.row']}"
    return f"stopped {tick['time']:.3f} s after its start, {row} ({phase})"
