"""Prediction of a campaign by simulation: its plan in the compiled loop, as a rehearsal runs it.

Limits, ramps and transients are those of the loop, so a row that would trip is found, and any law
has a prediction. Sweeps reduce the windows of their simulations by the same function.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from rich.console import Console
from rich.text import Text

from rig.analysis.compared_rows import ComparedRows
from rig.analysis.rows import COMPLETE, NOT_RUN, column_units, motion_fields, reduce_window
from rig.campaign.equal_rows import EqualRows, find_equal_rows
from rig.campaign.equilibrium import EquilibriumCheck
from rig.campaign.kind import AnyCampaign, AnyPlan
from rig.config.law_settings import shown_columns, value_text
from rig.config.problems import Problem, number_ranges
from rig.config.sea import RegularSea
from rig.planning.windows import repeat_period
from rig.presentation.console import plain_table, table_console, whole_table
from rig.presentation.json_values import json_value
from rig.presentation.phrases import count_text, unit_text
from rig.realtime.reasons import Reason
from rig.recording.row_layout import leaves
from rig.recording.runs.windows import Window
from rig.row_contents import PANEL, Column, RowContents, X, Y
from rig.stations import in_tables

MAX_SECONDS = 7200.0
"""Length of the part of a plan that a check simulates unasked, s: some seconds of work."""
_SHOWN_ROWS = 12
_SMALL_PEAK = 0.01  # m or rad: three decimals of smaller ones have no two digits
_MAX_EQUAL = 10
_MOTION = {
    "position_peak": "x peak",
    "current_peak": "i peak",
    "current_rms": "i rms",
    "force_rms": "F rms",
}
NO_EQUILIBRIUM, END_STOP, NOT_SETTLED = "NO_EQUILIBRIUM", "END_STOP", "NOT_SETTLED"
FLAGS = {
    NO_EQUILIBRIUM: "too little stiffness for an equilibrium",
    END_STOP: "at an end stop",
    NOT_SETTLED: "not settled",
}
"""Findings about a simulated row, which is then no best row, and their texts for people."""

# A row is settled if its motion repeats: over the whole wave periods of its window, the position
# of the last period is that of the first within 2 % of the motion (rms). This sees a drift, a
# transient and a growing motion alike, and bounds the change of power to 4 %. It needs no model, so
# it holds for all laws and kinds; poles of the closed loop would give a time for linear laws only.
SETTLED = 0.02
_SMALL = 1.0e-4  # m or rad: as small a motion counts as rest


class RowSimulation(Protocol):
    """Iterator over the measured windows of a plan's rows; then ``reason`` is that of its end."""

    reason: str

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""

    def __iter__(self) -> Iterator[Window]:
        """Yield the window of each measured row; its data are valid until the next one."""


