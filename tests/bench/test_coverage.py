"""Sessions on benches with hidden constants: a short form of the coverage benchmark."""

from __future__ import annotations

import pytest

from benchmarks import coverage

SEEDS = 12
MIN_COVERED = 9
"""Lower limit: of 12 intervals of 95 %, fewer hold in two cases of a thousand."""


@pytest.mark.slow
@pytest.mark.long
def test_sessions_recover_the_constants_of_hidden_benches() -> None:
    """Gap, soft zone, stiffness, both constants, losses, brake; the `coverage` benchmark has 200
    benches.
    """
    results = [coverage.analyse_bench(seed) for seed in range(SEEDS)]
    covered = {name: sum(each[name][0] for each in results) for name in results[0]}
    assert {"half gap", "stiffness", "velocity constant"} <= covered.keys()
    assert min(covered.values()) >= MIN_COVERED, covered
    # An interval as wide as the constant itself would contain any value.
    widths = [each[name][1] for each in results for name in each]
    assert max(widths) < 0.5
