"""The choice of the rows of an adaptive campaign, by what its run has measured so far.

A process beside the run follows it (`follow`). When the plan waits for a choice
(`rig.realtime.sequence.CHOICE`), it reads the row table of the record and asks for the next row, or
for the end, by the run's socket; the reason is an argument of the request, and so in the run's
journal. The rig waits with the set point of the last row. The same functions give the choices and
the surrogate of a run that has ended.
"""

import os
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.rows import COMPLETE, row_table
from rig.campaign.check import CheckReport
from rig.campaign.kind import AnyCampaign
from rig.config.adaptive import AdaptiveRows
from rig.design import surrogate
from rig.design.surrogate import Choice, Floats, Measured, Surrogate
from rig.people.orders import CAMPAIGN, awaits_choice
from rig.people.request_client import RequestClient, RequestError
from rig.presentation.phrases import format_power
from rig.realtime.scheduling import leave_the_loops_core
from rig.realtime.sequence import CHOICE, MOVING, NO_ROW
from rig.recording.ring import RingView
from rig.recording.runs import RunError, RunInfo, run_info
from rig.recording.runs.windows import ADAPTIVE
from rig.stations import find

_LOOK_S = 0.05  # s between two looks at the run
_BEGIN_S = 600.0  # s for the run to begin: its code may be compiled first
_RECORD_S = 30.0  # s until a measured row must be in the record
_REFUSED_S = 0.5  # s after an order that the run refused
_NOTHING_W = 0.001  # W; less is not shown
_UNKNOWN_ERROR = 0.02  # of the largest power: standard error of a row without one


class Decision(NamedTuple):
    """The next row of a campaign, or its end."""

    row: int  # `NO_ROW`: the end
    why: str
    best: int  # row that is recommended so far; `NO_ROW`: nothing is measured
    regret: float  # W, that it is expected to give away; NaN: unknown


def adaptive_record(report: CheckReport) -> dict[str, Any]:
    """Return what the record of a plan says of the choice of rows; empty for other campaigns.

    Raises ValueError without the prediction that the campaign is to start from.
    """
    campaign, plan = report.campaign, report.plan
    if campaign is None or plan is None or campaign.file.adaptive is None:
        return {}
    file = campaign.file.adaptive
    for problem in report.unpredicted:
        raise ValueError(f"{problem.key}: {problem.message}")
    station = find(campaign.kind.assessed_stations(campaign.rig), file.station)
    predicted = report.predicted_powers if file.start == "predicted" else {}
    windows = campaign.kind.windows(campaign.file)
    facts = {"station": station.name, "predicted": predicted, "row_s": windows.interval}
    return {ADAPTIVE: file.model_dump(mode="json") | facts}


def candidate_places(campaign: AnyCampaign, rows: Sequence[Any]) -> dict[int, float]:
    """Return the place of the part that moves, by row of a plan; empty if no rows are chosen."""
    return {} if campaign.file.adaptive is None else {row.row: row.place for row in rows}


