"""The place in its plan where a run began to stop, and the ticks that the host lost before."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.presentation import phrases
from rig.realtime.reasons import STOPS_OF_PEOPLE, Reason, ReasonTable
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import reader
from rig.recording.runs.folder import is_earlier

Counts = NDArray[np.int64]

WINDOW_S = 2.0
"""Time (s) before a trip in which lost ticks count; devices respond to a gap within 1 s."""
LONG_GAP_S = 0.020
"""Gap (s) that can cause a trip by itself: the shortest age limit in the shipped files."""
HIGH_SHARE = 0.02
"""Share of lost periods in the window above which short gaps together can cause a trip."""
_STOP_FIELDS = ("time", "plan.row", "plan.phase", "safety.reason")
_NO_TRIP = (Reason.NONE, Reason.PLAN_END, *STOPS_OF_PEOPLE)


class LostTicks(NamedTuple):
    """Lost ticks before a trip, enough to be its cause."""

    lost: int
    longest_gap_s: float
    share: float  # of the periods of the window
    window_s: float


class Stop(NamedTuple):
    """The place in the plan where a run stopped."""

    location: str  # time, row and phase as text; empty if the plan ran to its end
    lost: LostTicks | None
    trip_time: float | None = None  # s from the start of the run; None: people or the plan stopped


NO_STOP = Stop("", None)


class Ending(NamedTuple):
    """The end of a run: title and reason as text, and for a fault its first message and advice."""

    title: str
    reason: str
    message: str = ""  # the first one that the run recorded; empty without one
    advice: str = ""  # what people should do; empty without advice

    @property
    def description(self) -> str:
        """Title and reason, without a full stop."""
        return f"{self.title}: {self.reason}"

    @property
    def hints(self) -> tuple[str, ...]:
        """First message and advice, each as a line of text."""
        pairs = (("First message", self.message), ("To do", self.advice))
        return tuple(f"{title}: {text}" for title, text in pairs if text)


ENDINGS = {
    "complete": "Complete",
    "stopped": "Stopped early",
    "fault": "Stopped by a fault",
    "crashed": "Crashed",
    "refused": "Refused",
}
NO_END = Ending(
    "No end recorded",
    "the record just stops: power cut, killed processes, or a run in progress; once the run is "
    "over, `rig recover` completes the record",
)


def describe_ending(
    status: Mapping[str, Any], lost: LostTicks | None, reasons: ReasonTable
) -> Ending:
    """Return how a run ended, from its ``status`` and the ticks ``lost`` before a trip.

    ``reasons`` are those of the run; they have the advice, which lost ticks replace.
    """
    state = str(status.get("status", "running"))
    if state == "running":
        return NO_END
    name = str(status.get("reason") or "")
    text = str(status.get("reason_text") or phrases.reason_text(name))
    reason = describe_reason(name if state == "fault" else "", text, lost)
    if moved := str(status.get("moved") or ""):  # why the log moved, and where it is
        reason = f"{reason}; {moved}"
    title = ENDINGS.get(state, NO_END.title)
    if state not in ("fault", "crashed"):
        return Ending(title, reason)
    messages = [*(status.get("messages") or ()), str(status.get("died") or "")]
    number = reasons.number(name)
    advice = "" if lost is not None or number is None else reasons.advice(number)
    return Ending(title, reason, next(filter(None, messages), ""), advice)


def lost_before_trip(ticks: Counts, skipped: Counts, dt: float) -> LostTicks | None:
    """Return the lost ticks that may have caused a trip; None if they cannot be its cause.

    ``ticks`` are the tick numbers of the log rows, of which the last one tripped. ``skipped`` are
    the periods lost since the start of the run at each row (``timing.skipped``); rows missing only
    from the log do not count. ``dt`` is the control period in s.
    """
    if len(ticks) < 2:
        return None
    first = max(0, int(np.searchsorted(ticks, ticks[-1] - round(WINDOW_S / dt))) - 1)
    gaps = np.diff(skipped[first:])
    periods = int(ticks[-1] - ticks[first])
    lost, longest = int(gaps.sum()), dt * int(gaps.max())
    share = lost / periods
    if longest < LONG_GAP_S - 0.5 * dt and share <= HIGH_SHARE:
        return None
    return LostTicks(lost, longest, share, min(WINDOW_S, dt * periods))


def describe_reason(reason: str, plain: str, lost: LostTicks | None) -> str:
    """Return the text ``plain`` of a stop reason with its name, after the lost ticks before it.

    Without the name ``reason``, as of a stop by people, the text stands alone.
    """
    if lost is None:
        return f"{plain} ({reason})" if reason and reason != plain else plain
    lost_text = (
        f"the host lost {lost.lost} ticks (longest gap {1e3 * lost.longest_gap_s:.0f} ms) in the "
        f"{lost.window_s:.2g} s before the rig tripped"
    )
    if reason == Reason.LOST_TICKS.name:
        return f"{lost_text}: {plain} ({reason}); see `rig doctor`"
    return f"{lost_text}: {reason} ({plain}) may be a consequence; see `rig doctor`"


def find_stop(run: Path, status: Mapping[str, Any]) -> Stop:
    """Return where a run stopped, and the ticks lost before that may be the cause.

    Of a run that was resumed, it is the stop of its last stage; there is none if that stage has
    no record, because it was refused. The function does not read the record of a run whose
    ``status`` is complete.
    """
    if status.get("status") == "complete":
        return NO_STOP
    files = reader.open_files(run)
    last = files.stages[-1]
    if Path(run).is_dir() and is_earlier(last.contents[0].path):
        return NO_STOP
    ticks, skipped = np.empty(0, np.int64), np.empty(0, np.int64)
    for block in reader.blocks(files._replace(stages=(last,)), fields=_STOP_FIELDS):
        stop_ticks = np.flatnonzero(block["safety.reason"] != Reason.NONE)
        end = int(stop_ticks[0]) + 1 if stop_ticks.size else len(block)
        dt = float(block["time"][-1]) / max(1, int(block["tick"][-1]))
        keep = round(WINDOW_S / dt) + 2 if dt > 0.0 else 0
        ticks = np.concatenate((ticks, block["tick"][:end]))[-keep:]
        skipped = np.concatenate((skipped, block["timing.skipped"][:end]))[-keep:]
        if not stop_ticks.size:
            continue
        tick = block[stop_ticks[0]]
        tripped = tick["safety.reason"] not in _NO_TRIP
        if not tripped:
            return Stop(_location_text(tick), None)
        lost = lost_before_trip(ticks, skipped, dt)
        return Stop(_location_text(tick), lost, float(tick["time"]))
    return NO_STOP


def _location_text(tick: np.void) -> str:
    if tick["safety.reason"] == Reason.PLAN_END:
        return ""
    phase = Phase(int(tick["plan.phase"])).name.lower().replace("_", "-")
    row = "before the first row" if tick["plan.row"] == NO_ROW else f"row {tick['plan.row']}"
    return f"stopped {tick['time']:.3f} s after its start, {row} ({phase})"