class SimulatedRows(NamedTuple):
    """The rows of a campaign, simulated in sequence from power-on."""

    campaign: AnyCampaign
    planned: int  # rows of the plan, of which the first ones may be simulated
    rows: tuple[dict[str, Any], ...]  # as in the row table, in the order of the plan
    reason: str  # of the end: a `Reason`; NONE: the rest of the plan was not simulated
    contents: RowContents
    units: dict[str, str]  # of the numbers in the table
    seconds: float = float("nan")  # simulated time, of all seas

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the matrix that a table shows.

        They are the main ones, those of the laws among which rows choose, and those that vary.
        """
        choices = [each for each in self.campaign.axis_laws.values() if each.law.parts]
        chosen = {each.name for each in shown_columns(choices, self.rows)}
        return tuple(
            each
            for each in self.contents.columns
            if each.role in (PANEL, X, Y)
            or each.name in chosen
            or len({row[each.name] for row in self.rows}) > 1
        )

    @property
    def numbers(self) -> dict[str, str]:
        """The format of each number that a table shows, by its name in the row table."""
        ranges = (check.name for check in self.contents.checks if check.statistic == "range")
        powers = (f"power_{station.name}" for station in in_tables(self.contents.stations))
        peaks = [row["position_peak"] for row in self.rows if row["state"] != NOT_RUN]
        peak = ".3f" if any(each >= _SMALL_PEAK for each in peaks) else ".3g"
        digits = dict.fromkeys(_MOTION, ".4g") | {"position_peak": peak}
        return digits | dict.fromkeys(ranges, ".3f") | dict.fromkeys(powers, ".4g")

    @property
    def equal_rows(self) -> tuple[EqualRows, ...]:
        """The rows that print the same numbers although their set points differ."""
        settings = {each.name for each in self.contents.settings}
        results = [name for name in column_units(self.contents) if name not in {*settings, "start"}]
        return find_equal_rows(self.rows, self.contents.columns, results, self.numbers)

    def extent(self) -> str:
        """Return how many rows are simulated."""
        count = len(self.rows)
        if count == self.planned:
            return f"all {count} rows" if count > 1 else "the row"
        first = f"the first {count} of {self.planned} rows"
        return f"{first}: the plan is long, rig check --simulate simulates all"

    def warnings(self) -> Iterator[Problem]:
        """Yield a warning if the simulated plan stops before its end, with the rows that it lacks.

        The loop stops at the first trip, so the rows after it lack, too.
        """
        if self.reason in (Reason.PLAN_END.name, Reason.NONE.name):
            return
        message = f"simulated, the run stops with {self.reason}"
        if lacking := self._incomplete():
            message += (
                f" in row {lacking[0]} or before it; {len(lacking)} of "
                f"{count_text(len(self.rows), 'row')} not complete: "
                f"{', '.join(number_ranges(lacking))}"
            )
        yield self.campaign.locate.problem(("matrix",), None, message)

    def refused(self) -> Iterator[Problem]:
        """Yield why the campaign must not run: no simulated row is complete before a stop."""
        if len(self._incomplete()) == len(self.rows):
            yield from self.warnings()

    def _incomplete(self) -> list[int]:
        """Return the numbers of the rows that are not complete."""
        return [row["row"] for row in self.rows if row["state"] != COMPLETE]

    def as_dict(self) -> dict[str, Any]:
        """Return the rows as JSON values in SI units; None for missing numbers."""
        return {
            "simulated": [json_value(row) for row in self.rows],
            "simulated_extent": self.extent(),
            "equal_simulated_rows": [each.as_dict() for each in self.equal_rows],
        }

    def show(self, *, every_row: bool) -> None:
        """Print the rows as a table, the first ones or all."""
        console, numbers, columns = table_console(), self.numbers, self.columns
        headings = [(each.heading or each.label, unit_text(each.unit)) for each in columns]
        powers = {f"power_{each.name}": each.heading for each in self.contents.stations}
        for name in numbers:  # others than these two are ranges
            heading = _MOTION.get(name) or powers.get(name)
            axis_range = (name.removesuffix("_stroke"), f"{self.units[name]} p-p")
            headings.append((heading, self.units[name]) if heading else axis_range)
        rows = self.rows if every_row else self.rows[:_SHOWN_ROWS]
        title = Text(f"Simulated, {self.extent()}", style="bold")
        title.append("   means over the measured window; absorbed is negative", "dim not bold")
        style = {"title_justify": "left", "title_style": "", "header_style": "dim"}
        table = plain_table(
            *(f">{heading}" for heading in ("row\n", *(f"{a}\n{b}" for a, b in headings))),
            "limits reached…",
            title=title,
            padding=(0, 1, 0, 0),
            **style,
        )
        axis_laws = self.campaign.axis_laws.values()
        for row in rows:
            values = [value_text(axis_laws, each, row) for each in columns]
            if row["state"] == NOT_RUN:
                values += ["-"] * len(numbers)
            else:
                values += [format(row[name], digits) for name, digits in numbers.items()]
            table.add_row(str(row["row"]), *values, _remarks(row))
        console.print()
        console.print(whole_table(table), soft_wrap=True)
        if len(rows) < len(self.rows):
            console.print(f"and {len(self.rows) - len(rows)} more; --rows shows all", style="dim")
        show_equal_rows(self.equal_rows, every_row=every_row, console=console)


def _remarks(row: dict[str, Any]) -> str:
    """Return why a row was cut short, or the limits that it reached."""
    if row["incomplete_reason"]:
        return str(row["incomplete_reason"])
    warned = (f"{each}_WARN" for each in row["warned"].split())
    return " ".join([*row["limits"].split(), *warned, *row["flags"].split()])


def show_equal_rows(groups: tuple[EqualRows, ...], *, every_row: bool, console: Console) -> None:
    """Print why rows have one prediction, the first groups or all."""
    listed = groups if every_row else groups[:_MAX_EQUAL]
    for each in listed:
        console.print(Text(each.text(), style="yellow"), soft_wrap=True)
    if len(listed) < len(groups):
        console.print(f"and {len(groups) - len(listed)} more such groups; --rows shows all")


def simulate_rows(
    campaign: AnyCampaign,
    plan: AnyPlan,
    simulation: RowSimulation,
    row_type: type,
    contents: RowContents,
    equilibrium: EquilibriumCheck,
    max_seconds: float = math.inf,
    progress: Callable[[int], None] = lambda done: None,
) -> SimulatedRows:
    """Return the rows of a checked campaign up to ``max_seconds`` of its plan.

    ``row_type`` is that of the simulated log rows; ``progress`` is called with the number of
    finished rows.
    """
    rows = row_results(simulation, campaign, plan, contents, equilibrium, max_seconds, progress)
    motion = motion_fields(contents.axis)
    fields = {leaf.name: leaf.unit for leaf in leaves(row_type)}
    units = column_units(contents) | {
        f"{name}_{statistic}": fields[field]
        for name, field in motion.items()
        for statistic in ("mean", "rms", "peak")
    }
    return SimulatedRows(
        campaign,
        len(plan.rows),
        tuple(rows),
        simulation.reason,
        contents,
        units,
        simulation.seconds,
    )


def row_results(
    simulation: RowSimulation,
    campaign: AnyCampaign,
    planned: AnyPlan,
    contents: RowContents,
    equilibrium: EquilibriumCheck = lambda setting: None,
    max_seconds: float = math.inf,
    progress: Callable[[int], None] = lambda done: None,
) -> list[dict[str, Any]]:
    """Return the results of each row of a simulated plan, with the names of the row table.

    Besides, `end_stop` is the share of the window at an end stop of the plant, `flags` the `FLAGS`
    of the row. The first rows up to ``max_seconds`` of the plan are simulated; ``progress`` is
    called with their number.
    """
    period = repeat_period(campaign.file.sea)
    period_ticks = period / planned.dt if period else None
    actuators = [column.actuator.name for column in contents.columns if column.actuator]
    contents, rows = contents._replace(columns=()), planned.rows  # the plan has the set points
    results, compared = {}, _compared_rows(campaign, planned, contents, period_ticks)
    for window in simulation:  # the last attempt counts
        entry = reduce_window(window, period_ticks, contents)
        results[window.row] = (entry if compared is None else compared.complete(entry, window)) | {
            "end_stop": window.end_stop,
            "flags": " ".join(_flags(window, period_ticks, planned.dt, contents.axis)),
        }
        progress(len(results))
        if simulation.seconds >= max_seconds and len(results) < len(rows):
            rows = tuple(row for row in rows if row.row in results)
            break
    not_run = {"state": NOT_RUN, "incomplete_reason": f"run stopped: {simulation.reason}"}
    entries = []
    for row in rows:
        entry = results.get(row.row, not_run | {"row": row.row, "flags": ""})
        if equilibrium(row.setting) is not None:
            entry["flags"] = f"{NO_EQUILIBRIUM} {entry['flags']}".rstrip()
        entries.append(entry | dict.fromkeys(actuators, row.place) | row.setting._asdict())
    return entries


def _compared_rows(
    campaign: AnyCampaign, planned: AnyPlan, contents: RowContents, period_ticks: float | None
) -> ComparedRows | None:
    """Return what completes rows that end before the repeat period of an irregular sea."""
    end, sea = campaign.file.timing.end, campaign.file.sea
    if end is None or period_ticks is None or isinstance(sea, RegularSea):
        return None
    seeds = {row.row: row.seed for row in planned.rows}
    return ComparedRows(contents.stations, end.station, seeds, planned.dt, period_ticks)


def _flags(window: Window, period_ticks: float | None, dt: float, axis: str) -> Iterator[str]:
    """Yield the flags that follow from a window."""
    if window.end_stop > 0.0:
        yield END_STOP
    motion = motion_fields(axis)
    position, velocity = (window.data[motion[name]] for name in ("position", "velocity"))
    if period_ticks is not None and not is_settled(position, velocity, period_ticks, dt):
        yield NOT_SETTLED


def is_settled(position: Any, velocity: Any, period_ticks: float, dt: float) -> bool:
    """Return whether the motion in a window repeats from its first period to its last.

    Of one period, begin and end are compared. A window of less is taken as settled.
    """
    periods = int((len(position) + 0.5) / period_ticks)
    if periods == 0:
        return True
    shift = max(periods - 1, 1) * period_ticks
    ticks = min(round(shift), len(position) - 1)
    later = position[ticks:] + (shift - ticks) * dt * velocity[ticks:]
    change = later - position[: len(later)]
    bound = max(SETTLED * float(np.std(position)), _SMALL)
    return float(np.sqrt(np.mean(change * change))) <= bound
