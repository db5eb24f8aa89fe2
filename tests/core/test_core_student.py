"""The quantile of Student's distribution of the tick against scipy's."""

from __future__ import annotations

import pytest
from scipy import stats

from rig.realtime.student import quantile


@pytest.mark.parametrize("freedom", [3, 4, 5, 8, 15, 100])
def test_the_quantile_is_that_of_students_distribution(freedom: int) -> None:
    assert quantile(freedom) == pytest.approx(stats.t.ppf(0.995, freedom), rel=0.01)
