"""Counts that come now and then: a filter made for every tick does not swing up on them."""

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
NEWEST = 0.0005  # s, age of a value that has just come


def followed(apart: list[int], moving: bool) -> float:
    """Greatest error of the velocity (rad/s) with values so many ticks apart, again and again."""
    state = axis.start()._replace(acting=RUN, age=NEWEST, usual=NEWEST)
    motion, worst, taken = Estimate(0.0, PEAK * OMEGA * moving, 0.0), 0.0, 0
    gap, turn = apart[0], 0
    for tick in range(1, 6000):
        if tick - taken >= gap:
            taken, turn = tick, turn + 1
            gap = apart[turn % len(apart)]
        age = NEWEST + (tick - taken) * DT
        angle = PEAK * math.sin(OMEGA * taken * DT) if moving else 0.4 * SCALE * (turn % 3)
        counts = round(angle / SCALE)
        spread = axis.recent_sample_gap(state, age, DT)
        motion = axis.track(FILTER, motion, counts * SCALE, state.age, age, NEWEST, spread, 1, DT)
        state = state._replace(age=age, apart=spread)
        if tick > 1500:
            true = PEAK * OMEGA * math.cos(OMEGA * tick * DT) * moving
            worst = max(worst, abs(motion.velocity - true))
    return worst


@pytest.mark.parametrize("apart", [1, 2, 3, 5, 8, 12, 20, 40])
def test_values_that_come_now_and_then_make_no_motion_of_rest(apart: int) -> None:
    """A count more or less now and then is a velocity of no more than that count in a tick."""
    assert followed([apart], moving=False) < SCALE / DT


@pytest.mark.parametrize(
    "gaps", [(1, 2), (1, 5), (1, 1, 1, 12), (1, 30), (1, 1, 2, 4, 9, 17, 30), 12 * (1,) + (60,)]
)
def test_nor_do_values_that_come_anyhow(gaps: tuple[int, ...]) -> None:
    """Gains of the present gap alone swing up without bound on every one of these."""
    rng = random.Random(1)
    anyhow = [rng.choice(gaps) for _ in range(1001)]
    assert followed(anyhow, moving=False) < SCALE / DT


@pytest.mark.parametrize(("apart", "most"), [(1, 0.01), (2, 0.01), (5, 0.02), (12, 0.1)])
def test_a_moving_shaft_is_still_followed(apart: int, most: float) -> None:
    """Its velocity is up to 1.47 rad/s; the farther apart, the slower the filter may follow."""
    assert followed([apart], moving=True) < most


def test_the_stretched_filter_is_the_same_one_in_slower_time() -> None:
    """Every third tick, three times as slow: the same estimates as every tick, to rounding."""
    quick, slow = Estimate(1.0, 0.0, 0.0), Estimate(1.0, 0.0, 0.0)
    stretched = estimator.stretched(FILTER, 3.0)
    for tick in range(200):
        measured = math.sin(0.1 * tick)
        quick = estimator.step(FILTER, quick, measured, 1, DT)
        slow = estimator.step(stretched, slow, measured, 3, DT)
        assert slow.position == pytest.approx(quick.position, rel=1e-6, abs=1e-9)
        assert 3.0 * slow.velocity == pytest.approx(quick.velocity, rel=1e-6, abs=1e-6)
