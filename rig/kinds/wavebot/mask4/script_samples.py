"""Selection of a run's samples as the scripts of the MASK4 test count them.

The scripts (public fbWecCntrl repository, MASK4/MHKDRCode) find rows by counting samples at 200 Hz:

- makePowerSurfaces*: the first row begins 120 s after the first sample with runCounter 1, and rows
  follow in equal intervals until Kp is -999, the end mark;
- msSysIdentification*: the periods of realisation k begin 10 s after the first sample with
  runCounter k;
- magSpringMapping: all samples with runCounter k are of stator position k.

A run has other samples between its rows: moves of the stator, holds, attempts that were started
over. They are left out, so that the rows follow each other. Time stays that of the run.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.kinds.wavebot.mask4.fields import SAMPLE_RATE
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import RunError, reader
from rig.recording.runs.windows import Window, complete_windows
from rig.spectra.periods import Flags, Floats, Ticks

LEAD_S = 120.0
"""Time from runCounter's 1 to the first row, s."""
STEADY_S = 10.0
"""Time from a realisation's runCounter to its first period, s (`ssTime` of the scripts)."""
NO_SAMPLE = -1


class ScriptSamples(NamedTuple):
    """The samples of an export for the scripts, one entry each."""

    tick: Ticks  # increasing; evenly spaced before the rows, within each row, and after the rows
    log_index: Ticks  # of the log row with the sample's values; `NO_SAMPLE`: none, so they are NaN
    counter: Floats  # expCtrl.runCounter
    ended: Flags  # after the last row: Kp is the end mark
    in_rows: Flags
    left_out: Floats  # samples left out of the run before each, in total
    remarks: tuple[str, ...]

    @property
    def has_sample(self) -> Flags:
        """Whether the record has a sample."""
        return np.asarray(self.log_index != NO_SAMPLE, dtype=np.bool_)

    def take(self, values: Any) -> Floats:
        """Return the values of log rows by sample, NaN without one."""
        return np.where(
            self.has_sample, np.asarray(values, dtype=np.float64)[self.log_index], np.nan
        )


class _RowSpan(NamedTuple):
    """Ticks of a completely measured row."""

    row: int
    begin: int  # first tick of its settling
    measure: int  # first tick of its window
    measured: int  # first tick after its window
    end: int  # first tick after its tail


def newest_index(ticks: Ticks, samples: Ticks, max_age: int) -> Ticks:
    """Return the index of the newest of ``ticks`` at each sample's tick, as a sampled bus has it.

    `NO_SAMPLE` where it is ``max_age`` ticks old or older.
    """
    index = np.searchsorted(ticks, samples, side="right") - 1
    is_fresh = (index >= 0) & (samples - ticks[np.maximum(index, 0)] < max_age)
    return np.asarray(np.where(is_fresh, index, NO_SAMPLE), dtype=np.int64)


