"""The measured windows of a run, found by row id and phase as the rig logged them.

A window that lacks ticks which the loop executed is not whole: their rows were lost from the
record, and a mean over the others would be one over another time. Periods that the loop itself
skipped are no such ticks; it counts them. What is lost right beside a window was its own as far
as the window is shorter than its plan says.

One window is held at a time, so a run of many hours needs no more memory than its longest row.
"""

import os
from collections.abc import Container, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rig.realtime.safety import Mode, Reason
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import reader
from rig.recording.runs.account import SKIPPED
from rig.recording.runs.folder import facts
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.state import Reading, RecordState

PLACE = ("plan.row", "plan.phase", "plan.attempt")
ALWAYS = (*PLACE, "tick", "safety.mode", "safety.reason")
GONE = "all of its ticks are missing from the record"


class Window(NamedTuple):
    """The MEASURE ticks of one attempt at a row."""

    row: int
    attempt: int
    data: Records
    incomplete_reason: str  # why the window is not whole; empty if it is
    lost: int = 0  # executed ticks between its first and its last that the record lacks
    edge: int = 0  # such ticks right before or behind it, of which some may have been its own

    @property
    def span(self) -> int:
        """Ticks from its first to its last, lost ones included."""
        return int(self.data["tick"][-1] - self.data["tick"][0]) + 1

    @property
    def missing(self) -> int:
        """Executed ticks of it that the record lacks."""
        return self.lost + self.edge

    @property
    def expected(self) -> int:
        """Ticks of it that the loop executed."""
        return len(self.data) + self.missing

    @property
    def missing_words(self) -> str:
        """What the record lacks of it, in words; empty if it lacks nothing."""
        missing = f"{self.missing} of {self.expected} ticks missing from the record"
        return missing if self.missing else ""


class _Open:
    """A window whose end has not been seen yet."""

    def __init__(self, row: int, attempt: int, edge: int) -> None:
        self.row = row
        self.attempt = attempt
        self.edge = edge
        self.pieces: list[Records] = []

    def closed(self, why: str, edge: int = 0) -> Window:
        data: Records = np.concatenate(self.pieces)
        if (data["safety.mode"] != Mode.RUN).any():
            why = "held or stopped"
        return Window(self.row, self.attempt, data, why, _lost(data), self.edge + edge)


def lost_after(data: Any) -> Any:
    """Executed ticks that the record lacks between each row but the last and the row after it.

    None where the loop did not count the periods that it skipped.
    """
    if SKIPPED not in (data.dtype.names or ()):
        return np.zeros(max(0, len(data) - 1), np.int64)
    absent = np.diff(data["tick"]) - 1
    return np.where(absent > 0, np.maximum(absent - np.diff(data[SKIPPED]), 0), 0)


def _lost(data: Any) -> int:
    return int(lost_after(data).sum())


def _packed(block: Records, dtype: np.dtype[Any]) -> Records:
    out = np.empty(len(block), dtype)
    for name in dtype.names or ():
        out[name] = block[name]
    return out


def _pair(before: Any, after: Any) -> Any:
    """Two neighbouring rows' ticks and counts of skipped periods."""
    values = [(int(row["tick"]), int(row[SKIPPED])) for row in (before, after)]
    return np.array(values, [("tick", "<i8"), (SKIPPED, "<i8")])


def _stretches(block: Records) -> Iterator[tuple[int, int]]:
    """Index ranges over which row, phase and attempt stay the same."""
    changed = np.zeros(len(block) - 1, bool)
    for name in PLACE:
        values = block[name]
        changed |= values[1:] != values[:-1]
    edges = [0, *(np.flatnonzero(changed) + 1).tolist(), len(block)]
    yield from pairwise(edges)


def _left_early(row: int, after: Any) -> str:
    """Why a window followed by this tick is not whole, or an empty text."""
    if after["plan.phase"] == Phase.DONE and after["safety.reason"] not in (
        Reason.NONE,
        Reason.PLAN_END,
    ):
        return f"run stopped: {Reason(int(after['safety.reason'])).name}"
    if after["plan.row"] == row and after["plan.phase"] < Phase.MEASURE:
        return "started over"
    return ""


