"""Campaigns as the tasks of a sweep: cases of single rows, inputs and best rows of the result."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis.rows import (
    COMPLETE,
    column_units,
    columns_of,
    contents_attributes,
    stations_of,
)
from rig.campaign import (
    AnyCampaign,
    AnyPlan,
    CampaignKind,
    all_rows,
    build_plan,
    open_campaign,
    resolved_config,
)
from rig.campaign.equilibrium import EquilibriumCheck
from rig.campaign.law_checks import compilation_problems, run_trials
from rig.campaign.simulated_rows import NOT_SETTLED, row_results
from rig.config.problems import ConfigError, Problem, format_value
from rig.config.yaml_source import KeyPath
from rig.planning.input_files import InputFile, MappingLoader
from rig.planning.point import Point
from rig.planning.windows import repeat_period
from rig.presentation.phrases import format_power
from rig.row_contents import LAW, PANEL, Column, RowContents, X, Y
from rig.stations import find, station_names
from rig.sweeps.parameters import OPTION
from rig.sweeps.simulator import CampaignSimulator, problems, simulation_of
from rig.sweeps.task import ALL_ROWS, SimulatedCase, SweepParameter, TableContents, file_entries

if TYPE_CHECKING:
    import xarray

LEAD_IN = 15.0
"""Default time from the first wave to a row that runs alone, s, doubled until the row is settled.

Most simulated wave makers ramp the sea up in 5 s; the rest of the transient after 15 s changes no
mean power by more than a row's own noise (tests/batch/test_sweep_rows.py), while a basin needs
minutes."""
MAX_LEAD_IN = 240.0
"""Longest lead-in by doubling, s: more than twice the longest ramp of a simulated wave maker."""
_DATA_ROLES = ("matrix", "elevation", "reference")  # of files read whenever a campaign is opened
_NOT_COMPILED = "a sweep runs compiled code, but the law cannot be compiled"


class CampaignTask:
    """A campaign with one value of every parameter."""

    def __init__(self, campaign: AnyCampaign, lead_in: float | None) -> None:
        """``lead_in``: of rows that run alone, s; None: all rows run in sequence."""
        self.campaign, self.lead_in = all_rows(campaign), lead_in
        self.name, self.plant = str(campaign.file.name), campaign.plant
        self.validity_warnings = campaign.validity_warnings

    def plant_unit(self, path: KeyPath) -> str:
        """Return the unit of a plain number of the plant file; empty if it has none."""
        return simulation_of(self.campaign).plant_unit(self.campaign, path)

    @cached_property
    def plan(self) -> AnyPlan:
        """The plan of the whole campaign."""
        return build_plan(self.campaign)

    @cached_property
    def planned_rows(self) -> tuple[Any, ...]:
        """The rows of the plan, of which those that run alone are not repeated."""
        # A repetition would give the same numbers: the seed determines the noise.
        rows = self.plan.rows
        return rows if self.lead_in is None else tuple(r for r in rows if r.repetition == 0)

    @cached_property
    def numbers(self) -> dict[tuple[int, int], int]:
        """The number of each row of the plan by point and repetition."""
        return {(row.point, row.repetition): row.row for row in self.plan.rows}

    @cached_property
    def points(self) -> dict[int, int]:
        """The point of each row."""
        return {row.row: row.point for row in self.planned_rows}

    @property
    def rows(self) -> list[int]:
        """The numbers of the rows."""
        return [row.row for row in self.planned_rows]

    @property
    def case_rows(self) -> list[int]:
        """The rows that run alone, or all in sequence."""
        return [ALL_ROWS] if self.lead_in is None else self.rows

    @property
    def data(self) -> tuple[InputFile, ...]:
        """Recorded waves and motions, a matrix in CSV, and the data of the plant."""
        data = [file for file in self.campaign.files if file.role in _DATA_ROLES]
        return (*data, *simulation_of(self.campaign).plant_data(self.campaign))

    @property
    def inputs(self) -> list[tuple[str, str]]:
        """All files, and the laws of all axes."""
        plant_data = simulation_of(self.campaign).plant_data(self.campaign)
        files = [(file.role, file.sha256) for file in (*self.campaign.files, *plant_data)]
        laws = (each.law for each in self.campaign.axis_laws.values())
        return [*files, *((law.name, law.sha256) for law in laws)]

    @cached_property
    def simulator(self) -> CampaignSimulator:
        """The compiled loop with the plant, for all points of the campaign."""
        return simulation_of(self.campaign).open_simulator(self.campaign, self.plan)

    @property
    def contents(self) -> RowContents:
        """The contents of the rows' results."""
        return simulation_of(self.campaign).row_contents(self.campaign)

    def run(self, row: int, base: "CampaignTask", check: Callable[[], None]) -> SimulatedCase:
        """Return the results of a row of ``base``, or of all rows in sequence."""
        if self.lead_in is None:
            case = self._simulate(self.plan, None, check)
            numbers = [base.numbers[each.point, each.repetition] for each in self.plan.rows]
        else:
            case = self.run_point(self.campaign.points[base.points[row]], check)
            numbers = [row]
        rows = ({**each, "row": number} for each, number in zip(case.rows, numbers, strict=True))
        return case._replace(rows=tuple(rows))

    def run_point(self, point: Point, check: Callable[[], None]) -> SimulatedCase:
        """Return the results of a point as a row that runs alone."""
        assert self.lead_in is not None
        lead_in, seconds = self.lead_in, 0.0
        while True:
            planned = single_row_plan(self.campaign, lead_in, point)
            case = self._simulate(planned, planned.rows[0].place, check)
            (row,), seconds = case.rows, seconds + case.seconds
            # At an end stop or without equilibrium, more time changes nothing.
            can_settle = row["state"] == COMPLETE and row["flags"] == NOT_SETTLED
            if not can_settle or 2.0 * lead_in > MAX_LEAD_IN:
                return SimulatedCase(({**row, "lead_in": lead_in},), seconds)
            lead_in *= 2.0

    @cached_property
    def equilibrium(self) -> EquilibriumCheck:
        """The check whether a set point leaves the body an equilibrium."""
        return simulation_of(self.campaign).equilibrium_check(self.campaign)

    def _simulate(
        self, planned: AnyPlan, place: float | None, check: Callable[[], None]
    ) -> SimulatedCase:
        simulation = self.simulator.simulate(planned, check, place)
        rows = row_results(simulation, self.campaign, planned, self.contents, self.equilibrium)
        return SimulatedCase(tuple(rows), simulation.seconds)


