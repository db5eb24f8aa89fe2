"""Rows in an irregular sea: the regression on a reference row, and when rows end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rig.realtime import paired_rows, sequence
from rig.realtime.paired_rows import BINS, CORRELATED, LEAST_BATCHES, PER_BATCH, estimated
from rig.realtime.sequence import LEAD_IN, MEASURE, SETTLE, WAIT_KNOWN, WAIT_SETTLED

BIN = 7  # ticks
PARAMS = paired_rows.Params(float(BIN), LEAST_BATCHES, 0.0, 0.0, 0)
WAVES = 20.0 + 3.0 * np.random.default_rng(4).standard_normal(BINS)  # W, of each bin


def other(scatter: float, offset: float = -5.0) -> Any:
    """The powers of a row that follows the waves by half, with a scatter of its own."""
    return offset + 0.5 * WAVES + scatter * np.random.default_rng(9).standard_normal(BINS)


class Run:
    """A plan in which each segment lasts until its condition is met."""

    def __init__(self, params: paired_rows.Params = PARAMS, tick: int = 0) -> None:
        self.params, self.state, self.tick, self.segment = params, paired_rows.start(), tick, 0

    def last(self, phase: int, powers: Any, least: int = 1, most: int = 2 * BINS * BIN) -> int:
        """Run a segment of ``least`` to ``most`` ticks; return its ticks."""
        plan = sequence.State(self.segment, self.tick, 0, 0)
        while self.tick - plan.entered < most:
            power = float(powers[math.floor(self.tick / self.params.bin) % BINS])
            self.state = paired_rows.step(self.params, self.state, plan, phase, self.tick, power)
            self.tick += 1
            if self.state.flags and self.tick - plan.entered >= least:
                break
        self.segment += 1
        return self.tick - plan.entered

    def row(self, powers: Any) -> int:
        """Settle for less than a bin, and measure; return the number of bins."""
        self.last(SETTLE, powers)
        assert self.state.flags == WAIT_SETTLED
        assert self.tick % self.params.bin < 1.0  # a row begins with a bin
        return round(self.last(MEASURE, powers) / self.params.bin)


def test_the_estimate_is_that_of_least_squares() -> None:
    """The estimate and its HC3 variance, from the hat matrix of numpy's regression."""
    bins, first = 16, 23
    order = (first + np.arange(BINS)) % BINS
    own, reference = other(0.4)[order], WAVES[order]
    y = own[-bins:].reshape(-1, PER_BATCH).mean(1)
    x = reference[-bins:].reshape(-1, PER_BATCH).mean(1)
    design = np.column_stack([np.ones(len(x)), x])
    inverse = np.linalg.inv(design.T @ design)
    weights = np.array([1.0, WAVES.mean()]) @ inverse @ design.T
    residuals = y - design @ inverse @ design.T @ y
    leverage = np.diag(design @ inverse @ design.T)
    variance = np.sum((weights * residuals / (1.0 - leverage)) ** 2) * (1.0 - bins / BINS)
    found = estimated(tuple(own.tolist()), tuple(reference.tolist()), float(WAVES.mean()), bins)
    assert found.power == pytest.approx(weights @ y, rel=1e-12)
    assert found.variance == pytest.approx(CORRELATED * variance, rel=1e-9)


@pytest.mark.parametrize("bin_ticks", [7.0, 7.3])
@pytest.mark.parametrize("begin", [0, 3, 250])
def test_a_row_that_follows_the_reference_is_known_from_a_part(
    begin: int, bin_ticks: float
) -> None:
    """Its mean over the whole period is exact, although the waves of its part are not the mean."""
    run = Run(PARAMS._replace(precision=1e-6, bin=bin_ticks), begin)
    run.last(LEAD_IN, WAVES, most=40)
    assert run.row(WAVES) == BINS
    assert run.state.reference_mean == pytest.approx(WAVES.mean(), rel=1e-12)
    assert run.row(other(0.0, -2.0)) == PER_BATCH * paired_rows.LEAST_PRECISE
    assert run.state.flags == WAIT_KNOWN
    assert run.state.best.power == pytest.approx(other(0.0, -2.0).mean(), rel=1e-9)


def test_a_row_that_cannot_be_the_best_ends_at_once() -> None:
    run = Run(PARAMS._replace(ends_worse=1))
    assert run.row(WAVES) == BINS
    assert run.row(other(0.1, 25.0)) == PER_BATCH * LEAST_BATCHES
    assert run.row(other(0.1)) == BINS  # it is better, and no precision ends it
    assert run.state.reference_mean == pytest.approx(other(0.1).mean(), rel=1e-12)
    assert run.row(WAVES) == PER_BATCH * LEAST_BATCHES  # compared with the new reference
    assert run.state.best == (pytest.approx(other(0.1).mean()), 0.0)


def test_a_precision_may_be_a_share_of_the_best_power() -> None:
    rows = []
    for share in (0.001, 0.1):
        run = Run(PARAMS._replace(precision_of_best=share))
        run.row(WAVES)
        rows.append(run.row(other(0.5)))
    assert rows[0] > rows[1] == PER_BATCH * paired_rows.LEAST_PRECISE


def test_a_hold_begins_the_row_anew() -> None:
    run = Run(PARAMS._replace(precision=1e-6))
    run.row(WAVES)
    run.last(SETTLE, WAVES)
    plan = sequence.State(run.segment, run.tick, 0, 0)
    for paused in (0, 1, 0):
        for _ in range(3 * BIN):
            state = plan._replace(paused=paused)
            run.state = paired_rows.step(PARAMS, run.state, state, MEASURE, run.tick, 1.0)
            run.tick += 1
        assert run.state.row.bins == (0 if paused else 3)


def test_a_bin_whose_last_tick_is_lost_ends_with_the_next_one() -> None:
    run = Run()
    run.row(WAVES)
    run.last(SETTLE, WAVES)
    plan = sequence.State(run.segment, run.tick, 0, 0)
    first = run.tick // BIN
    for tick in range(run.tick, run.tick + 2 * BIN):
        if tick % BIN != BIN - 1:
            power = float(WAVES[tick // BIN % BINS])
            run.state = paired_rows.step(PARAMS, run.state, plan, MEASURE, tick, power)
    assert (run.state.row.bins, run.state.bin) == (1, first + 1)
    # The ring of the reference has followed the waves.
    assert run.state.reference[0] == pytest.approx(WAVES[(first + 1) % BINS], rel=1e-12)


def test_a_missed_power_ends_no_row_and_is_no_reference() -> None:
    run = Run(PARAMS._replace(precision=1e-6, ends_worse=1))
    missed = np.where(np.arange(BINS) == 5, math.nan, WAVES)
    assert run.row(missed) == BINS
    assert run.state.reference_mean == math.inf
    assert run.row(WAVES) == BINS
    assert run.row(missed) == BINS or run.state.best.power == pytest.approx(WAVES.mean())
    assert math.isfinite(run.state.best.power)


def test_without_bins_nothing_is_estimated() -> None:
    """A reference that is the same in all batches explains nothing."""
    flat = (1.0,) * BINS
    found = estimated(tuple(WAVES.tolist()), flat, 1.0, 10)
    assert found.variance == math.inf