class Candidates:
    """The rows of an adaptive campaign, and what its run has measured of them."""

    def __init__(self, info: RunInfo, table: Any) -> None:
        """``table``: row table of the run, with all rows of the plan."""
        record = dict(info.plan[ADAPTIVE])
        self.station = str(record.pop("station"))
        self._predicted: Mapping[str, list[float]] = record.pop("predicted")
        self._row_s = float(record.pop("row_s"))
        self.options = AdaptiveRows.model_validate(record | {"station": self.station})
        rows = info.plan["rows"]
        self.rows = [int(row["row"]) for row in rows]
        contents = info.row_contents
        names = [each.name for each in contents.settings if each.name in rows[0]]
        values = np.array([[float(row[name]) for name in names] for row in rows])
        varied = values.min(axis=0) < values.max(axis=0)
        varied[0] |= not varied.any()  # equal candidates differ in nothing
        self.columns: Floats = values[:, varied]
        self.names = [name for name, each in zip(names, varied, strict=True) if each]
        actuator = next((each.name for each in contents.columns if each.name not in names), "")
        self.places = [float(row.get(actuator, 0.0)) for row in rows]
        self._table = table
        states, self._start = table["state"].values.tolist(), table["start"].values
        done = [i for i, state in enumerate(states) if state == COMPLETE]
        self.done = sorted(done, key=lambda i: float(self._start[i]))  # in the order of time

    def measured(self, station: str) -> Measured:
        """Return the powers of the measured rows at a station."""
        powers, errors = (
            self._table[f"power_{station}{end}"].values[self.done] for end in ("", "_se")
        )
        unknown = _UNKNOWN_ERROR * float(np.abs(powers).max())
        errors = np.where(np.isfinite(errors), errors, unknown)
        return Measured(np.array(self.done, np.int64), powers, errors)

    def surrogate(self, station: str) -> Surrogate:
        """Return the powers of all candidates at a station as they are known by now."""
        predicted = self._predicted.get(station)
        prior = None if predicted is None else np.array(predicted)
        return surrogate.fit(self.columns, self.measured(station), prior)

    def decide(
        self,
        seconds_left: float,
        at: int,
        move_s: float | None = None,
        left_out: Collection[int] = (),
    ) -> Decision:
        """Return the next row, or the end.

        ``seconds_left``: of the campaign's time; ``at``: index of the row whose set point is in
        force; ``move_s``: time that a move of a part to another place costs, by default that of a
        row; ``left_out``: rows that were tried and not measured.
        """
        options, done = self.options, self.done
        move_s = self._row_s if move_s is None else move_s
        seconds = np.array(
            [self._row_s + (move_s if place != self.places[at] else 0.0) for place in self.places]
        )
        seconds[[row in left_out for row in self.rows]] = np.inf
        seconds[seconds > seconds_left] = np.inf
        if not done or (not self._predicted and len(done) < options.first_rows):
            first = self._first(seconds)
            if first is not None:
                return first
        if not done:
            return Decision(NO_ROW, "no time is left for a row", NO_ROW, float("nan"))
        known = self.surrogate(self.station)
        choice = surrogate.choose(known, self.measured(self.station), seconds)
        best, regret = self.rows[choice.best], choice.regret
        if end := self._end(choice):
            return Decision(NO_ROW, f"{end}; {self._best_text(choice)}", best, regret)
        mean, deviation = known.mean[choice.at], known.deviation[choice.at]
        why = (
            f"{format_power(mean, deviation)} by what is known; expected gain over row {best} "
            f"{_watts(choice.gain)}, expected loss of that row {_watts(regret)}"
        )
        if self.places[choice.at] != self.places[at]:
            why += f"; a move of about {move_s:.0f} s"
        return Decision(self.rows[choice.at], why, best, regret)

    def _first(self, seconds: Floats) -> Decision | None:
        """Return one of the first rows, which no measurement chooses; None without time for it."""
        if predicted := self._predicted.get(self.station):
            order = np.argsort(predicted)
            why = "the best predicted row"
        else:
            order = np.array(surrogate.spread(self.columns))
            why = "one of the first rows, which cover the matrix"
        left = [int(i) for i in order if i not in self.done and np.isfinite(seconds[i])]
        return Decision(self.rows[left[0]], why, NO_ROW, float("nan")) if left else None

    def _end(self, choice: Choice) -> str:
        """Return why no more rows are to be measured; empty if there are."""
        options, count = self.options, len(self.done)
        if choice.regret <= options.precision_w and count >= options.first_rows:
            return f"the expected loss is within {options.precision_w:g} W after {count} rows"
        if count >= options.max_rows:
            return f"{count} rows, the most that the campaign allows"
        if count == len(self.rows):
            return f"all {count} rows are measured"
        return "no time is left for another row" if choice.at < 0 else ""

    def _best_text(self, choice: Choice) -> str:
        i = self.done.index(choice.best)
        powers = self.measured(self.station)
        power = format_power(powers.power[i], powers.error[i])
        return (
            f"best: row {self.rows[choice.best]}, {power} at {self.station}, expected loss "
            f"{_watts(choice.regret)}"
        )


