"""Points that cannot be distinguished: against the tests of scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from rig.analysis.points import Point, _point
from rig.analysis.ranking import difference, not_worse

DRAWS = np.random.default_rng(20_261_126)


def of_periods(values: np.ndarray, row: int = 0) -> Point:
    """A point of one row, with the means of its periods."""
    error = float(np.std(values, ddof=1) / math.sqrt(len(values)))
    return Point({"kp": float(row)}, {"ac": float(values.mean())}, {"ac": error}, (row,),
                 dof={"ac": len(values) - 1.0})  # fmt: skip


def of_seeds(values: np.ndarray, row: int = 0) -> Point:
    """A point with a mean for each seed."""
    by_seed = {seed: {"ac": float(value)} for seed, value in enumerate(values, 1)}
    return of_periods(values, row)._replace(by_seed=by_seed)


@pytest.mark.parametrize("count", [2, 4, 9])
def test_the_interval_of_two_points_is_that_of_welch(count: int) -> None:
    one, other = DRAWS.normal(-50.0, 3.0, count), DRAWS.normal(-48.0, 1.0, count + 2)
    interval = stats.ttest_ind(other, one, equal_var=False).confidence_interval(0.95)
    watts, half = difference(of_periods(other), of_periods(one), "ac")
    assert (watts - half, watts + half) == pytest.approx((interval.low, interval.high), rel=1e-9)


@pytest.mark.parametrize("seeds", [2, 3, 8])
def test_points_in_the_same_seas_are_compared_sea_by_sea(seeds: int) -> None:
    seas = DRAWS.normal(0.0, 10.0, seeds)  # much more than between the points
    one = -50.0 + seas + DRAWS.normal(0.0, 0.3, seeds)
    other = -48.0 + seas + DRAWS.normal(0.0, 0.3, seeds)
    interval = stats.ttest_rel(other, one).confidence_interval(0.95)
    watts, half = difference(of_seeds(other), of_seeds(one), "ac")
    assert (watts - half, watts + half) == pytest.approx((interval.low, interval.high), rel=1e-9)


def test_those_within_the_interval_are_alike() -> None:
    best = of_periods(np.array([-50.0, -51.0, -49.0, -50.0]), 0)
    near = of_periods(np.array([-49.5, -50.5, -48.5, -49.5]), 1)
    far = of_periods(np.array([-30.0, -31.0, -29.0, -30.0]), 2)
    assert not_worse([best, far, near], best, "ac") == (near,)
    assert not_worse([best, far], best, "ac") == ()
    one_period = best._replace(error={"ac": math.nan}, dof={"ac": 0.0})
    assert not_worse([best, far, one_period], best, "ac") is None


def test_the_best_of_equal_points_is_excluded_as_often_as_stated() -> None:
    """Of two points of equal power the other one is taken for worse in at most 5 % of the cases.

    Half of it, because the best is chosen by the data, on either side: 2 x 2.5 %. 1000 draws leave
    a standard deviation of 0.7 %.
    """
    excluded = 0
    for _ in range(1000):
        points = [of_periods(DRAWS.normal(-50.0, 2.0, 6), row) for row in range(2)]
        best = min(points, key=lambda point: point.power["ac"])
        excluded += not_worse(points, best, "ac") == ()
    assert 0.028 < excluded / 1000 < 0.072


def of_windows(values: list[float], errors: list[float], row: int = 0) -> Point:
    """A point with a row in each of several seas; an error of 0 is a whole repeat period."""
    columns = {
        "batches": np.array([0 if error == 0.0 else 8 for error in errors]),
        "seed": np.arange(1, len(values) + 1),
        "row": np.arange(len(values)) + 10 * row,
        "power_ac": np.array(values),
        "power_ac_se": np.array([math.nan if error == 0.0 else error for error in errors]),
        "power_ac_dof": np.full(len(values), 6.0),
    }
    rows = list(range(len(values)))
    return _point({"kp": float(row)}, columns, rows, ["ac"], math.nan)


def test_two_seas_that_agree_by_chance_are_no_better_known_than_their_windows() -> None:
    point = of_windows([-8.97, -8.95], [0.10, 0.30])
    assert point.error["ac"] == pytest.approx(math.hypot(0.10, 0.30) / 2)
    # Welch and Satterthwaite: (a + b)^2 / (a^2 / 6 + b^2 / 6) with the variances a and b
    assert point.dof["ac"] == pytest.approx(6.0 * (0.01 + 0.09) ** 2 / (0.01**2 + 0.09**2))
    whole = of_windows([-8.97, -8.95], [0.0, 0.0], 1)
    assert point.error["ac"] > 5 * whole.error["ac"] == pytest.approx(5 * 0.01)
    assert difference(point, whole, "ac")[1] > difference(whole, whole, "ac")[1] == 0.0


def test_the_interval_of_seas_with_short_windows_contains_the_mean() -> None:
    """Of 2000 points of two seas, at least 95 % have their mean in the interval."""
    inside = 0
    for _ in range(2000):
        values = DRAWS.normal(-8.0, 0.05, 2) + DRAWS.normal(0.0, 0.3, 2)
        errors = 0.3 * np.sqrt(DRAWS.chisquare(6, 2) / 6)
        inside += abs(of_windows(list(values), list(errors)).power["ac"] + 8.0) <= of_windows(
            list(values), list(errors)
        ).expanded("ac")
    assert inside >= 0.94 * 2000  # three deviations below 95 %


def test_a_row_is_judged_against_its_reference_by_the_error_of_their_difference() -> None:
    reference = of_periods(np.array([-50.0, -50.0]))._replace(
        error={"ac": math.nan}, dof={"ac": math.nan}, is_reference=True
    )
    row = of_periods(np.array([-49.0, -48.0, -50.0, -49.0]), 1)._replace(is_compared=True)
    watts, half = difference(row, reference, "ac")
    assert watts == pytest.approx(1.0)
    assert half == pytest.approx(stats.t.ppf(0.975, 3) * row.error["ac"])
    assert math.isnan(difference(reference, reference, "ac")[1])  # two whole periods: unknown
