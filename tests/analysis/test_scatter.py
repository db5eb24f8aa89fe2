"""Type A uncertainty of means of successive periods: closed forms, coverage of intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from rig.analysis.scatter import standard_error, successive_error

TRIALS = 3000


def drawn(periods: int, correlation: float) -> np.ndarray:
    """Return processes of first order with unit deviation, one a line."""
    random = np.random.default_rng([periods, round(10.0 * correlation)])
    white = random.standard_normal((TRIALS, periods))
    white[:, 1:] *= math.sqrt(1.0 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], white, axis=1)


def covered(periods: int, correlation: float) -> tuple[float, float]:
    """Return the share (%) of 95 % intervals with the true mean, with and without correlation."""
    means = drawn(periods, correlation)
    found = [successive_error(each) for each in means]
    half = [stats.t.ppf(0.975, each.dof) * each.error for each in found]
    plain = stats.t.ppf(0.975, periods - 1) * means.std(axis=1, ddof=1) / math.sqrt(periods)
    distance = np.abs(means.mean(axis=1))
    return tuple(100.0 * float(np.mean(distance <= each)) for each in (half, plain))


@pytest.mark.parametrize(
    ("periods", "correlation", "least", "most"),
    [
        (8, 0.0, 93.8, 96.2), (20, 0.0, 93.8, 96.5), (60, 0.0, 93.8, 96.5),
        # Few periods do not show their correlation: the interval is better than without, not right.
        (8, 0.3, 86.5, 90.0), (8, 0.6, 74.0, 79.0),
        (20, 0.3, 88.0, 92.0), (20, 0.6, 87.0, 91.0),
        (60, 0.3, 91.0, 95.0), (60, 0.6, 92.5, 96.0),
    ],
)  # fmt: skip
def test_coverage(periods: int, correlation: float, least: float, most: float) -> None:
    found, plain = covered(periods, correlation)
    assert least <= found <= most
    if correlation > 0.0:
        assert plain < found - 0.5
    if correlation == 0.6:
        assert plain < 72.0


def test_white_scatter_keeps_its_standard_error() -> None:
    for periods, most in ((8, 1.06), (20, 1.05), (60, 1.03)):
        means = drawn(periods, 0.0)
        pairs = np.array([(successive_error(each).error, standard_error(each)) for each in means])
        assert np.median(pairs[:, 0] / pairs[:, 1]) == 1.0
        assert 1.0 < np.mean(pairs[:, 0]) / np.mean(pairs[:, 1]) < most
        assert 0.03 < np.mean(pairs[:, 0] > pairs[:, 1]) < 0.07  # the level of the test


def test_the_effective_number_is_that_of_the_process() -> None:
    """A long series: (1 - rho) / (1 + rho) of its values count."""
    periods, correlation = 2000, 0.6
    means = drawn(periods, correlation)[:20]
    found = np.array([successive_error(each) for each in means])
    assert np.mean(found[:, 1] + 1.0) / periods == pytest.approx(0.25, rel=0.05)
    true = math.sqrt((1.0 + correlation) / (1.0 - correlation) / periods)
    assert np.mean(found[:, 0]) == pytest.approx(true, rel=0.05)


def test_a_limit_cycle_of_two_periods_is_no_correlation_that_widens() -> None:
    alternating = np.array([1.0, -1.0] * 6)
    assert successive_error(alternating) == (standard_error(alternating), 11.0)


def test_a_drift_widens_the_interval() -> None:
    drift = np.linspace(-1.0, 1.0, 12)
    error, dof = successive_error(drift)
    assert dof == 2.0  # the least effective number is 3
    assert error > 2.0 * standard_error(drift)


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [1.0, 2.0], [5.0] * 9])
def test_few_or_equal_periods_count_as_independent(values: list[float]) -> None:
    assert successive_error(values) == (standard_error(values), len(values) - 1.0)


def test_one_period_has_no_error() -> None:
    assert all(map(math.isnan, successive_error([1.0])))