class CampaignTasks:
    """Campaigns of a kind of rig, whose rows run alone or in sequence."""

    noun, result_noun = "campaign", "rows"
    fixed_keys: Mapping[str, str] = {
        "matrix": "the rows of a sweep are the campaign's own; change its matrix"
    }

    def __init__(self, kind: CampaignKind, *, sequential: bool, lead_in: float) -> None:
        self.kind, self.keys = kind, kind.swept_keys
        self._lead_in = None if sequential else lead_in

    def open(self, path: Path, load: MappingLoader) -> CampaignTask:
        """Return a campaign, checked with its simulated plant."""
        return CampaignTask(open_campaign(self.kind, path, problems, load=load), self._lead_in)

    def option_problems(self, given: Sequence[str]) -> list[Problem]:
        """Return a problem for two options that contradict each other."""
        if not {"--sequential", "--lead-in"} <= {*given}:
            return []
        message = "with --sequential the campaign's start.lead_in_s counts; leave it out"
        return [Problem("--lead-in", 1, "", None, message)]

    def check(self, task: CampaignTask, parameters: Sequence[SweepParameter]) -> None:
        """Raise `ConfigError` for a campaign without rows, times of a lead-in, or a law.

        The law fails its trial or cannot be compiled.
        """
        campaign = task.campaign
        if len(campaign.file.seeds) > 1:
            message = "a sweep varies it by --over seed=1,2,3; allowed one seed"
            raise ConfigError([campaign.locate.problem(("seed",), None, message)])
        if not_simulated := tuple(simulation_of(campaign).sweep_problems(campaign)):
            raise ConfigError(not_simulated)
        if self._lead_in is not None:
            for parameter in parameters:
                _check_start(parameter, self._lead_in)
        law_problems = list(run_trials(campaign, task.plan).problems)
        if not law_problems:
            law_problems += compilation_problems(campaign, task.plan.dt, _NOT_COMPILED)
        if law_problems:
            raise ConfigError(law_problems)

    def contents(self, task: CampaignTask) -> TableContents:
        """Return the campaign's settings, those of its rows, and the sea."""
        campaign, rows, contents = task.campaign, task.planned_rows, task.contents
        run = campaign if task.lead_in is None else single_row_campaign(campaign, task.lead_in)
        period = repeat_period(campaign.file.sea)
        attributes = {
            "sea": campaign.file.sea.description(),
            "sequential": int(task.lead_in is None),
            **contents_attributes(contents),
            "config": resolved_config(campaign),
            **({} if task.lead_in is None else {"lead_in_s": task.lead_in}),
            **({"wave_period_s": period} if period else {}),
        }
        return TableContents(
            file_entries(run.file, self.keys),
            {key: [getattr(row, key) for row in rows] for key in ("point", "repetition")},
            # The position of the device that realises a set point is not itself one.
            {
                column.name: [getattr(row.setting, column.name, row.place) for row in rows]
                for column in contents.settings
            },
            column_units(contents) | {"end_stop": "1", "lead_in": "s"},
            attributes,
        )

    def write_pictures(
        self, table: "xarray.Dataset", folder: Path, measured: Path | None
    ) -> list[Path]:
        """Write power surfaces, and power over the parameters."""
        from rig.sweeps.pictures import write_pictures  # noqa: PLC0415  (half a second to import)

        return write_pictures(table, folder, measured)

    def summary(self, table: "xarray.Dataset") -> dict[str, Any]:
        """Return the row with most power at each station."""
        names = station_names(stations_of(table))
        return {"best": {name: best for name in names if (best := _best_row(table, name))}}

    def summary_lines(self, summary: Mapping[str, Any], task: CampaignTask) -> list[str]:
        """Return a line for each station."""
        lines = ["Best rows (negative power is absorbed)"]
        for name, best in summary["best"].items():
            inputs = (f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
                      for key, value in best.items() if key != "power_w")  # fmt: skip
            label, power = find(task.contents.stations, name).label, format_power(best["power_w"])
            lines.append(f"  {label:<32} {power:>10}   {', '.join(inputs)}")
        return lines


