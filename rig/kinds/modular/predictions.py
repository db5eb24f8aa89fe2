"""Prediction of a campaign by simulation: its plan in the compiled loop, as a rehearsal runs it.

Limits, ramps and transients are those of the loop, so a row that would trip is found. It needs a
compiled loop, which `rig check` does not wait for: `rig compile` or a sweep compile it, once on a
host.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.analysis.rows import NOT_RUN, reduce_window
from rig.campaign import AnyCampaign, AnyPlan
from rig.config.problems import Problem
from rig.kinds.modular.simulation import open_simulator, row_contents
from rig.planning.windows import repeat_period
from rig.presentation.json_values import json_value
from rig.realtime.reasons import Reason

MAX_SECONDS = 7200.0  # of a plan, some ten seconds of work
NOT_COMPILED = "the loop of this rig is not compiled on this host yet; rig compile does it"


class SimulatedRows(NamedTuple):
    """The rows of a campaign, simulated in sequence; a `rig.campaign.check.CampaignPrediction`."""

    campaign: AnyCampaign
    plan: AnyPlan
    rows: tuple[dict[str, Any], ...]  # as in the row table, in the order of the plan
    warnings: tuple[Problem, ...]
    refused: tuple[Problem, ...] = ()  # a simulated trip does not forbid to run

    def as_dict(self) -> dict[str, Any]:
        """Return the rows as JSON values in SI units; None for missing numbers."""
        return {"simulated": [json_value(row) for row in self.rows]}


def simulate(campaign: AnyCampaign, plan: AnyPlan) -> tuple[SimulatedRows | None, str]:
    """Return the simulated rows of a checked campaign, or None and why there are none."""
    if plan.duration > MAX_SECONDS:
        text = f"it lasts {plan.duration:.0f} s, simulated are up to {MAX_SECONDS:.0f} s"
        return None, f"{text}; rig sweep simulates its rows"
    try:
        loop = open_simulator(campaign, plan)
        if not loop.is_compiled():
            return None, NOT_COMPILED
    except (ValueError, ArithmeticError) as error:
        return None, f"the rig cannot be simulated: {error}"
    windows, period = loop.simulate(plan), repeat_period(campaign.file.sea)
    ticks, contents = period / plan.dt if period else None, row_contents(campaign)
    contents = contents._replace(columns=())  # the plan has the set points
    found = {window.row: reduce_window(window, ticks, contents) for window in windows}
    stopped = f"run stopped: {windows.reason}"
    rows = tuple(
        {"row": row.row, **found.get(row.row, {"state": NOT_RUN, "incomplete_reason": stopped})}
        | row.setting._asdict()
        for row in plan.rows
    )
    return SimulatedRows(campaign, plan, rows, tuple(_trip(campaign, rows, windows.reason))), ""


def _trip(
    campaign: AnyCampaign, rows: tuple[dict[str, Any], ...], reason: str
) -> Iterator[Problem]:
    """Yield a warning if the simulated plan stops before its end."""
    if reason == Reason.PLAN_END.name:
        return
    row = next((row["row"] for row in rows if row["incomplete_reason"]), len(rows) - 1)
    message = f"simulated, the run stops with {reason} in row {row} or before it"
    yield campaign.locate.problem(("matrix",), None, message)
