"""All that the page shows of a run at one moment, kept up to date from its rows.

The state is formed once for all browsers.
"""

import math
import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.limits import BoundedValues, find_bounds
from rig.log_fields import label_of
from rig.page.alarms import LOW, Alarms
from rig.page.buckets import Buckets, Extremes
from rig.page.checklist import Conditions
from rig.page.contents import fields_of, find_ages
from rig.page.intervals import RowIntervals, row_intervals
from rig.page.streams import Stream
from rig.page.tap import Rows, Tap
from rig.presentation.phrases import state_text
from rig.realtime.reasons import NO_REASON, ReasonTable
from rig.realtime.safety import Mode
from rig.realtime.sequence import CHOICE, NO_ROW, TARE
from rig.recording.runs.windows import LEAST_MEASURE

MARGIN_S = 10.0  # s over which the least margin is sought
LATENESS_US = (5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
"""Upper edges of the histogram of wake-ups, in microseconds; the last class is open."""
_WHOLE_SHARE = 0.98  # of the planned samples: single ticks may be skipped


class RowPower(NamedTuple):
    """The mean powers of a row of the plan so far."""

    means: tuple[float | None, ...]  # W, one a station; None for one without a mean
    whole: bool  # the row was measured as long as planned
    half_widths: tuple[float | None, ...] = ()  # W, of the 95 % intervals; empty without a budget


class Watch:
    """The state of a run; `poll` it some twenty times a second."""

    def __init__(
        self,
        tap: Tap,
        config: Mapping[str, Any],
        plan: Mapping[str, Any],
        reasons: ReasonTable,
        segments: Mapping[str, Sequence[int]] | None = None,
    ) -> None:
        """``segments``: row, phase and ticks of the plan's segments, where they are known."""
        self._tap, self._reasons = tap, reasons
        self._at = {leaf.name: at for at, leaf in enumerate(tap.leaves)}
        self.dt = float(plan.get("dt") or 1e-3)
        self._planned_s = {
            int(row["row"]): float(row.get(LEAST_MEASURE, row["measure_s"]))
            for row in plan.get("rows", ())
            if "row" in row and "measure_s" in row
        }
        fields = fields_of(plan)
        bounds = find_bounds(tap.leaves, config, fields)
        self._bounds = [each for each in bounds if not each.is_age]
        self._age_limits = {
            name: (limit, label_of(name, fields.labels))
            for name, limit in find_ages(tap.leaves, bounds).items()
        }
        zeros = (name for name in self._at if name.startswith("tar") and name.endswith(".samples"))
        self._tare_samples = next(zeros, "")
        self._stations = [
            each["name"] for each in plan.get("stations", ()) if f"power.{each['name']}" in self._at
        ]
        self._intervals_of = partial(row_intervals, self._at, self._stations, config, plan)
        self._segments = segments
        self.streams: list[Stream] = []  # that get all rows, too
        self._warned = [name for name in self._at if name.endswith("warned")]
        # The values that limits bound come last.
        self._bound_columns = list(range(len(self._at), len(self._at) + len(self._bounds)))
        self.buckets = Buckets(len(self._at) + len(self._bounds), self._at["time"], self.dt)
        self.clear()

    def clear(self) -> None:
        """Forget all rows, as at the start of a replay."""
        self.alarms = Alarms(self._reasons)
        self._bounded = BoundedValues(self._bounds, self._tap.leaves, self.dt)
        self.buckets.clear()
        self.powers: dict[int, RowPower] = {}  # by row of the plan
        self._intervals = self.new_intervals()
        self._lateness = np.zeros(len(LATENESS_US) + 1, np.int64)
        self._row: np.ndarray[Any, Any] | None = None
        self._arrived = time.monotonic()
        self._segment: tuple[int, int, int] = (NO_ROW, -1, 0)  # row, phase, attempt
        self._entered: float | None = None  # s; None: before the first row that the page saw
        self._reason, self._skipped = NO_REASON, -1
        self._tared_at: float | None = None  # s; None: before the first row that the page saw

    def field_indices(self, fields: Sequence[str]) -> list[int]:
        """Return the columns of fields; KeyError for one that the rows do not have."""
        return [self._at[name] for name in fields]

    def poll(self) -> Extremes | None:
        """Take the new rows; return the buckets that became whole, None if none did."""
        rows = self._tap.poll()
        if not len(rows):
            return None
        for stream in self.streams:
            stream.send(rows)
        rows = np.concatenate((rows, self._bounded.columns(rows)), axis=1)
        self._row, self._arrived = rows[-1], time.monotonic()
        edges = 1e-6 * np.array(LATENESS_US)
        late = np.searchsorted(edges, rows[:, self._at["timing.lateness"]])
        self._lateness += np.bincount(late, minlength=len(self._lateness))
        self.powers |= self.powers_in(rows, self._intervals)
        if len(taring := np.flatnonzero(rows[:, self._at["plan.phase"]] == TARE)):
            self._tared_at = float(rows[taring[-1], self._at["time"]])
        self._watch_segment(rows)
        self._watch_alarms(rows)
        found = self.buckets.add(rows)
        return found if found.size else None

    def new_intervals(self) -> RowIntervals | None:
        """Return intervals for `powers_in` of all rows; None for a run without a budget."""
        return self._intervals_of()

    def powers_in(self, rows: Rows, intervals: RowIntervals | None = None) -> dict[int, RowPower]:
        """Return the newest powers of the plan's rows in log rows, without those of a hold.

        An interrupted row starts over, and on hold the drive damps instead of the law.
        ``intervals`` took all rows before.
        """
        samples, numbers = rows[:, self._at["power.samples"]], rows[:, self._at["plan.row"]]
        acting = rows[:, self._at["safety.mode"]] == Mode.RUN
        measured = np.flatnonzero((samples > 0) & (numbers >= 0) & acting)
        if not len(measured):
            return {}
        if intervals is not None:
            intervals.add(rows[measured])
        found = numbers[measured]
        last = np.append(np.flatnonzero(np.diff(found)), len(found) - 1)
        columns = [self._at.get(f"power.mean_{name}") for name in self._stations]
        return {
            int(numbers[at]): RowPower(
                tuple(None if each is None else _finite(rows[at, each]) for each in columns),
                bool(
                    _WHOLE_SHARE * self._planned_s.get(int(numbers[at]), 0.0)
                    <= self.dt * samples[at]
                ),
                intervals.half_widths(int(numbers[at])) if intervals else (),
            )
            for at in measured[last]
        }

    def _watch_segment(self, rows: Rows) -> None:
        columns = rows[:, [self._at[f"plan.{key}"] for key in ("row", "phase", "attempt")]]
        present = (int(columns[-1, 0]), int(columns[-1, 1]), int(columns[-1, 2]))
        if present == self._segment:
            return
        if self._segment[1] >= 0 or (columns[0] != columns[-1]).any():
            others = np.flatnonzero((columns != columns[-1]).any(axis=1))
            first = others[-1] + 1 if len(others) else 0
            self._entered = float(rows[first, self._at["time"]])
        self._segment = present

    def _watch_alarms(self, rows: Rows) -> None:
        reasons = rows[:, self._at["safety.reason"]]
        clock = self._at["time"]
        changed = np.flatnonzero(reasons != self._reason)
        if len(changed):
            self._reason = int(reasons[-1])
            self.alarms.stopped(float(rows[changed[0], clock]), int(reasons[changed[0]]))
        for name in self._warned:
            where = np.flatnonzero(rows[:, self._at[name]])
            if len(where):
                axis = name.rpartition(".")[0].replace("_", " ") or "axis"
                cause = f"{axis}: position beyond its warning mark"
                action = "Reduce the demand, or hold the run before the limit stops it."
                self.alarms.raise_alarm(name, float(rows[where[0], clock]), LOW, cause, action)
        skipped = int(rows[-1, self._at["timing.skipped"]])
        if 0 <= self._skipped < skipped:
            cause = "ticks were skipped: the loop woke up too late"
            action = "Close other programs; `rig doctor` finds the cause."
            self.alarms.raise_alarm("skipped", float(rows[-1, clock]), LOW, cause, action)
        self._skipped = skipped

    def state(self) -> dict[str, Any]:
        """Return the state as JSON values."""
        status = self._tap.status()
        row = self._row
        if status["dropped"]:
            cause = f"{status['dropped']} rows were lost: the logger or the disk is too slow"
            action = "Look at the disk; the run's record says which rows are missing."
            now = 0.0 if row is None else float(row[self._at["time"]])
            self.alarms.raise_alarm("dropped", now, LOW, cause, action)
        found: dict[str, Any] = {"source": status, "alarms": self.alarms.listed()}
        if row is None:
            return found | {"state": "WAITING"}
        mode, reason = self._whole("safety.mode"), self._whole("safety.reason")
        name = self._reasons.name(reason)
        return found | {
            "state": state_text(mode),
            "mode": mode,
            "reason": name if reason != NO_REASON else "",
            "reason_text": self._reasons.text(name) if reason != NO_REASON else "",
            "time": round(float(row[self._at["time"]]), 3),
            "tick": self._whole("tick"),
            "row": self._whole("plan.row"),
            "phase": self._whole("plan.phase"),
            "attempt": self._whole("plan.attempt"),
            "live": self._whole("plan.live"),
            "samples": self._whole("power.samples"),
            "skipped": self._whole("timing.skipped"),
            "segment": self._segment_times(),
            "powers": [
                [self._number(f"power.{name}"), self._number(f"power.mean_{name}")]
                for name in self._stations
            ],
            "limits": self._limit_states(row),
            "ages": [self._number(each) for each in self._age_limits],
            "lateness": self._lateness.tolist(),
            "silent_s": round(time.monotonic() - self._arrived, 1),
        }

    @property
    def powered(self) -> bool:
        """Whether the newest row has the power on, or being switched on or off."""
        return self._row is not None and self._whole("safety.mode") != Mode.OFF

    def conditions(self, privileges: Mapping[str, Any]) -> Conditions:
        """Return the conditions for the checklist; ``privileges``: as the loop reports them."""
        row, silent = self._row, time.monotonic() - self._arrived
        if row is None:
            return Conditions(None, None, None, privileges)
        late = tuple(
            f"{label}: {1e3 * age:.0f} ms, limit {1e3 * limit:g} ms"
            for name, (limit, label) in self._age_limits.items()
            if limit is not None and not 0.0 <= (age := float(row[self._at[name]])) <= limit
        )
        tared_at, now = self._tared_at, float(row[self._at["time"]])
        samples = self._whole(self._tare_samples) if self._tare_samples else None
        tare_age = None if tared_at is None else now - tared_at
        return Conditions(late, samples, tare_age, privileges, silent)

    def _limit_states(self, row: np.ndarray[Any, Any]) -> list[list[float | None]]:
        """Return of every limit the present value, and the extremes of the last 10 s."""
        recent = self.buckets.newest(MARGIN_S, self._bound_columns)
        if not recent.size:
            return [[_finite(row[column]), None, None] for column in self._bound_columns]
        lows, highs = np.fmin.reduce(recent.low), np.fmax.reduce(recent.high)
        values = zip(row[self._bound_columns], lows, highs, strict=True)
        return [[_finite(each) for each in one] for one in values]

    def _segment_times(self) -> dict[str, float | None]:
        """Return seconds of the present segment: elapsed, length; and left of the plan."""
        now = self._number("time") or 0.0
        elapsed = None if self._entered is None else now - self._entered
        if self._segments is None:
            return {"elapsed": elapsed, "length": None, "left": None}
        pairs = list(zip(self._segments["row"], self._segments["phase"], strict=True))
        if self._segment[:2] not in pairs:
            return {"elapsed": elapsed, "length": None, "left": None}
        at = pairs.index(self._segment[:2])
        ticks = self._segments["ticks"]
        length = self.dt * ticks[at]
        after = self.dt * sum(ticks[at + 1 :])
        left = after + max(0.0, length - (elapsed or 0.0))
        if CHOICE in self._segments["phase"]:  # nobody knows how many rows will be chosen
            return {"elapsed": elapsed, "length": length, "left": None}
        return {"elapsed": elapsed, "length": length, "left": left}

    def _number(self, field: str) -> float | None:
        at = self._at.get(field)
        return None if at is None or self._row is None else _finite(self._row[at])

    def _whole(self, field: str) -> int:
        return 0 if self._row is None else int(self._row[self._at[field]])


def _finite(value: Any) -> float | None:
    """Return a number with six digits for JSON; None for NaN and infinity."""
    number = float(value)
    return float(f"{number:.6g}") if math.isfinite(number) else None
