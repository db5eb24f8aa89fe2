"""The duration to expect of a campaign whose rows end by their power.

The simulation of a check ends its rows by the rules of the loop, with the scatter of the simulated
plant and, in an irregular sea, of its waves. For a regular sea, a scatter from period to period may
be assumed instead: campaigns with the simulated powers are drawn, and the loop's rule ends each
row. Settling and moves stay those of the simulation.
"""

from typing import Any, NamedTuple

import numpy as np

from rig.campaign.assessed import assessment_params
from rig.campaign.kind import AnyCampaign, AnyPlan
from rig.campaign.simulated_rows import SimulatedRows
from rig.config.sea import RegularSea
from rig.presentation.phrases import format_duration
from rig.realtime import assessment
from rig.realtime.reasons import Reason

_DRAWS, _SEED = 100, 7  # campaigns


class ExpectedDuration(NamedTuple):
    """The duration of a campaign in the seas of all its seeds."""

    seconds: float  # mean
    scatter_w: float | None = None  # W, assumed; None: that of the simulated plant
    least: float = float("nan")  # s, of 95 % of the drawn campaigns
    most: float = float("nan")

    def text(self) -> str:
        """Return the duration and the scatter that it assumes."""
        shown = format_duration(round(self.seconds, 1))
        if self.scatter_w is None:
            return f"{shown}, as the simulated rows end, with the scatter of the simulated plant"
        low, high = (format_duration(round(each, 1)) for each in (self.least, self.most))
        return (
            f"{shown} ({low} to {high} in 95 % of drawn campaigns), for an assumed scatter of "
            f"{self.scatter_w:g} W from period to period"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the duration as JSON values."""
        found: dict[str, Any] = {"expected_duration_s": round(self.seconds, 3)}
        if self.scatter_w is not None:
            interval = [round(self.least, 3), round(self.most, 3)]
            found |= {"assumed_scatter_w": self.scatter_w, "expected_interval_s": interval}
        return found


def expected_duration(
    campaign: AnyCampaign,
    plan: AnyPlan,
    simulated: SimulatedRows | None,
    scatter_w: float | None = None,
) -> ExpectedDuration | None:
    """Return the duration to expect; None without all simulated rows, and if it is known anyway.

    ``scatter_w``: standard deviation of the mean power of a wave period, W. Raises ValueError if no
    campaigns can be drawn with it.
    """
    file = campaign.file
    is_known = plan.least_duration == plan.duration or file.adaptive is not None
    if scatter_w is not None:
        if is_known or file.timing.end is None or not isinstance(file.sea, RegularSea):
            raise ValueError(
                "--scatter is for rows in a regular sea that end by their power; leave it out"
            )
        if simulated is None:
            raise ValueError("--scatter needs the simulated rows: add --simulate")
    if is_known or simulated is None or simulated.reason != Reason.PLAN_END.name:
        return None
    if scatter_w is None:
        return ExpectedDuration(simulated.seconds)
    stations = campaign.kind.assessed_stations(campaign.rig)
    params = assessment_params(file, campaign.rig.rate_hz, stations)
    station = stations[params.station].name
    powers = [row[f"power_{station}"] for row in simulated.rows]
    random = np.random.default_rng(_SEED)
    drawn = [_periods(params, powers, scatter_w, random) for _ in range(_DRAWS)]
    more = np.array(drawn) - sum(row["periods"] for row in simulated.rows)
    seconds = simulated.seconds + more * params.period / campaign.rig.rate_hz
    low, high = np.quantile(seconds, [0.025, 0.975])
    return ExpectedDuration(float(seconds.mean()), scatter_w, float(low), float(high))


def _periods(
    params: assessment.Params, powers: list[float], scatter_w: float, random: np.random.Generator
) -> int:
    """Return the periods that the loop measures of all rows with these true powers (W)."""
    rows, total = assessment.NO_ROWS, 0
    for power in powers:
        scatter, count = assessment.NO_SCATTER, 0
        while count < params.most_periods:
            count += 1
            scatter = assessment.add_period(scatter, random.normal(power, scatter_w), count)
            if count >= params.least_periods and assessment.is_known(params, rows, scatter, count):
                break
        rows, total = assessment.after_row(rows, scatter, count), total + count
    return total
