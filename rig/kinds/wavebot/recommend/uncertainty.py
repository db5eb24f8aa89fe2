"""Confidence intervals of predictions, from the uncertainty of the estimates and measured rows.

Each group of estimates is shifted by one standard deviation along each principal axis of its
covariance; the resulting changes of a prediction add in quadrature. The errors of rows measured in
the same sea are added.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.identification.periods import Floats
from rig.kinds.wavebot.recommend.search import STATIONS
from rig.kinds.wavebot.recommend.trial import Gains, SetPointPrediction, SetPointPredictor
from rig.kinds.wavebot.twin.estimate import Twin
from rig.stations import find, station_names

COVERAGE_FACTOR = 1.96  # standard deviations of a 95 % interval
STROKE = "stroke"
COLUMNS = (*station_names(STATIONS), STROKE)
MIN_DEVIATION = 0.15  # W, error of rig.kinds.wavebot.predictions with a bus (docs/predictions.md)


class RowComparison(NamedTuple):
    """Measured and predicted power of a row, W."""

    row_label: str
    gains: Gains
    measured: dict[str, float]
    predicted: dict[str, float]


def predicted_value(prediction: SetPointPrediction, name: str) -> float:
    """Return a predicted power (W) or stroke (m)."""
    return prediction.values.stroke if name == STROKE else prediction.power(find(STATIONS, name))


def half_widths(
    twin: Twin,
    quick_predictor: SetPointPredictor,
    gains: Sequence[Gains],
    rows: Sequence[RowComparison],
) -> list[dict[str, float]]:
    """Return half the 95 % interval of each column for each set point.

    ``rows`` are the measured rows whose prediction errors are included.
    """
    base = quick_predictor.predict(gains)
    total: dict[str, Floats] = {name: np.zeros(len(base)) for name in COLUMNS}
    for group in twin.groups:
        for direction in group.directions():
            shifted = SetPointPredictor(
                quick_predictor.campaign, twin, direction, quick=True
            ).predict(gains)
            for name in COLUMNS:
                pairs = zip(shifted, base, strict=True)
                change = [
                    predicted_value(one, name) - predicted_value(other, name)
                    for one, other in pairs
                ]
                total[name] += np.square(change)
    for name in station_names(STATIONS):
        total[name] += MIN_DEVIATION * MIN_DEVIATION + _mean_square_error(rows, name)
    return [
        {name: COVERAGE_FACTOR * float(np.sqrt(total[name][i])) for name in COLUMNS}
        for i in range(len(base))
    ]


def _mean_square_error(rows: Sequence[RowComparison], name: str) -> float:
    """Return the mean square prediction error of measured rows, W^2."""
    if not rows:
        return 0.0
    return float(
        np.mean(
            [(comparison.measured[name] - comparison.predicted[name]) ** 2 for comparison in rows]
        )
    )


def compare_rows(twin: Twin, predictor: SetPointPredictor) -> list[RowComparison]:
    """Return measured and predicted power of the twin's rows in the campaign's sea."""
    campaign_sea = predictor.campaign_sea
    rows = [one for one in twin.records if one.sea == campaign_sea and not one.has_excitation]
    if not rows:
        return []
    gains = [Gains(*(one.setting[name] for name in Gains._fields)) for one in rows]
    return [
        RowComparison(
            row.row_label,
            one.gains,
            {"mechanical_1": row.column, "ac": row.ac, "dc": row.dc},
            {station.name: one.power(station) for station in STATIONS},
        )
        for row, one in zip(rows, predictor.predict(gains), strict=True)
    ]
