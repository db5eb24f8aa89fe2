"""Measurement windows of a run, found by the row id and phase that the rig logged.

A window is incomplete if the record lacks ticks that the loop executed: a mean over the remaining
ticks would cover a different time span. Periods that the loop itself skipped do not make a window
incomplete; the loop counts them. Ticks lost directly before or after a window belong to the window
as far as the window is shorter than its plan.

The reader keeps one window in memory at a time, so a run of many hours needs no more memory than
its longest row; only `complete_windows` returns all at once.
"""

import os
from collections.abc import Container, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rig.realtime.reasons import Reason, ReasonTable
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import reader
from rig.recording.runs.folder import recorded_reasons, run_info
from rig.recording.runs.mcap_file import Records, join_records
from rig.recording.runs.state import SKIPPED, RecordCheck, RecordState

PLAN_FIELDS = ("plan.row", "plan.phase", "plan.attempt")
REQUIRED_FIELDS = (*PLAN_FIELDS, "tick", "safety.mode", "safety.reason")
ALL_TICKS_MISSING = "all of its ticks are missing from the record"
SKIPPED_ROW = "skipped"
LEAST_MEASURE = "least_measure_s"  # key of a planned row that its power may end
ADAPTIVE = "adaptive"  # key of a plan whose rows are candidates, of which some are chosen
RUN_RESUMED = "the run was interrupted here, and resumed"
LOG_ENDS = "the log ends here"
_ORDER = "plan.request.jump"  # number of the last order to go on with another segment
_FIRST_PHASES = (Phase.TARE, Phase.LEAD_IN, Phase.STANDBY)  # of a plan: none follows a window
_INTERRUPTIONS = (
    *(Reason.OPERATOR_STOP, Reason.OPERATOR_ABORT, Reason.SUPERVISOR_LOST, Reason.LOGGER_LOST),
)
"""Reasons of a stop that cast no doubt on what the rig has measured."""


class Window(NamedTuple):
    """The MEASURE ticks of one attempt at a row."""

    row: int
    attempt: int
    data: Records
    incomplete_reason: str  # empty for a complete window
    lost: int = 0  # executed ticks between the first and the last that the record lacks
    lost_at_edges: int = 0  # executed ticks lost directly before or after; some may belong to it
    end_stop: float = 0.0  # share of its ticks at an end stop, which only a simulation knows

    @property
    def span(self) -> int:
        """Ticks from the first to the last, including lost ones."""
        return int(self.data["tick"][-1] - self.data["tick"][0]) + 1

    @property
    def missing(self) -> int:
        """Executed ticks of the window that the record lacks."""
        return self.lost + self.lost_at_edges

    @property
    def expected(self) -> int:
        """Ticks of the window that the loop executed."""
        return len(self.data) + self.missing

    @property
    def missing_text(self) -> str:
        """Count of the missing ticks as text; empty if none is missing."""
        missing = f"{self.missing} of {self.expected} ticks missing from the record"
        return missing if self.missing else ""


_STOPPED = "run stopped: "
_KEPT_AFTER = (RUN_RESUMED, LOG_ENDS, *(f"{_STOPPED}{reason.name}" for reason in _INTERRUPTIONS))


class JoinedRows:
    """Joins the windows of rows that were cut short when a run ended, and measured to their end
    since it was resumed.

    Of a window that was cut short, its whole periods count. The windows of a row follow each other
    in a joined one as if there had been no interruption: its ticks have no gap. The waves of two
    stages are not in phase, so only means over whole periods are valid.
    """

    def __init__(self, period_ticks: float | None) -> None:
        self._period_ticks = period_ticks  # None: the sea does not repeat, and nothing is joined
        self._cut: dict[int, Window] = {}  # by row

    def add(self, window: Window, planned: int) -> Window:
        """Return the window with all that earlier stages measured of its row.

        ``planned``: length of the row's measurement in ticks. A window that is too short for its
        row gets an ``incomplete_reason``.
        """
        whole = window
        if window.row in self._cut and _is_short(window, planned):
            whole = _append(self._cut[window.row], window)
        if not whole.incomplete_reason and _is_short(whole, planned):
            whole = whole._replace(incomplete_reason="shorter than planned")
        if whole.incomplete_reason in _KEPT_AFTER and not whole.missing and self._period_ticks:
            periods = int((len(whole.data) + 0.5) / self._period_ticks)
            if periods:
                kept = whole.data[: round(periods * self._period_ticks)]
                self._cut[window.row] = whole._replace(data=kept)
        return whole


def _is_short(window: Window, planned: int) -> bool:
    return window.span + window.lost_at_edges < 0.99 * planned - 1.0


def _append(before: Window, window: Window) -> Window:
    data = before.data.copy()
    data["tick"] = window.data["tick"][0] - len(data) + np.arange(len(data))
    return window._replace(data=join_records([data, window.data]))


