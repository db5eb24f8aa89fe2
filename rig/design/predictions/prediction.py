"""What is predicted of a campaign."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.config.problems import Problem, format_key
from rig.design.predictions.margins import Margin, broken
from rig.design.predictions.row_prediction import RowPredictions
from rig.design.predictions.travel import Travel
from rig.planning.campaign import Campaign
from rig.planning.campaign.plan import CampaignRow, Plan


class RowPrediction(NamedTuple):
    """One row of the plan; row -1 is the lead-in's set point."""

    row: CampaignRow
    predicted: RowPredictions
    margins: tuple[Margin, ...]

    def broken(self) -> Iterator[Margin]:
        """The limits that refuse this row."""
        return broken(self.margins)


class Prediction(NamedTuple):
    """What is predicted of a campaign; a `rig.planning.campaign.check.Forecast`."""

    campaign: Campaign
    plan: Plan
    rows: tuple[RowPrediction, ...]  # in the order of the plan
    lead_in: RowPrediction | None  # None: as the first row
    refused: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    travel: tuple[Travel, ...]  # the plan as it is, then other orders

    def as_dict(self) -> dict[str, Any]:
        """For programs: numbers in SI, null where there is none."""
        return {
            "warnings": [problem.as_dict() for problem in self.warnings],
            "predictions": [_row(one) for one in self.rows],
            "lead_in_prediction": _row(self.lead_in) if self.lead_in is not None else None,
            "orders": [
                {
                    "order": one.order,
                    "spring_moves": one.moves,
                    "stator_travel_percent": one.way,
                    "stator_moving_s": one.moving,
                    "waiting_s": one.waiting,
                    "duration_s": one.duration,
                }
                for one in self.travel
            ],
        }


def _row(one: RowPrediction) -> dict[str, Any]:
    row = one.row
    found = one.predicted._asdict()
    return {
        "row": row.row,
        "point": row.point,
        "repetition": row.repetition,
        "stator_percent": row.stator_position,
        **row.setting._asdict(),
        **{name: _plain(value) for name, value in found.items()},
        "margins": [
            {
                "limit": margin.limit.name,
                "key": format_key(margin.limit.key),
                "effect": margin.limit.effect,
                "unit": margin.limit.unit,
                "predicted": _plain(margin.predicted),
                "allowed": _plain(margin.allowed),
                "used": _plain(margin.used),
                "broken": margin.broken,
            }
            for margin in one.margins
        ],
    }


def _plain(value: float | None) -> float | None:
    """A number that JSON knows; None for NaN and infinity."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
