"""The cases of a sweep and their outcomes.

A case is a row of the campaign with one value of every parameter: power on, tare, a lead-in of its
own, then the row. Cases are independent, so they may run in any order and anywhere. In a sequential
sweep, a case is the whole campaign with one value of every parameter, row after row as in the
basin.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from threading import Lock
from typing import Any, NamedTuple

from rig.analysis.rows import NOT_RUN, reduce_window
from rig.campaign import AnyCampaign, AnyPlan, CampaignRow, build_plan
from rig.planning.point import Point
from rig.planning.windows import repeat_period
from rig.row_contents import RowContents
from rig.sweep import InterruptedSweepError
from rig.sweep.parameters import CampaignFiles, ParameterValues, SweepParameter
from rig.sweep.simulator import CampaignSimulator, RowSimulation, simulation_of

_OPEN_VARIANTS = 4  # variants with tables in memory at a time
LEAD_IN = 15.0
"""Default time from the first wave to a row that runs alone, s. The simulated wave maker ramps the
sea up in 5 s; the rest of the transient after 15 s changes no mean power by more than a row's own
noise (tests/batch/test_sweep_rows.py), while a basin needs minutes."""


class Case(NamedTuple):
    """One run of the compiled loop."""

    number: int  # from 0, rows changing fastest
    variant: int  # number of the combination of values
    row: int  # of the campaign's plan; -1: all rows in sequence


class Outcome(NamedTuple):
    """The result of a case."""

    case: int
    rows: tuple[dict[str, Any], ...]  # from `rig.analysis.rows.reduce_window`
    seconds: float  # simulated
    failed: str  # reason of a failure; empty on success


class SweepRequest(NamedTuple):
    """A sweep as plain values, which can be sent to other processes."""

    campaign: str  # path
    parameters: tuple[SweepParameter, ...]
    sequential: bool
    lead_in: float  # s


class _Variant(NamedTuple):
    campaign: AnyCampaign
    plan: AnyPlan  # of the whole campaign
    simulator: CampaignSimulator
    period_ticks: float | None


class Cases:
    """The cases of a sweep; several threads may run them."""

    def __init__(
        self, request: SweepRequest, rows: tuple[CampaignRow[Any], ...], files: CampaignFiles
    ) -> None:
        """Number the cases by ``rows``, those of the campaign without parameter values."""
        self.request = request
        self.shape = tuple(len(parameter.values) for parameter in request.parameters)
        # A repetition would give the same numbers: the seed determines the noise.
        once = tuple(row for row in rows if row.repetition == 0)
        self.rows = rows if request.sequential else once
        self._files = files
        self._row_numbers = {(row.point, row.repetition): row.row for row in rows}
        self._points = {row.row: row.point for row in rows}
        self._opening = Lock()
        self._variant = lru_cache(_OPEN_VARIANTS)(self._open)

    def __len__(self) -> int:
        return math.prod(self.shape) * (1 if self.request.sequential else len(self.rows))

    def __iter__(self) -> Iterator[Case]:
        rows = [-1] if self.request.sequential else [row.row for row in self.rows]
        pairs = itertools.product(range(math.prod(self.shape)), rows)
        return (Case(number, variant, row) for number, (variant, row) in enumerate(pairs))

    def parameter_values(self, variant: int) -> ParameterValues:
        """Return the values of a combination; those of the last parameter change fastest."""
        products = itertools.product(*(each.values for each in self.request.parameters))
        values = next(itertools.islice(products, variant, None))
        return tuple(zip(self.request.parameters, values, strict=True))

    def simulator(self) -> CampaignSimulator:
        """Return the simulator of the first combination of values."""
        with self._opening:
            return self._variant(0).simulator

    def run(self, case: Case, should_continue: Callable[[], bool] = lambda: True) -> Outcome:
        """Run a case; a failed outcome has the reason. Raises `InterruptedSweepError`."""
        try:
            return self._run_case(case, should_continue)
        except InterruptedSweepError:
            raise
        except Exception as error:  # noqa: BLE001  the other cases still run
            return Outcome(case.number, (), 0.0, str(error) or type(error).__name__)

    def _run_case(self, case: Case, should_continue: Callable[[], bool]) -> Outcome:
        with self._opening:  # two threads must not open the same variant
            variant = self._variant(case.variant)
        campaign = variant.campaign
        if self.request.sequential:
            planned, place = variant.plan, None
        else:
            point = campaign.points[self._points[case.row]]
            planned = single_row_plan(campaign, self.request.lead_in, point)
            place = planned.rows[0].place

        def check() -> None:
            if not should_continue():
                raise InterruptedSweepError

        simulation = variant.simulator.simulate(planned, check, place)
        contents = simulation_of(campaign).row_contents(campaign)
        results = row_results(simulation, planned, variant.period_ticks, contents)
        rows = []
        for row, result in zip(planned.rows, results, strict=True):
            number = case.row if case.row >= 0 else self._row_numbers[row.point, row.repetition]
            rows.append({**result, "row": number})
        return Outcome(case.number, tuple(rows), simulation.seconds, "")

    def _open(self, variant: int) -> _Variant:
        campaign = self._files.open(self.parameter_values(variant))
        planned = build_plan(campaign)
        period = repeat_period(campaign.file.sea)
        ticks = period / planned.dt if period else None
        simulator = simulation_of(campaign).open_simulator(campaign, planned)
        return _Variant(campaign, planned, simulator, ticks)


def row_results(
    simulation: RowSimulation,
    planned: AnyPlan,
    period_ticks: float | None,
    contents: RowContents,
) -> list[dict[str, Any]]:
    """Return the results of each row of a simulated plan, with the names of the row table.

    ``period_ticks`` is the sea's repeat period in ticks, None if it has none.
    """
    actuators = [column.actuator.name for column in contents.columns if column.actuator]
    contents = contents._replace(columns=())  # the plan has the set points
    results = {}
    for window in simulation:  # the last attempt counts
        results[window.row] = reduce_window(window, period_ticks, contents)
    not_run = {"state": NOT_RUN, "incomplete_reason": f"run stopped: {simulation.reason}"}
    return [
        results.get(row.row, not_run) | dict.fromkeys(actuators, row.place) | row.setting._asdict()
        for row in planned.rows
    ]


def single_row_campaign(campaign: AnyCampaign, lead_in: float) -> AnyCampaign:
    """Return a campaign that runs each point once, after a lead-in of ``lead_in`` s."""
    file = campaign.file
    update = {"lead_in_s": lead_in}
    if hasattr(file.start, "set_point_s"):
        update["set_point_s"] = min(file.start.set_point_s, lead_in)
    start = file.start.model_copy(update=update)
    return campaign._replace(file=file.model_copy(update={"start": start, "repeat": 1}))


def single_row_plan(campaign: AnyCampaign, lead_in: float, point: Point) -> AnyPlan:
    """Return the plan of a campaign of one point, after a lead-in of ``lead_in`` s."""
    return build_plan(single_row_campaign(campaign, lead_in)._replace(points=(point,)))