def keeps_periods(incomplete_reason: str) -> bool:
    """Return whether the whole periods of a row that was cut short for this reason are valid."""
    return incomplete_reason in _KEPT_AFTER


class _OpenWindow:
    """A window that is still being read."""

    def __init__(self, row: int, attempt: int, lost_before: int) -> None:
        self.row = row
        self.attempt = attempt
        self.lost_before = lost_before
        self.pieces: list[Records] = []

    def close(self, reason: str, lost_after: int = 0) -> Window:
        data = join_records(self.pieces)
        if (data["safety.mode"] != Mode.RUN).any():
            reason = "held or stopped"
        lost_at_edges = self.lost_before + lost_after
        lost = int(lost_between_rows(data).sum())
        return Window(self.row, self.attempt, data, reason, lost, lost_at_edges)


def lost_between_rows(data: Any) -> Any:
    """Return the number of executed ticks that the record lacks after each log row but the last.

    Zero where the loop did not count the periods that it skipped.
    """
    if SKIPPED not in (data.dtype.names or ()):
        return np.zeros(max(0, len(data) - 1), np.int64)
    missing = np.diff(data["tick"]) - 1
    return np.where(missing > 0, np.maximum(missing - np.diff(data[SKIPPED]), 0), 0)


def _select_fields(block: Records, dtype: np.dtype[Any]) -> Records:
    if block.dtype == dtype:
        return block
    selected = np.empty(len(block), dtype)
    for name in dtype.names or ():
        selected[name] = block[name]
    return selected


def _constant_ranges(block: Records) -> Iterator[tuple[int, int]]:
    """Yield the index ranges over which row, phase and attempt stay constant."""
    changed = np.zeros(len(block) - 1, bool)
    for name in PLAN_FIELDS:
        values = block[name]
        changed |= values[1:] != values[:-1]
    edges = [0, *(np.flatnonzero(changed) + 1).tolist(), len(block)]
    yield from pairwise(edges)


def _reason_incomplete(row: int, last: Any, next_tick: Any, reasons: ReasonTable) -> str:
    """Return why a window with this last tick is incomplete; empty if it is complete.

    ``next_tick``: the one that follows.
    """
    if next_tick["plan.phase"] == Phase.DONE and next_tick["safety.reason"] not in (
        Reason.NONE,
        Reason.PLAN_END,
    ):
        return f"{_STOPPED}{reasons.name(next_tick['safety.reason'])}"
    if next_tick["plan.phase"] in _FIRST_PHASES:
        return RUN_RESUMED
    if next_tick["plan.row"] == row and next_tick["plan.phase"] < Phase.MEASURE:
        return "started over"
    if _ORDER in (last.dtype.names or ()) and next_tick[_ORDER] != last[_ORDER]:
        return "started over" if next_tick["plan.row"] == row else SKIPPED_ROW
    return ""


def read_windows(
    run: reader.RunFiles,
    fields: list[str],
    plan: Mapping[str, Any],
    *,
    incomplete_rows: bool = False,
    reading: RecordCheck | None = None,
) -> Iterator[Window]:
    """Yield the window of every attempt at a row, in the order of the run, with the named fields.

    `REQUIRED_FIELDS` are always included. ``plan`` is the plan of the run and gives the length of
    its rows. A window with missing ticks gets an ``incomplete_reason`` unless ``incomplete_rows``
    is true. ``reading`` counts the ticks that are read. Raises KeyError if the run lacks a field.
    """
    lengths = {int(row["row"]): planned_ticks(row, plan.get("dt")) for row in plan.get("rows", [])}
    optional = [leaf.name for leaf in run.leaves if leaf.name in (SKIPPED, _ORDER)]
    names = reader.select_fields(run.leaves, [*REQUIRED_FIELDS, *optional, *fields])
    dtypes = {leaf.name: "<f8" if leaf.code == "d" else "<i8" for leaf in run.leaves}
    dtype = np.dtype([(name, dtypes[name]) for name in names])
    blocks = reader.blocks(run, reading, names)
    for window in split_windows(blocks, dtype, recorded_reasons(plan)):
        length = lengths.get(window.row, 0)
        lost_at_edges = window.lost_at_edges
        if length:
            lost_at_edges = min(lost_at_edges, max(0, length - window.span))
        checked = window._replace(lost_at_edges=lost_at_edges)
        unchanged = checked.incomplete_reason or incomplete_rows
        yield checked if unchanged else checked._replace(incomplete_reason=checked.missing_text)


def planned_ticks(planned: Mapping[str, Any], dt: float | None, *, least: bool = False) -> int:
    """Return the length of a planned row's measurement in ticks; 0 if the plan gives none.

    It is the ``least`` or the longest one of a row that its power ends. ``dt`` is the control
    period in s.
    """
    seconds = planned.get("measure_s")
    if least:
        seconds = planned.get(LEAST_MEASURE, seconds)
    return round(seconds / dt) if isinstance(seconds, int | float) and dt else 0


