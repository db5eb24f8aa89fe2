"""The 95 % intervals of the powers of rows while they are measured, by scatter and budget.

They are those of the row table (`rig.analysis.uncertainty`). The contributions of a budget's
sources are means over the ticks of a row, as its power is, so their sums grow with its ticks and
nothing of a row is read twice. The scatter is that of the whole wave periods so far, and an
interval changes with each of them.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rig.analysis.intervals import combined_half_width
from rig.analysis.rows import wave_period
from rig.analysis.scatter import successive_error
from rig.analysis.uncertainty import Budget, budget_of
from rig.page.tap import Rows
from rig.realtime.sequence import MEASURE
from rig.recording.runs.folder import earlier_contents
from rig.row_contents import from_records

HalfWidths = tuple[float | None, ...]
"""Half width of the interval of each station of the page, W; None where it is unknown."""


_MAX_PENDING = 5000  # ticks


class _Row:
    """Sums over the ticks of a row."""

    def __init__(self, tick: float, budget: Budget) -> None:
        self.first_tick, self.ticks, self.samples = tick, 0, 0.0
        self.pending: list[Rows] = []  # that the sums do not contain yet
        self.pending_ticks = 0
        self.contributions = np.zeros((len(budget.stations), len(budget.budget.sources)))
        self.periods = np.zeros((len(budget.stations) + 1, 0))  # W by station and period; ticks
        self.whole_periods = 0
        self.half_widths: HalfWidths = ()


class RowIntervals:
    """The intervals of the rows of a run, from its log rows in their order."""

    def __init__(self, columns: Mapping[str, int], stations: Sequence[str], budget: Budget,
                 period_ticks: float) -> None:  # fmt: skip
        """``columns``: those of the log rows by field; ``stations``: of the page, in order."""
        self._budget, self._period = budget, period_ticks
        self.budget_name = budget.budget.name
        own = [station.name for station in budget.stations]
        self._order = [own.index(name) if name in own else -1 for name in stations]
        self._powers = [f"power.{name}" for name in own]
        needed = ("tick", "plan.row", "plan.phase", "power.samples")
        self.fields = tuple(dict.fromkeys((*needed, *self._powers, *budget.log_fields)))
        """The log fields that `add` needs."""
        self._columns = [columns[name] for name in self.fields]
        self._at = {name: at for at, name in enumerate(self.fields)}
        self._unknown = (None,) * len(self._order)
        self._rows: dict[int, _Row] = {}

    def add(self, rows: Rows) -> None:
        """Take log rows in which the law acts, newer than those before."""
        taken = rows[:, self._columns]
        taken = taken[taken[:, self._at["plan.phase"]] == MEASURE]
        if not len(taken):
            return
        numbers, samples = taken[:, self._at["plan.row"]], taken[:, self._at["power.samples"]]
        begins = (np.diff(numbers) != 0) | (np.diff(samples) <= 0)  # an interrupted row starts over
        edges = [0, *(np.flatnonzero(begins) + 1).tolist(), len(taken)]
        for begin, end in pairwise(edges):
            self._add_to_row(int(numbers[begin]), taken[begin:end])

    def half_widths(self, row: int) -> HalfWidths:
        """Return those of a row; None for all if its begin was not seen."""
        found = self._rows.get(row)
        if found is None or found.ticks != found.samples or not found.half_widths:
            return self._unknown
        return found.half_widths

    def _add_to_row(self, number: int, taken: Rows) -> None:
        ticks, samples = taken[:, self._at["tick"]], taken[:, self._at["power.samples"]]
        row = self._rows.get(number)
        if row is None or samples[0] <= row.samples:
            row = self._rows[number] = _Row(float(ticks[0]), self._budget)
        row.ticks, row.samples = row.ticks + len(taken), float(samples[-1])
        row.pending.append(taken)
        row.pending_ticks += len(taken)
        whole = int((ticks[-1] - row.first_tick + 1.5) / self._period)
        if whole != row.whole_periods or row.pending_ticks > _MAX_PENDING:
            self._sum_up(row)
        if whole != row.whole_periods:
            row.whole_periods = whole
            row.half_widths = self._evaluate(row)

    def _sum_up(self, row: _Row) -> None:
        """Add the pending ticks to the sums of a row."""
        taken = np.concatenate(row.pending)
        row.pending, row.pending_ticks = [], 0
        data = {name: taken[:, self._at[name]] for name in self._budget.log_fields}
        row.contributions += len(taken) * self._budget.contributions(data)
        elapsed = taken[:, self._at["tick"]] - row.first_tick
        most = int(elapsed[-1] / self._period) + 2
        edges = np.round(np.arange(most + 1) * self._period)
        period = np.searchsorted(edges, elapsed, side="right") - 1
        values = [*(taken[:, self._at[name]] for name in self._powers), np.ones(len(taken))]
        sums = np.array([np.bincount(period, each, most) for each in values])
        sums[:, : row.periods.shape[1]] += row.periods
        row.periods = sums

    def _evaluate(self, row: _Row) -> HalfWidths:
        *powers, ticks = row.periods[:, : row.whole_periods]
        found: list[float | None] = []
        for each, shares in zip(powers, row.contributions / row.ticks, strict=True):
            scatter = successive_error(each[ticks > 0] / ticks[ticks > 0])
            half = combined_half_width(*scatter, shares, self._budget.distributions)
            found.append(float(f"{half:.3g}") if np.isfinite(half) else None)
        return tuple(found[each] if each >= 0 else None for each in self._order)


def row_intervals(
    columns: Mapping[str, int],
    stations: Sequence[str],
    config: Mapping[str, Any],
    plan: Mapping[str, Any],
) -> RowIntervals | None:
    """Return the intervals of a run; None without a budget, or in a sea without a period.

    The arguments are those of `RowIntervals`, and the run's configuration and plan.
    """
    period, dt = wave_period(dict(plan)), plan.get("dt")
    budget = budget_of(config, from_records(plan, earlier_contents()), list(columns))
    if budget is None or not period or not dt:
        return None
    return RowIntervals(columns, stations, budget, period / float(dt))
