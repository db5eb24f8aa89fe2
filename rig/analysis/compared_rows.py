"""Powers of rows that ended before the repeat period of their irregular sea.

The mean over such a window would be that of the waves in it. Its power over the whole period is
estimated from a reference row at the same time of the wave clock's repeat period, with the rule by
which the loop ended the row (`rig.realtime.paired_rows`), station by station. The reference is the
row with the least power at the station that counts, of those before in the same sea that cover the
whole period.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.realtime.paired_rows import BINS, PER_BATCH, estimated
from rig.recording.runs.windows import LEAST_MEASURE, Window
from rig.stations import Station, find

WAVE_CLOCK = "plan.wave_clock"
COMPARED_WITH, BATCHES = "compared_with", "batches"
"""Columns of a row table: the reference row, -1 for none, and the samples of the comparison."""
NOT_COMPARED: dict[str, Any] = {COMPARED_WITH: -1, BATCHES: 0}
NO_REFERENCE = "it ended before the repeat period, and no row before it covers that"
_WHOLE = 0.99  # share of the repeat period


class _Reference(NamedTuple):
    """A row that covers the repeat period."""

    row: int
    seed: int
    powers: dict[str, NDArray[np.float64]]  # W, by station, a value for each tick of the period
    means: dict[str, float]  # W


class ComparedRows:
    """Completes the entries of a run's rows, given in the order of the run."""

    def __init__(
        self,
        stations: Sequence[Station],
        station: str,
        seeds: Mapping[int, int],
        dt: float,
        period_ticks: float,
    ) -> None:
        """``station``: name of the one by whose power rows end; ``seeds``: of the sea, by row;
        ``period_ticks``: of a repeat period, each of ``dt`` seconds."""
        self._stations = [each.name for each in stations]
        self._deciding = f"power_{find(stations, station).name}"
        self._seeds, self._dt, self._ticks = seeds, dt, period_ticks
        self._reference: _Reference | None = None
        self._least = np.inf  # W, of the reference at the station that decides

    def complete(self, entry: dict[str, Any], window: Window) -> dict[str, Any]:
        """Return the entry of a window with the powers over the repeat period if it is complete.

        The standard error has ``batches`` - 2 degrees of freedom. A row without a reference is cut
        short, for the reason `NO_REFERENCE`.
        """
        seed = self._seeds.get(window.row, 0)
        if window.incomplete_reason:
            return entry
        if self._reference is not None and self._reference.seed != seed:
            self._reference, self._least = None, np.inf
        if window.span >= _WHOLE * self._ticks:
            if entry[self._deciding] < self._least and not window.missing:
                self._reference = self._as_reference(window, seed)
                self._least = entry[self._deciding]
            return entry
        if self._reference is None:
            return entry | {"state": "cut short", "incomplete_reason": NO_REFERENCE}
        return entry | self._compared(entry, window, self._reference)

    def _as_reference(self, window: Window, seed: int) -> _Reference:
        length, phases = round(self._ticks), self._phases(window)
        powers, means = {}, {}
        for name in self._stations:
            values = window.data[f"power.{name}"]
            powers[name] = np.full(length, np.nan)
            powers[name][phases] = values
            means[name] = float(values.mean())
        return _Reference(window.row, seed, powers, means)

    def _phases(self, window: Window) -> NDArray[np.int64]:
        """Return the tick of the repeat period to which each tick belongs."""
        ticks = np.rint(window.data[WAVE_CLOCK] / self._dt)
        phases: NDArray[np.int64] = np.mod(ticks, self._ticks).astype(np.int64)
        return np.minimum(phases, round(self._ticks) - 1)

    def _compared(
        self, entry: dict[str, Any], window: Window, reference: _Reference
    ) -> dict[str, Any]:
        phases = self._phases(window)
        elapsed = window.data["tick"] - window.data["tick"][0]
        bins = round((int(elapsed[-1]) + 1) * BINS / self._ticks)
        bins -= bins % PER_BATCH
        edges = np.searchsorted(elapsed, np.rint(np.arange(bins + 1) * self._ticks / BINS))
        changed: dict[str, Any] = {BATCHES: bins // PER_BATCH, COMPARED_WITH: reference.row}
        for name in self._stations:
            before = (0.0,) * (BINS - bins)
            own, other = (
                before + tuple(float(np.nanmean(part)) for part in np.split(values, edges[1:-1]))
                for values in (
                    window.data[f"power.{name}"][: edges[-1]],
                    reference.powers[name][phases][: edges[-1]],
                )
            )
            estimate = estimated(own, other, reference.means[name], bins)
            changed[f"power_{name}"] = estimate.power
            changed[f"power_{name}_se"] = float(np.sqrt(estimate.variance))
            changed[f"power_{name}_dof"] = float(bins // PER_BATCH - 2)
            demeaned = f"power_{name}_demeaned"
            if demeaned in entry:  # the window's mean force and velocity stay
                changed[demeaned] = entry[demeaned] + estimate.power - entry[f"power_{name}"]
        return changed


def compared_rows(
    plan: Mapping[str, Any],
    config: Mapping[str, Any],
    stations: Sequence[Station],
    period_ticks: float | None,
) -> ComparedRows | None:
    """Return what completes the rows of a run; None if its rows end otherwise.

    ``period_ticks``: ticks of the repeat period of its sea.
    """
    timing = (config.get("campaign") or {}).get("timing") or {}
    sea, end = plan.get("sea") or {}, timing.get("end") if isinstance(timing, dict) else None
    ends_early = any(LEAST_MEASURE in row for row in plan.get("rows", []))
    if period_ticks is None or not end or not ends_early or sea.get("kind") == "regular":
        return None
    seeds = {int(row["row"]): int(row.get("seed", 0)) for row in plan["rows"]}
    return ComparedRows(stations, end["station"], seeds, float(plan["dt"]), period_ticks)