def _check_start(parameter: SweepParameter, lead_in: float) -> None:
    """Raise `ConfigError` for a time of the start that rows which run alone cannot have."""
    value, message = None, ""
    longest = max((v for v in parameter.values if isinstance(v, int | float)), default=0.0)
    if parameter.key == "start.lead_in_s":
        message = "rows that run alone have --lead-in instead; allowed with --sequential"
    elif parameter.key == "start.set_point_s" and longest > lead_in:
        value = longest
        message = f"{format_value(longest)} is longer than the lead-in; allowed up to --lead-in"
    if message:
        raise ConfigError([Problem(OPTION, parameter.number, parameter.key, value, message)])


def _best_row(table: "xarray.Dataset", station: str) -> dict[str, Any]:
    """Return the row with the least power (negative is absorbed), with all its inputs."""
    name = f"power_{station}"
    if name not in table or not np.isfinite(table[name].values).any():
        return {}
    power = table[name].where((table["state"] == COMPLETE) & (table["flags"] == ""))
    if not np.isfinite(power.values).any():
        return {}
    place: Any = power.argmin(...)
    row: Any = table.isel(place)
    inputs = [
        *map(str, table.sizes),
        *(each.name for each in columns_of(table) if _is_gain(each, table, row)),
    ]
    values = {key: row[key].values.item() for key in inputs}
    return {"power_w": row[name].values.item(), **values}


def _is_gain(column: Column, table: "xarray.Dataset", row: Any) -> bool:
    """Return whether a column is a gain of a row: a main one, or one of the law that is in use."""
    if column.name not in row or column.role not in (PANEL, X, Y, LAW):
        return False
    return column.role != LAW or bool(table[column.name].values.any())


def single_row_campaign(campaign: AnyCampaign, lead_in: float) -> AnyCampaign:
    """Return a campaign that runs each point once, after a lead-in of ``lead_in`` s.

    A simulated sea has no reflections, so nothing ends the windows of its rows.
    """
    file = campaign.file
    update = {"lead_in_s": lead_in}
    if hasattr(file.start, "set_point_s"):
        update["set_point_s"] = min(file.start.set_point_s, lead_in)
    start = file.start.model_copy(update=update)
    return campaign._replace(
        file=file.model_copy(update={"start": start, "repeat": 1, "tank": None, "adaptive": None})
    )


def single_row_plan(campaign: AnyCampaign, lead_in: float, point: Point) -> AnyPlan:
    """Return the plan of a campaign of one point, after a lead-in of ``lead_in`` s."""
    return build_plan(single_row_campaign(campaign, lead_in)._replace(points=(point,)))
