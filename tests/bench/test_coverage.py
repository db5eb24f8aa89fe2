"""The bench's sessions on benches that nobody told them of: the benchmark's count, of fewer."""

from __future__ import annotations

import pytest

from benchmarks import coverage

SEEDS = 12
LEAST = 9
"""Of 12 intervals of 95 % fewer hold in two cases of a thousand."""


@pytest.mark.slow
def test_sessions_recover_the_constants_of_hidden_benches() -> None:
    """Gap, soft zone, stiffness, both constants, losses, brake; 200 benches in `coverage`."""
    every = [coverage.blind(seed) for seed in range(SEEDS)]
    held = {name: sum(each[name][0] for each in every) for name in every[0]}
    assert {"half gap", "stiffness", "velocity constant"} <= held.keys()
    assert min(held.values()) >= LEAST, held
    # An interval as wide as the constant itself would hold anything.
    widths = [each[name][1] for each in every for name in each]
    assert max(widths) < 0.5
