"""Sparse counts: a filter designed for every tick does not oscillate on them."""

from __future__ import annotations

import math
import random

import pytest
from core_kinds import DT

from controllers import estimator
from controllers.signals import Estimate
from rig.design.estimator import design
from rig.realtime import axis
from rig.realtime.safety import RUN

SCALE = 2.0 * math.pi / (65536 * 15)  # rad per count: the bench's motor
FILTER = design(SCALE, 0.5, 10.0, DT)
PEAK, OMEGA = 0.35, 2.0 * math.pi / 1.5  # rad and rad/s: 20 degrees every 1.5 s
NEWEST = 0.0005  # s, age of a new value


def tracking_error(gaps_in_ticks: list[int], moving: bool) -> float:
    """Return the greatest velocity error (rad/s) for a repeated sequence of gaps (ticks)."""
    state = axis.start()._replace(demand_source=RUN, encoder_age=NEWEST, min_age=NEWEST)
    motion, worst, taken = Estimate(0.0, PEAK * OMEGA * moving, 0.0), 0.0, 0
    gap, turn = gaps_in_ticks[0], 0
    for tick in range(1, 6000):
        if tick - taken >= gap:
            taken, turn = tick, turn + 1
            gap = gaps_in_ticks[turn % len(gaps_in_ticks)]
        age = NEWEST + (tick - taken) * DT
        angle = PEAK * math.sin(OMEGA * taken * DT) if moving else 0.4 * SCALE * (turn % 3)
        counts = round(angle / SCALE)
        spread = axis.recent_sample_gap(state, age, DT)
        motion = axis.track(
            FILTER, motion, counts * SCALE, state.encoder_age, age, NEWEST, spread, 1, DT
        )
        state = state._replace(encoder_age=age, sample_gap=spread)
        if tick > 1500:
            true = PEAK * OMEGA * math.cos(OMEGA * tick * DT) * moving
            worst = max(worst, abs(motion.velocity - true))
    return worst


@pytest.mark.parametrize("gaps_in_ticks", [1, 2, 3, 5, 8, 12, 20, 40])
def test_sparse_values_create_no_motion_at_rest(gaps_in_ticks: int) -> None:
    """Occasional changes of one count give a velocity of at most one count a tick."""
    assert tracking_error([gaps_in_ticks], moving=False) < SCALE / DT


@pytest.mark.parametrize(
    "gaps", [(1, 2), (1, 5), (1, 1, 1, 12), (1, 30), (1, 1, 2, 4, 9, 17, 30), 12 * (1,) + (60,)]
)
def test_irregular_values_create_no_motion_at_rest(gaps: tuple[int, ...]) -> None:
    """Gains for the present gap alone diverge on every one of these."""
    rng = random.Random(1)
    anyhow = [rng.choice(gaps) for _ in range(1001)]
    assert tracking_error(anyhow, moving=False) < SCALE / DT


@pytest.mark.parametrize(
    ("gaps_in_ticks", "max_error"), [(1, 0.01), (2, 0.01), (5, 0.02), (12, 0.1)]
)
def test_a_moving_shaft_is_tracked_with_sparse_values(gaps_in_ticks: int, max_error: float) -> None:
    """Its velocity reaches 1.47 rad/s; with larger gaps the filter may be slower."""
    assert tracking_error([gaps_in_ticks], moving=True) < max_error


def test_the_stretched_filter_is_the_same_in_slower_time() -> None:
    """At every third tick and three times as slow, the estimates are equal up to rounding."""
    quick, slow = Estimate(1.0, 0.0, 0.0), Estimate(1.0, 0.0, 0.0)
    stretched = estimator.stretch_gains(FILTER, 3.0)
    for tick in range(200):
        measured = math.sin(0.1 * tick)
        quick = estimator.step(FILTER, quick, measured, 1, DT)
        slow = estimator.step(stretched, slow, measured, 3, DT)
        assert slow.position == pytest.approx(quick.position, rel=1e-6, abs=1e-9)
        assert 3.0 * slow.velocity == pytest.approx(quick.velocity, rel=1e-6, abs=1e-6)