def _watts(value: float) -> str:
    return f"{value:.2g} W" if value >= _NOTHING_W else f"below {_NOTHING_W:g} W"


def follow(folder: Path) -> None:
    """Choose the rows of a run until it ends; RunError or RequestError if that is impossible."""
    leave_the_loops_core()
    client = _connect(folder)
    try:
        facts, descriptor = client.hello()
        ring = RingView(descriptor)
        os.close(descriptor)
        first = next(row for row in facts["segments"]["row"] if row != NO_ROW)
        chooser = _Chooser(folder, client, ring, first, float(facts["dt"]))
        while chooser.step():
            time.sleep(_LOOK_S)
    finally:
        client.close()


def _connect(folder: Path) -> RequestClient:
    """Return the connection to a run once it listens; RequestError if it never does."""
    end = time.monotonic() + _BEGIN_S
    while True:
        try:
            return RequestClient(folder, person="adaptive campaign", origin=CAMPAIGN)
        except RequestError:
            if time.monotonic() > end:
                raise
        time.sleep(_LOOK_S)


class _Chooser:
    """Follows the rows of a run by its socket."""

    def __init__(
        self, folder: Path, client: RequestClient, ring: RingView, first: int, dt: float
    ) -> None:
        """``first``: row whose set point is in force in the lead-in."""
        self._folder, self._client, self._ring, self._dt = folder, client, ring, dt
        self._row = first  # whose set point is in force
        self._ordered = -1  # tick of the last order
        self._moves = False  # a part moves since then
        self._moved: list[float] = []  # s, of the moves so far
        self._first_choice = -1  # tick
        self._tried: set[int] = set()

    def step(self) -> bool:
        """Look at the run once; return False after its last row."""
        row = self._client.ask("state").get("row") or {}
        if not row:
            return True
        tick, phase = int(row["tick"]), int(row["plan.phase"])
        if row["plan.row"] != NO_ROW:
            self._row = int(row["plan.row"])  # a person may have chosen it
        if self._moves and phase not in (CHOICE, MOVING):
            self._moved.append((tick - self._ordered) * self._dt)
            self._moves = False
        if not awaits_choice(row) or tick <= self._ordered:
            return True
        return self._choose(tick)

    def _choose(self, tick: int) -> bool:
        """Ask for the next row; return False after the last one."""
        self._wait_for_record()
        candidates = Candidates(run_info(self._folder), row_table(self._folder))
        if self._first_choice < 0:
            self._first_choice = tick
        minutes = candidates.options.max_minutes
        elapsed = (tick - self._first_choice) * self._dt
        left = np.inf if minutes is None else 60.0 * minutes - elapsed
        at = candidates.rows.index(self._row)
        move_s = float(np.mean(self._moved)) if self._moved else None
        decision = candidates.decide(left, at, move_s, self._tried)
        regret = decision.regret if np.isfinite(decision.regret) else None
        facts: dict[str, Any] = {"why": decision.why, "best": decision.best, "regret_w": regret}
        ends = decision.row == NO_ROW
        if not ends:
            facts["row"] = decision.row
        accepted = self._client.ask("finish" if ends else "next_row", **facts).get("accepted")
        if not accepted:  # a person was faster, or stops the run
            time.sleep(_REFUSED_S)
        elif not ends:
            places, chosen = candidates.places, candidates.rows.index(decision.row)
            self._moves = places[chosen] != places[at]
            self._row, self._ordered = decision.row, tick
            self._tried.add(decision.row)
        return not (ends and accepted)

    def _wait_for_record(self) -> None:
        """Wait until all rows of the ring so far are in the record."""
        head, end = self._ring.head, time.monotonic() + _RECORD_S
        while self._ring.tail < head:
            if time.monotonic() > end:
                raise RunError(f"the record is more than {_RECORD_S:g} s behind the run")
            time.sleep(_LOOK_S)


if __name__ == "__main__":
    try:
        follow(Path(sys.argv[1]))
    except (OSError, ValueError) as error:  # RunError, RequestError
        sys.exit(str(error))
