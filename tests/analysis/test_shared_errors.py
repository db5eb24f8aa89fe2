"""Errors of a budget that all rows of a run share: in points, differences of points, and effects.

The truth is drawn: runs whose sensors have one hidden error each, and rows whose periods scatter.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
import xarray
from synthetic_runs import COLUMNS

from rig.analysis.effects import compute_effects, effect_notes
from rig.analysis.intervals import combined_half_width, half_width
from rig.analysis.points import Point, error_note, gain_matrix
from rig.analysis.ranking import difference, not_worse
from rig.analysis.slices import find_optima
from rig.analysis.uncertainty import BUDGET_ATTRIBUTE
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.row_contents import column_records
from rig.stations import as_records

RUNS = 800
ATTRIBUTES = {
    "stations": json.dumps(as_records(STATIONS[-1:])),
    "columns": json.dumps(column_records([each for each in COLUMNS if each.name in ("kp", "ki")])),
}
PERIODS = 7
SCATTER = 0.2  # W, of the mean of a row
SCALE, OFFSET = 0.03, 0.5  # standard uncertainties: relative, and W
DISTRIBUTIONS = ("normal", "rectangular")
KP = np.array([-3000.0, -2000.0, -2000.0, -1000.0, -1000.0, 0.0])
TRUE = np.array([-40.0, -45.0, -45.0, -44.4, -44.4, -30.0])  # W


def table(random: np.random.Generator) -> xarray.Dataset:
    """Return the row table of a run: its sensors have errors, which it does not know."""
    scale, zero = random.standard_normal(), random.uniform(-math.sqrt(3.0), math.sqrt(3.0))
    power = TRUE * (1.0 + SCALE * scale) + OFFSET * zero
    errors = SCATTER * np.sqrt(random.chisquare(PERIODS - 1, len(TRUE)) / (PERIODS - 1))
    power = power + SCATTER * random.standard_normal(len(TRUE))
    shares = np.column_stack([SCALE * power, np.full(len(TRUE), OFFSET)])
    variables = {
        "row": np.arange(len(TRUE)), "kp": KP, "ki": 0.0 * KP, "state": ["complete"] * len(TRUE),
        "power_dc": power, "power_dc_se": errors, "power_dc_dof": np.full(len(TRUE), PERIODS - 1.0),
        "periods": np.full(len(TRUE), PERIODS),
    }  # fmt: skip
    return xarray.Dataset(
        {name: ("row", values) for name, values in variables.items()}
        | {"power_dc_contributions": (("row", "source"), shares)},
        attrs={
            **ATTRIBUTES,
            BUDGET_ATTRIBUTE: f'{{"distributions": ["{DISTRIBUTIONS[0]}", "{DISTRIBUTIONS[1]}"]}}',
        },
    )


def point(power: float, contributions: Any, error: float = SCATTER, **fields: Any) -> Point:
    return Point(
        {"kp": power}, {"dc": power}, {"dc": error}, (0,), dof={"dc": 6.0},
        type_b={"dc": np.atleast_2d(contributions)}, distributions=DISTRIBUTIONS, **fields,
    )  # fmt: skip


def test_differences_of_points_cover_the_true_ones() -> None:
    """Independent errors of 1.4 W a row would make the interval five times as wide."""
    inside, halves = [], []
    for run in range(RUNS):
        one, other = (
            next(p for p in gain_matrix(table(np.random.default_rng([run, 3]))).points
                 if p.setting["kp"] == kp)
            for kp in (-3000.0, 0.0)
        )  # fmt: skip
        watts, half = difference(other, one, "dc")
        inside.append(abs(watts - 10.0) <= half)
        halves.append(half)
    assert 100.0 * np.mean(inside) == pytest.approx(95.0, abs=2.0)
    expected = math.hypot(math.sqrt(2.0) * SCATTER, SCALE * 10.0)  # the offset cancels
    assert np.mean(halves) == pytest.approx(1.96 * expected, rel=0.06)


def test_intervals_of_points_cover_the_true_powers() -> None:
    """Repetitions average the scatter only: two rows are hardly better than one."""
    single, repeated = [], []
    for run in range(RUNS):
        points = gain_matrix(table(np.random.default_rng([run, 4]))).points
        for each in points:
            true = TRUE[each.setting["kp"] == KP][0]
            found = abs(each.power["dc"] - true) <= each.expanded("dc")
            (repeated if len(each.rows) > 1 else single).append(found)
    assert 100.0 * np.mean(single) == pytest.approx(95.0, abs=2.0)
    assert np.mean(repeated) > 0.93  # one degree of freedom: wide, if the scatter is large


def test_effects_cover_the_true_ones() -> None:
    """A line through points on no line: its true slope is that of the true powers."""
    true = np.polyfit(KP, TRUE, 1)[0] * np.ptp(KP)
    inside, without = [], []
    for run in range(RUNS):
        one = table(np.random.default_rng([run, 5]))
        (effect,) = compute_effects(one, "dc").effects
        assert effect.type_b == pytest.approx(SCALE * abs(effect.watts), rel=1e-9)
        inside.append(abs(effect.watts - true) <= effect.half_width)
        del one["power_dc_contributions"]
        (plain,) = compute_effects(one, "dc").effects
        without.append(abs(plain.watts - true) <= plain.half_width)
        assert plain.standard_error == effect.standard_error
    assert 100.0 * np.mean(inside) == pytest.approx(95.0, abs=2.0)
    assert np.mean(without) < 0.93


def test_equal_contributions_cancel() -> None:
    one, other = point(-50.0, [1.0, 2.0]), point(-49.0, [1.0, 2.0])
    watts, half = difference(other, one, "dc")
    assert (watts, half) == (1.0, half_width(math.sqrt(2.0) * SCATTER, 12.0))
    assert not_worse([one, other], one, "dc") == ()
    opposite = point(-49.0, [-1.0, -2.0])
    assert difference(opposite, one, "dc")[1] > 1.6 * math.hypot(2.0, 4.0)
    assert not_worse([one, opposite], one, "dc") == (opposite,)


def test_seas_that_both_points_have_count_for_the_difference() -> None:
    seas = {1: {"dc": -50.0}, 2: {"dc": -52.0}, 3: {"dc": -90.0}}
    one = point(-64.0, [[1.0, 0.0], [3.0, 0.0], [70.0, 0.0]], by_seed=seas)
    other = point(-50.0, [[0.0, 0.0], [2.0, 0.0]], by_seed={1: {"dc": -49.0}, 2: {"dc": -51.0}})
    assert one.contributions("dc").tolist() == pytest.approx([74.0 / 3.0, 0.0])
    watts, half = difference(other, one, "dc")
    assert watts == 1.0  # in both seas, with a Type B of 1 W in both
    assert half == pytest.approx(1.96, rel=0.02)


def test_the_interval_of_repetitions_keeps_type_b() -> None:
    random = np.random.default_rng(8)
    points = gain_matrix(table(random)).points
    found = next(each for each in points if each.setting["kp"] == -2000.0)
    c = found.contributions("dc")
    assert found.expanded("dc") > 1.9 * math.hypot(*c) > 1.9 * SCALE * 40.0
    assert found.expanded("dc") == combined_half_width(
        found.error["dc"], 1.0, c, DISTRIBUTIONS
    )  # fmt: skip


def test_texts_name_what_is_after_the_sign() -> None:
    one = table(np.random.default_rng(1))
    (best,) = find_optima(one)
    assert best.caption == f"{best.power_text} (95 %)"
    assert float(best.power_text.split("±")[1].removesuffix(" W")) > 1.9 * SCALE * 40.0
    assert error_note(gain_matrix(one).points).startswith("± 95 % by scatter of")
    assert effect_notes(compute_effects(one, "dc"))[0].endswith("and Type B")
    del one["power_dc_contributions"]
    (best,) = find_optima(one)
    assert best.caption == best.power_text
    assert error_note(gain_matrix(one).points).startswith("± standard error by scatter of")


def test_an_unknown_scatter_gives_no_interval() -> None:
    assert math.isnan(point(-50.0, [1.0, 1.0], math.nan).expanded("dc"))
