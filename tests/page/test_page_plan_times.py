"""The times of the plan on the page: what is left of a plan, and of one whose rows are chosen."""

from __future__ import annotations

from typing import Any

import pytest

from rig.page.watch import Watch
from rig.realtime.sequence import CHOICE, DONE, LEAD_IN, MEASURE, NO_ROW, SETTLE


def times(rows: list[int], phases: list[int], now: tuple[int, int, int]) -> dict[str, Any]:
    """Return the times 0.5 s after the begin of a segment; all segments have 2 s."""
    watch: Any = Watch.__new__(Watch)
    watch.dt, watch._entered, watch._segment = 0.001, 1.0, now
    watch._segments = {"row": rows, "phase": phases, "ticks": [2000] * len(rows)}
    watch._number = lambda field: 1.5
    return dict(watch._segment_times())


def test_the_time_left_is_that_of_the_segments_after_the_present_one() -> None:
    rows, phases = [NO_ROW, 0, 0, NO_ROW], [LEAD_IN, SETTLE, MEASURE, DONE]
    found = times(rows, phases, (0, SETTLE, 0))
    assert found == pytest.approx({"elapsed": 0.5, "length": 2.0, "left": 1.5 + 4.0})


def test_nobody_knows_how_many_rows_will_be_chosen() -> None:
    rows = [NO_ROW, NO_ROW, 0, 0, NO_ROW, 1, 1, NO_ROW, NO_ROW]
    phases = [LEAD_IN, CHOICE, SETTLE, MEASURE, CHOICE, SETTLE, MEASURE, CHOICE, DONE]
    found = times(rows, phases, (1, MEASURE, 0))
    assert found == {"elapsed": 0.5, "length": 2.0, "left": None}