def select_samples(
    run: Path, source: reader.RunFiles, data: dict[str, Any], plan: dict[str, Any], step: int
) -> ScriptSamples:
    """Return the samples of a run, every ``step`` ticks.

    ``data`` has the columns `tick` and `plan.*` of all log rows. Raises RunError if no row was
    measured completely.
    """
    ticks = np.asarray(data["tick"], dtype=np.int64)
    spans, remarks = _complete_rows(run, source, data, plan)
    spans, unequal = _equal_rows(spans, step)
    count = min(span.end - span.begin for span in spans) // step  # samples of a row
    first, last = spans[0].begin, spans[-1].begin
    lead = max(round(LEAD_S * SAMPLE_RATE), -(-(first - int(ticks[0])) // step))
    begins = np.array([span.begin for span in spans], dtype=np.int64)
    ended_at = last + count * step
    parts = (
        first - step * np.arange(lead, 0, -1),
        np.add.outer(begins, step * np.arange(count)).ravel(),
        # Two samples at least: the scripts divide the samples up to the mark by those of a row,
        # and one that follows the rows keeps the quotient from falling below their number.
        np.arange(ended_at, max(int(ticks[-1]) + 1, ended_at + 2 * step), step),
    )
    tick = np.concatenate(parts)
    position = np.arange(len(tick))
    rows_end = lead + count * len(spans)
    in_rows = (position >= lead) & (position < rows_end)
    log_index = newest_index(ticks, tick, step)
    if absent := int((log_index[in_rows] == NO_SAMPLE).sum()):
        unequal.append(f"the record lacks {absent} of {in_rows.sum()} samples of rows: NaN")
    starts = lead + count * np.arange(len(spans))
    return ScriptSamples(
        tick,
        log_index,
        _run_counter(plan, spans, starts, position, step),
        position > rows_end,
        in_rows,
        np.cumsum(np.ceil(np.diff(tick, prepend=tick[0] - step) / step - 1.0)),
        (*remarks, *unequal, _constants(plan, spans, count)),
    )


def _complete_rows(
    run: Path, source: reader.RunFiles, data: dict[str, Any], plan: dict[str, Any]
) -> tuple[list[_RowSpan], list[str]]:
    """Return the last complete attempt of each row in order of time, and remarks on the others."""
    ticks, moving = data["tick"], data["plan.phase"] == Phase.MOVING
    labels = (data["plan.row"], data["plan.attempt"], moving)
    changed = np.any([values[1:] != values[:-1] for values in labels], axis=0)
    edges = np.array([ticks[0], *ticks[1:][changed], ticks[-1] + 1])
    windows, messages = complete_windows(run, source, ["time"], plan, incomplete_rows=False)
    spans = {each.row: _row_span(each, edges) for each in windows if each.row != NO_ROW}
    if not spans:
        reasons = "".join(f"; {message}" for message in messages)
        raise RunError(f"{run}: no completely measured row for the scripts of the test{reasons}")
    return sorted(spans.values(), key=lambda span: span.begin), [*messages]


def _row_span(window: Window, edges: Ticks) -> _RowSpan:
    measure, measured = int(window.data["tick"][0]), int(window.data["tick"][-1]) + 1
    i = int(np.searchsorted(edges, measure, side="right"))
    return _RowSpan(window.row, int(edges[i - 1]), measure, measured, int(edges[i]))


def _equal_rows(spans: list[_RowSpan], step: int) -> tuple[list[_RowSpan], list[str]]:
    """Return the rows of the usual length and settling, up to a sample, and remarks on others."""
    usual = sorted(span.end - span.begin for span in spans)[len(spans) // 2]
    settling = sorted(span.measure - span.begin for span in spans)[len(spans) // 2]
    equal = [
        span
        for span in spans
        if abs(span.end - span.begin - usual) < step
        and abs(span.measure - span.begin - settling) < step
    ]
    unequal = [
        f"row {span.row} is left out: it has {(span.end - span.begin) // step} samples, "
        f"{(span.measure - span.begin) // step} of them to settle, others {usual // step} and "
        f"{settling // step}"
        for span in spans
        if span not in equal
    ]
    return equal, unequal


def _run_counter(
    plan: dict[str, Any], spans: Sequence[_RowSpan], starts: Ticks, position: Ticks, step: int
) -> Floats:
    """Return runCounter by sample; ``starts`` are the positions of the rows' first samples."""
    windows: Ticks = starts + np.array([span.measure - span.begin for span in spans]) // step
    if plan.get("hoist"):
        lengths = np.array([(span.measured - span.measure) // step for span in spans])
        number = np.searchsorted(windows, position, side="right")
        inside = (number > 0) & (position < (windows + lengths)[number - 1])
        return np.asarray(np.where(inside, number, 0), dtype=np.float64)
    edges = starts[:1] - round(LEAD_S * SAMPLE_RATE)
    if plan.get("reference"):
        edges = windows - round(STEADY_S * SAMPLE_RATE)
    return np.asarray(np.searchsorted(edges, position, side="right"), dtype=np.float64)


def _constants(plan: dict[str, Any], spans: Sequence[_RowSpan], count: int) -> str:
    """Return the constants that the scripts need for this run, as they name them."""
    first, dt, sea = spans[0], float(plan.get("dt") or 1e-3), plan.get("sea") or {}
    measured = dt * (first.measured - first.measure)
    if plan.get("hoist"):
        return f"magSpringMapping.m: runCounter 1 .. {len(spans)} are the stator positions"
    if reference := plan.get("reference"):
        period = float(reference["period_s"])
        return (
            f"msSysIdentification1x1_heave.m: T_nom = {period:g}; N_per = "
            f"{round(measured / period)}; ssTime = {STEADY_S:g}; runCounter 1 .. {len(spans)} are "
            f"rows {', '.join(str(span.row) for span in spans)}"
        )
    interval = f"dT = {count / SAMPLE_RATE:g}"
    dead = f"deadSamps = {dt * (first.measure - first.begin):g}*200"
    if sea.get("kind") != "regular":
        return f"makePowerSurfaces.m: {interval}; {dead}"
    period = float(plan["repeat_s"])
    periods = round(measured / period)
    # Their windows have one sample more than whole periods.
    touches = first.end == first.measured and periods > 1
    whole = f"{periods - 1} (with {periods} a window has one sample of the next row)"
    return (
        f"makePowerSurfacesv3.m and those like it: T_rep = {period:.6g}; {interval}; {dead}; "
        f"NReps = {whole if touches else periods}"
    )
