"""The reasons for the end of rows: full length, precision of the campaign, or not the best.

The loop does not log the condition that ended a row. The same rules applied to the record give it,
from the powers of the station by which rows end. A row that can no longer be the best is cut by
that station alone: its powers at all stations have the larger errors of a short row, and the best
row of another station may be among such rows.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from rig.analysis.compared_rows import BATCHES
from rig.analysis.scatter import period_means
from rig.realtime import assessment, paired_rows
from rig.recording.runs.windows import LEAST_MEASURE, Window
from rig.stations import Station, find

END_REASON = "end_reason"  # column of a row table; absent where rows end after fixed times
END_STATION = "end_station"  # attribute of the table: name of the station by whose power rows end
FULL, PRECISE, WORSE = "full length", "precise", "cannot be the best"
_FULL_SHARE = 0.99  # of the longest measurement of a row


class Precision(NamedTuple):
    """The standard error at which a row ends; 0: none."""

    watts: float
    share: float  # of the best row's power


class RowEnds:
    """Adds to the entries of a run's rows why they ended, in the order of the run."""

    def __init__(
        self,
        station: str,
        precision: Precision,
        period_ticks: float,
        full_ticks: Mapping[int, int],
        seeds: Mapping[int, int],
    ) -> None:
        """``station``: name of the one by whose power rows end; ``full_ticks``: length of a row
        that nothing ends, by row; ``seeds``: of its sea."""
        self.station = station
        self._period_ticks, self._full_ticks, self._seeds = period_ticks, full_ticks, seeds
        self._regular = assessment.NOTHING._replace(
            precision=precision.watts, precision_of_best=precision.share
        )
        self._irregular = paired_rows.NOTHING._replace(
            precision=precision.watts, precision_of_best=precision.share
        )
        self._forget()
        self._seed = 0

    def _forget(self) -> None:
        self._rows, self._best = assessment.NO_ROWS, paired_rows.Estimate(float("inf"), 0.0)

    def complete(self, entry: dict[str, Any], window: Window) -> dict[str, Any]:
        """Return the entry of a window with the reason of its end; "" for an incomplete one.

        ``window``: as the loop measured it, without corrections by calibrations.
        """
        seed = self._seeds.get(window.row, 0)
        if seed != self._seed:  # the loop starts anew in each sea
            self._forget()
            self._seed = seed
        if window.incomplete_reason or entry["incomplete_reason"]:
            return entry | {END_REASON: ""}
        is_full = window.expected >= _FULL_SHARE * self._full_ticks[window.row]
        is_compared = BATCHES in entry
        is_precise = self._compared(entry) if is_compared else self._measured(window)
        return entry | {END_REASON: FULL if is_full else PRECISE if is_precise else WORSE}

    def _compared(self, entry: dict[str, Any]) -> bool:
        power, error = entry[f"power_{self.station}"], entry[f"power_{self.station}_se"]
        estimate = paired_rows.Estimate(power, error**2 if entry[BATCHES] else 0.0)
        best, batches = self._best, entry[BATCHES]
        self._best = min(best, estimate, key=lambda each: each.power)
        return paired_rows.is_precise(self._irregular, estimate, best, batches)

    def _measured(self, window: Window) -> bool:
        powers = window.data[f"power.{self.station}"]
        means = period_means(powers, window.data["tick"], self._period_ticks)
        scatter = assessment.NO_SCATTER
        for i, mean in enumerate(means.tolist()):
            scatter = assessment.add_period(scatter, mean, i + 1)
        rows = self._rows
        self._rows = assessment.after_row(rows, scatter, len(means))
        return assessment.is_precise(self._regular, rows, scatter, len(means))


def row_ends(
    plan: Mapping[str, Any],
    config: Mapping[str, Any],
    stations: tuple[Station, ...],
    period_ticks: float | None,
) -> RowEnds | None:
    """Return what gives the reasons of a run; None if its rows end after fixed times.

    ``period_ticks``: ticks of the repeat period of its sea.
    """
    timing = (config.get("campaign") or {}).get("timing") or {}
    end = timing.get("end") if isinstance(timing, dict) else None
    rows = [row for row in plan.get("rows", []) if LEAST_MEASURE in row]
    if not end or not rows or period_ticks is None:
        return None
    share = 1e-2 * (end.get("precision_percent") or 0.0)
    return RowEnds(
        find(stations, end["station"]).name,
        Precision(end.get("precision_w") or 0.0, share),
        period_ticks,
        {int(row["row"]): round(row["measure_s"] / float(plan["dt"])) for row in rows},
        {int(row["row"]): int(row.get("seed", 0)) for row in rows},
    )
