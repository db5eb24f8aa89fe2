"""Prediction of a campaign as a result object and as JSON."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.campaign.equal_rows import EqualRows, find_equal_rows
from rig.config.problems import Problem, format_key
from rig.design.margin import Margin
from rig.kinds.wavebot.campaign import Campaign, CampaignRow, Plan
from rig.kinds.wavebot.predictions.travel import Travel
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.presentation.json_values import json_value


class RowPredictions(NamedTuple):
    """Predicted values of a row; peaks are magnitudes over the sea's repeat period."""

    position_peak: float  # m
    position_rms: float  # m
    stroke: float  # m, peak to peak
    velocity_peak: float  # m/s
    force_peak: float  # N, commanded
    force_rms: float  # N
    current_peak: float  # A, of the demand before the current limit
    current_rms: float  # A
    current_rms_peak: float  # A, peak of the limiter's moving rms
    power_mechanical_1: float  # W, absorbed is negative
    power_mechanical_2: float
    power_ac: float
    power_dc: float
    voltage_required: float  # V, peak of the motor voltage
    voltage_available: float | None  # V, bus voltage times modulation limit; None: not limited
    voltage_lowest: float  # V, of the DC bus
    voltage_highest: float
    dump_power: float | None  # W, mean into the dump resistors; None: no dump resistors
    surge_position_peak: float  # m
    surge_velocity_peak: float  # m/s
    surge_force_peak: float  # N, demanded
    surge_force_rms: float  # N
    surge_current_peak: float  # A
    surge_current_rms_peak: float  # A
    stiffness: float  # N/m, at rest
    spectral_radius: float  # of the sampled heave loop; stable below 1
    gain_margin: float  # 1, factor on its gains at which it becomes unstable
    decay_time: float  # s, time constant of its slowest mode
    surge_spectral_radius: float | None  # None: the surge drive is off
    surge_gain_margin: float | None
    converged: bool  # the last iteration changed the motion by less than 1 % of its rms


PREDICTED_STATIONS = tuple(s for s in STATIONS if f"power_{s.name}" in RowPredictions._fields)
"""The stations whose power is predicted."""

SHOWN_NUMBERS = {
    "position_peak": ".3f",
    "current_peak": ".1f",
    **{f"power_{s.name}": ".1f" for s in PREDICTED_STATIONS if not s.force},
}
"""The numbers that every table of rows shows, however narrow, and their format."""


class RowPrediction(NamedTuple):
    """One row of the plan; row -1 is the lead-in's set point."""

    row: CampaignRow
    predicted: RowPredictions
    margins: tuple[Margin, ...]

    def blocking(self) -> Iterator[Margin]:
        """Return the limits that refuse this row."""
        return (margin for margin in self.margins if margin.blocks)


class Prediction(NamedTuple):
    """Prediction of a campaign; a `rig.kinds.wavebot.campaign.check.CampaignPrediction`."""

    campaign: Campaign
    plan: Plan
    rows: tuple[RowPrediction, ...]  # in the order of the plan
    lead_in: RowPrediction | None  # None: same as the first row
    refused: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    travel: tuple[Travel, ...]  # the planned order, then alternatives

    @property
    def equal_rows(self) -> tuple[EqualRows, ...]:
        """The rows that print the same numbers although their set points differ."""
        rows = (
            {"row": one.row.row, **one.row.setting._asdict(), **one.predicted._asdict()}
            for one in self.rows
        )
        columns = row_contents(self.campaign.file.law_columns()).columns
        return find_equal_rows(rows, columns, RowPredictions._fields, SHOWN_NUMBERS)

    def as_dict(self) -> dict[str, Any]:
        """Return the prediction as JSON values in SI units; None for missing numbers."""
        return {
            "warnings": [problem.as_dict() for problem in self.warnings],
            "predictions": [_row_as_dict(one) for one in self.rows],
            "equal_rows": [each.as_dict() for each in self.equal_rows],
            "lead_in_prediction": _row_as_dict(self.lead_in) if self.lead_in is not None else None,
            "orders": [
                {
                    "order": one.order,
                    "spring_moves": one.moves,
                    "stator_travel_percent": one.distance,
                    "stator_moving_s": one.moving_time,
                    "waiting_s": one.waiting_time,
                    "duration_s": one.duration,
                }
                for one in self.travel
            ],
        }


def _row_as_dict(prediction: RowPrediction) -> dict[str, Any]:
    row = prediction.row
    return {
        "row": row.row,
        "point": row.point,
        "repetition": row.repetition,
        "stator_percent": row.place,
        **row.setting._asdict(),
        **json_value(prediction.predicted),
        "margins": [
            {
                "limit": margin.limit.name,
                "key": format_key(margin.limit.key),
                "effect": margin.limit.effect,
                "unit": margin.limit.unit,
                "predicted": json_value(margin.predicted),
                "allowed": json_value(margin.allowed),
                "used": json_value(margin.used),
                "broken": margin.exceeded,
            }
            for margin in prediction.margins
        ],
    }