def windows(
    run: reader.Source,
    fields: list[str],
    plan: Mapping[str, Any],
    *,
    incomplete_rows: bool = False,
    reading: Reading | None = None,
) -> Iterator[Window]:
    """Every attempt at measuring a row, in the order of the run, with the named fields.

    Tick, place in the plan and state of the safety machine are always among the fields. ``plan``:
    the run's, which says how long its rows are. A window that lacks rows is said to be cut short
    unless ``incomplete_rows``; ``reading`` counts the ticks. KeyError if the run has no such
    fields.
    """
    lengths = {int(row["row"]): planned_ticks(row, plan.get("dt")) for row in plan.get("rows", [])}
    counted = [leaf.name for leaf in run.leaves if leaf.name == SKIPPED]
    names = reader.choose(run.leaves, [*ALWAYS, *counted, *fields])
    kinds = {leaf.name: "<f8" if leaf.code == "d" else "<i8" for leaf in run.leaves}
    dtype = np.dtype([(name, kinds[name]) for name in names])
    for each in cut(reader.blocks(run, reading), dtype):
        length = lengths.get(each.row, 0)
        edge = min(each.edge, max(0, length - each.span)) if length else each.edge
        window = each._replace(edge=edge)
        whole = window.incomplete_reason or incomplete_rows
        yield window if whole else window._replace(incomplete_reason=window.missing_words)


def planned_ticks(planned: Mapping[str, Any], dt: float | None) -> int:
    """Ticks that a planned row is measured for; 0 if the plan does not say. ``dt``: period, s."""
    seconds = planned.get("measure_s")
    return round(seconds / dt) if isinstance(seconds, int | float) and dt else 0


def gone(plan: Mapping[str, Any], found: Container[int], record: RecordState) -> set[int]:
    """Planned rows of which the record lacks all ticks: it has none, but it has rows after them."""
    planned = [int(row["row"]) for row in plan.get("rows", [])]
    passed = [i for i, row in enumerate(planned) if row in found] if record.lost else []
    return {row for row in planned[: max(passed, default=0)] if row not in found}


class LeftOut:
    """The rows of a run of which no window is whole, and why."""

    def __init__(self) -> None:
        self._why: dict[int, str] = {}

    def whole(self, window: Window) -> bool:
        """Whether a window can be used; remembers why if not."""
        if self._why.get(window.row, "not yet") != "":
            self._why[window.row] = window.incomplete_reason
        return not window.incomplete_reason

    def notes(self, plan: Mapping[str, Any], record: RecordState) -> tuple[str, ...]:
        """A sentence for each such row, also for those of which the record lacks all ticks."""
        why = {**self._why, **dict.fromkeys(gone(plan, self._why, record), GONE)}
        return tuple(f"row {row} is left out: {why[row]}" for row in sorted(why) if why[row])


class Incomplete(NamedTuple):
    """The measured windows of a run of which the record lacks ticks."""

    spans: tuple[tuple[float, float], ...]  # s from run start, first and last tick that is there
    notes: tuple[str, ...]  # a sentence for each, and for rows of which nothing is there

    def marks(self, time: Any) -> Any:
        """1 for each time (s) that is in such a window, else 0."""
        inside = np.zeros(len(time), np.int64)
        for first, last in self.spans:
            inside[(time >= first) & (time <= last)] = 1
        return inside


def incomplete(run: str | os.PathLike[str]) -> Incomplete:
    """What a record lacks of its windows; nothing for a kind of run that has none."""
    source = reader.source(run)
    if not {*ALWAYS, "time"} <= {leaf.name for leaf in source.leaves}:
        return Incomplete((), ())
    plan = facts(run, source.contents).plan
    seen = Reading(source.contents, source.damage)
    spans, notes, found = [], [], set()
    for window in windows(source, ["time"], plan, reading=seen):
        found.add(window.row)
        if window.missing:
            time = window.data["time"]
            spans.append((float(time[0]), float(time[-1])))
            named = "the measured window" if window.row == NO_ROW else f"row {window.row}"
            notes.append(f"{named}: {window.missing_words}")
    notes += [f"row {row}: {GONE}" for row in sorted(gone(plan, found, seen.state(run)))]
    return Incomplete(tuple(spans), tuple(notes))


def cut(blocks: Iterable[Records], dtype: np.dtype[Any]) -> Iterator[Window]:
    """The windows in blocks of ticks, with the fields of ``dtype``, `ALWAYS` among them."""
    now: _Open | None = None
    before: Any = None  # the row before, as an array of one
    for block in blocks:
        counts = SKIPPED in (block.dtype.names or ()) and "tick" in (block.dtype.names or ())
        for begin, end in _stretches(block):
            first = block[begin]
            row, attempt = int(first["plan.row"]), int(first["plan.attempt"])
            measuring = first["plan.phase"] == Phase.MEASURE
            edge = _lost(_pair(before, first)) if counts and before is not None else 0
            if now and not (measuring and (row, attempt) == (now.row, now.attempt)):
                yield now.closed(_left_early(now.row, first), edge)
                now = None
            if measuring:
                now = now or _Open(row, attempt, edge)
                now.pieces.append(_packed(block[begin:end], dtype))
            before = block[end - 1]
    if now:
        yield now.closed("the log ends here")
