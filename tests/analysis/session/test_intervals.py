"""Coverage of every kind of interval, on numbers with known truth."""

import numpy as np
import pytest
from scipy import stats

from rig.kinds.oswec_bench.products import estimate

SEEDS = 2000
TOLERANCE = 3.0 * np.sqrt(0.95 * 0.05 / SEEDS)  # three standard deviations of the share itself


def test_the_interval_of_a_small_sample_mean_covers_the_truth() -> None:
    random = np.random.default_rng(1)
    covered = [estimate.mean(random.normal(3.0, 0.2, 6), "m", "").covers(3.0) for _ in range(SEEDS)]
    assert np.mean(covered) == pytest.approx(0.95, abs=TOLERANCE)


def test_the_intervals_of_line_and_band_cover_the_truth() -> None:
    random = np.random.default_rng(2)
    x = np.linspace(10.0, 80.0, 15)
    covered = []
    for _ in range(SEEDS):
        line = estimate.fit_line(x, 0.5 + 0.02 * x + random.normal(0.0, 0.1, 15))
        covered.append(
            (
                line.slope_estimate().covers(0.02),
                line.intercept_estimate().covers(0.5),
                abs(line.at(70.0) - 1.9) <= line.band(70.0),
            )
        )
    assert np.mean(covered, axis=0) == pytest.approx([0.95] * 3, abs=TOLERANCE)


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    values = np.random.default_rng(3).normal(size=12)
    left = np.array([[np.delete(values, i).mean()] for i in range(12)])
    by_hand = stats.t.ppf(0.975, 11) * values.std(ddof=1) / np.sqrt(12)
    (mean,) = estimate.jackknifed([values.mean()], left, [""], "")
    assert mean.uncertainty == pytest.approx(by_hand)


def test_the_line_fit_agrees_with_scipy() -> None:
    random = np.random.default_rng(4)
    x = random.normal(size=20)
    y = 2.0 - 3.0 * x + random.normal(size=20)
    scipy_line = stats.linregress(x, y)
    line = estimate.fit_line(x, y)
    assert (line.slope, line.intercept) == pytest.approx((scipy_line.slope, scipy_line.intercept))
    assert line.r_squared == pytest.approx(scipy_line.rvalue**2)
    half = stats.t.ppf(0.975, 18) * scipy_line.stderr
    assert line.slope_estimate().uncertainty == pytest.approx(half)


def test_estimates_without_an_interval_are_nan() -> None:
    assert np.isnan(estimate.mean([1.0], "m", "").uncertainty)
    assert not estimate.mean([1.0], "m", "").covers(1.0)
    assert np.isnan(estimate.mean([], "m", "").value)
    with pytest.raises(ValueError, match="no line"):
        estimate.fit_line([1.0, 1.0], [2.0, 3.0])
