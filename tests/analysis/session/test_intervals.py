"""Coverage of every kind of interval, on numbers whose truth is known."""

import numpy as np
import pytest
from scipy import stats

from rig.analysis.session import estimate, linear_fit

SEEDS = 2000
NEAR = 3.0 * np.sqrt(0.95 * 0.05 / SEEDS)  # three standard deviations of the share itself


def test_the_mean_of_few_is_covered() -> None:
    random = np.random.default_rng(1)
    held = [estimate.mean(random.normal(3.0, 0.2, 6), "m", "").holds(3.0) for _ in range(SEEDS)]
    assert np.mean(held) == pytest.approx(0.95, abs=NEAR)


def test_line_and_band_are_covered() -> None:
    random = np.random.default_rng(2)
    x = np.linspace(10.0, 80.0, 15)
    held = []
    for _ in range(SEEDS):
        fitted = linear_fit.line(x, 0.5 + 0.02 * x + random.normal(0.0, 0.1, 15))
        held.append(
            (
                linear_fit.slope(fitted, "", "").holds(0.02),
                linear_fit.intercept(fitted, "", "").holds(0.5),
                abs(linear_fit.at(fitted, 70.0) - 1.9) <= linear_fit.band(fitted, 70.0),
            )
        )
    assert np.mean(held, axis=0) == pytest.approx([0.95] * 3, abs=NEAR)


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    values = np.random.default_rng(3).normal(size=12)
    left = np.array([[np.delete(values, i).mean()] for i in range(12)])
    by_hand = stats.t.ppf(0.975, 11) * values.std(ddof=1) / np.sqrt(12)
    assert estimate.jackknife(np.array([values.mean()]), left)[0] == pytest.approx(by_hand)


def test_a_line_agrees_with_scipy() -> None:
    random = np.random.default_rng(4)
    x = random.normal(size=20)
    y = 2.0 - 3.0 * x + random.normal(size=20)
    theirs = stats.linregress(x, y)
    ours = linear_fit.line(x, y)
    assert (ours.slope, ours.intercept) == pytest.approx((theirs.slope, theirs.intercept))
    assert ours.r_squared == pytest.approx(theirs.rvalue**2)
    half = stats.t.ppf(0.975, 18) * theirs.stderr
    assert linear_fit.slope(ours, "", "").uncertainty == pytest.approx(half)


def test_what_has_no_interval_says_so() -> None:
    assert np.isnan(estimate.mean([1.0], "m", "").uncertainty)
    assert not estimate.mean([1.0], "m", "").holds(1.0)
    assert np.isnan(estimate.mean([], "m", "").value)
    with pytest.raises(ValueError, match="no line"):
        linear_fit.line([1.0, 1.0], [2.0, 3.0])
