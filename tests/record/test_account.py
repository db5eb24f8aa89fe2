"""The account of a record against a run whose every period is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import record_files as files
from hypothesis import given
from hypothesis import strategies as st

from rig.recording.runs.state import EndReport, Gap, account_ticks

SAVED, LOST, SKIPPED = "saved", "lost", "skipped"
PERIODS = st.lists(
    st.tuples(st.sampled_from([SAVED, SAVED, SAVED, LOST, SKIPPED]), st.integers(1, 40)),
    max_size=12,
)


def simulate_periods(stretches: list[tuple[str, int]]) -> list[str]:
    """Return the fate of each period, tick by tick."""
    return [what for what, count in stretches for _ in range(count)]


def record(periods: list[str], cut: int) -> list[Any]:
    """Return the saved rows, in blocks of ``cut`` rows."""
    skipped = np.cumsum([what == SKIPPED for what in periods])
    ticks = [tick for tick, what in enumerate(periods) if what == SAVED]
    block = files.rows(len(ticks))
    block["tick"] = block["tick_end"] = ticks
    block["time"] = np.array(ticks) * 1e-3
    block["timing.skipped"] = skipped[ticks] if ticks else 0
    return [block[i : i + cut] for i in range(0, len(ticks), cut)]


@given(PERIODS, st.integers(1, 30), st.booleans())
def test_every_period_is_saved_lost_or_skipped(
    stretches: list[tuple[str, int]], cut: int, read_rows: bool
) -> None:
    periods = simulate_periods(stretches)
    while periods and periods[-1] == SKIPPED:  # a loop that has ended skips no periods
        periods.pop()
    counts = {what: periods.count(what) for what in (SAVED, LOST, SKIPPED)}
    executed, last = counts[SAVED] + counts[LOST], len(periods) - 1
    ending = EndReport(executed, last, counts[SKIPPED], "a test", read_rows) if periods else None
    found = account_ticks(record(periods, cut), ending)
    assert (found.rows, found.lost, found.skipped) == (*counts.values(),)
    assert found.lost_at_end == 0
    assert found.complete == (counts[LOST] == 0 and read_rows and bool(periods))
    absent = {tick for gap in found.gaps for tick in range(gap.first, gap.last + 1)}
    assert absent == {tick for tick, what in enumerate(periods) if what != SAVED}
    for gap in found.gaps:  # each gap is exact
        inside = periods[gap.first : gap.last + 1]
        assert (gap.lost, gap.skipped) == (inside.count(LOST), inside.count(SKIPPED))
    assert found.last_known == (last if periods else None)


def test_without_an_end_report_the_account_is_open() -> None:
    found = account_ticks(record([SAVED] * 10, 4), None)
    assert (found.lost, found.complete, found.last_known) == (0, False, 9)
    assert found.period is not None
    assert abs(found.period - 1e-3) < 1e-12


def test_rows_dropped_at_the_end_are_counted_though_their_ticks_are_unknown() -> None:
    found = account_ticks(record([SAVED] * 10, 4), EndReport(17, None, None, "the logger", True))
    assert (found.gaps, found.lost_at_end, found.lost) == ((), 7, 7)


def test_progress_reports_make_the_tail_exact() -> None:
    report = EndReport(13, 14, 2, "the supervisor", False)
    found = account_ticks(record([SAVED] * 10, 10), report)
    assert found.gaps == (Gap(10, 14, 2),)
    assert (found.lost, found.complete, found.last_known) == (3, False, 14)
    older = account_ticks(
        record([SAVED] * 10, 10), report._replace(ticks=6, last_tick=5, skipped=0)
    )
    assert (older.gaps, older.lost, older.last_known) == ((), 0, 9)


def test_an_empty_record() -> None:
    found = account_ticks([], EndReport(0, None, None, "the logger", True))
    assert (found.rows, found.first_tick, found.period, found.complete) == (0, None, None, True)
