"""How sure predictions are: what the estimates' uncertainties and measured rows make of them.

Each group of estimates is shifted by one standard deviation along each principal axis of its
covariance; the changes of a prediction add up in squares. Rows that were measured in the same sea
tell besides how far predictions are off as a whole.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design.recommend.search import STATIONS
from rig.design.recommend.trial import Bench, Gains, Tried
from rig.identification.periods import Floats
from rig.identification.twin.estimate import Twin

TIMES = 1.96  # standard deviations of a 95 % interval
STROKE = "stroke"
COLUMNS = (*STATIONS, STROKE)
LEAST = (
    0.15  # W, standard deviation: rig.design.predictions itself with a bus (docs/predictions.md)
)


class Compared(NamedTuple):
    """A measured row beside its prediction, W."""

    place: str
    gains: Gains
    measured: dict[str, float]
    predicted: dict[str, float]


def column(one: Tried, name: str) -> float:
    """A predicted power (W) or stroke (m)."""
    return one.foreseen.stroke if name == STROKE else one.power(name)


def half_widths(
    twin: Twin, quick: Bench, gains: Sequence[Gains], rows: Sequence[Compared]
) -> list[dict[str, float]]:
    """Half of the 95 % interval of each column of each set point; ``rows`` were measured."""
    base = quick.tried(gains)
    total: dict[str, Floats] = {name: np.zeros(len(base)) for name in COLUMNS}
    for group in twin.groups:
        for direction in group.directions():
            moved = Bench(quick.campaign, twin, direction, quick=True).tried(gains)
            for name in COLUMNS:
                pairs = zip(moved, base, strict=True)
                change = [column(one, name) - column(other, name) for one, other in pairs]
                total[name] += np.square(change)
    for name in STATIONS:
        total[name] += LEAST * LEAST + _off(rows, name)
    return [
        {name: TIMES * float(np.sqrt(total[name][i])) for name in COLUMNS} for i in range(len(base))
    ]


def _off(rows: Sequence[Compared], name: str) -> float:
    """Mean square by which predictions of measured rows are off, W^2."""
    if not rows:
        return 0.0
    return float(np.mean([(one.measured[name] - one.predicted[name]) ** 2 for one in rows]))


def compared(twin: Twin, bench: Bench) -> list[Compared]:
    """The twin's rows in the campaign's own sea beside what is predicted of them."""
    asked = bench.campaign_sea
    rows = [one for one in twin.records if one.sea == asked and not one.has_excitation]
    if not rows:
        return []
    gains = [Gains(*(one.setting[name] for name in Gains._fields)) for one in rows]
    return [
        Compared(
            row.place,
            one.gains,
            {"mechanical_1": row.column, "ac": row.ac, "dc": row.dc},
            {name: one.power(name) for name in STATIONS},
        )
        for row, one in zip(rows, bench.tried(gains), strict=True)
    ]