def missing_rows(
    plan: Mapping[str, Any], seen: Container[int], record: RecordState
) -> dict[int, str]:
    """Return the reasons for planned rows without a measured tick although later rows have some.

    ``seen`` are the ids of the rows with measured ticks in the record. The candidates of an
    adaptive campaign have no order, so none of them is missing.
    """
    if ADAPTIVE in plan:
        return {}
    planned = [int(row["row"]) for row in plan.get("rows", [])]
    positions = [i for i, row in enumerate(planned) if row in seen]
    reason = ALL_TICKS_MISSING if record.lost else SKIPPED_ROW
    return {row: reason for row in planned[: max(positions, default=0)] if row not in seen}


def complete_windows(
    run: str | os.PathLike[str],
    source: reader.RunFiles,
    fields: Iterable[str],
    plan: Mapping[str, Any],
    *,
    incomplete_rows: bool,
) -> tuple[list[Window], tuple[str, ...]]:
    """Return the complete windows of a run, and a message for each row that has none.

    The arguments are those of `read_windows`.
    """
    reading, windows = RecordCheck(source.contents, source.damage), list[Window]()
    reasons: dict[int, str] = {}
    for window in read_windows(
        source, list(fields), plan, incomplete_rows=incomplete_rows, reading=reading
    ):
        if not window.incomplete_reason:
            windows.append(window)
        if reasons.get(window.row, "not yet") != "":
            reasons[window.row] = window.incomplete_reason
    reasons |= missing_rows(plan, reasons, reading.state(run))
    left_out = (f"row {row} is left out: {reasons[row]}" for row in sorted(reasons) if reasons[row])
    return windows, tuple(left_out)


class IncompleteWindows(NamedTuple):
    """Measurement windows for which the record of a run lacks ticks."""

    spans: tuple[tuple[float, float], ...]  # s from run start: first and last recorded tick
    messages: tuple[str, ...]  # one for each window, and for each row without recorded ticks

    def mask(self, time: Any) -> Any:
        """Return 1 for each time (s) inside an incomplete window, else 0."""
        flags = np.zeros(len(time), np.int64)
        for first, last in self.spans:
            flags[(time >= first) & (time <= last)] = 1
        return flags


def find_incomplete_windows(run: str | os.PathLike[str]) -> IncompleteWindows:
    """Return the incomplete windows of a run; none for a kind of run without windows."""
    source = reader.open_files(run)
    if not {*REQUIRED_FIELDS, "time"} <= {leaf.name for leaf in source.leaves}:
        return IncompleteWindows((), ())
    plan = run_info(run, source.contents).plan
    reading = RecordCheck(source.contents, source.damage)
    spans, messages, rows = [], [], set()
    for window in read_windows(source, ["time"], plan, reading=reading):
        rows.add(window.row)
        if window.missing:
            time = window.data["time"]
            spans.append((float(time[0]), float(time[-1])))
            name = "the measured window" if window.row == NO_ROW else f"row {window.row}"
            messages.append(f"{name}: {window.missing_text}")
    state = reading.state(run)
    lost = missing_rows(plan, rows, state) if state.lost else {}
    messages += [f"row {row}: {lost[row]}" for row in sorted(lost)]
    return IncompleteWindows(tuple(spans), tuple(messages))


def split_windows(
    blocks: Iterable[Records], dtype: np.dtype[Any], reasons: ReasonTable
) -> Iterator[Window]:
    """Yield the windows in blocks of ticks.

    ``dtype`` holds the fields of the windows; `REQUIRED_FIELDS` must be among them. ``reasons``
    are those of the run.
    """
    current: _OpenWindow | None = None
    previous: Any = None  # the previous log row, as an array of length 1
    for block in blocks:
        has_counts = SKIPPED in (block.dtype.names or ()) and "tick" in (block.dtype.names or ())
        for begin, end in _constant_ranges(block):
            first = block[begin]
            row, attempt = int(first["plan.row"]), int(first["plan.attempt"])
            measuring = first["plan.phase"] == Phase.MEASURE
            lost = 0
            if has_counts and previous is not None:
                gap = int(first["tick"] - previous["tick"]) - 1
                lost = max(gap - int(first[SKIPPED] - previous[SKIPPED]), 0) if gap > 0 else 0
            if current and not (measuring and (row, attempt) == (current.row, current.attempt)):
                reason = _reason_incomplete(current.row, previous, first, reasons)
                yield current.close(reason, lost)
                current = None
            if measuring:
                current = current or _OpenWindow(row, attempt, lost)
                current.pieces.append(_select_fields(block[begin:end], dtype))
            previous = block[end - 1]
    if current:
        yield current.close(LOG_ENDS)
