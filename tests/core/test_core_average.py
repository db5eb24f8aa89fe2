"""The low-pass of powers against its closed forms, and the bound for what only stores energy."""

from __future__ import annotations

import cmath
import math
import random

import pytest

from rig.realtime import average

DT = 0.001


@pytest.mark.parametrize("duration", [0.1, 2.0, 10.0])
def test_a_step_is_answered_exactly(duration: float) -> None:
    newest, got = average.share(duration, DT), 0.0
    for tick in range(1, 5001):
        got = average.step(got, 80.0, newest)
        if tick % 500 == 0:
            due = -80.0 * math.expm1(-tick * DT / duration)
            assert got == pytest.approx(due, rel=1e-11)


def test_a_sinusoid_comes_out_as_its_phasor() -> None:
    duration, turn = 2.0, 2.0 * math.pi * 1.0 * DT  # rad a tick: the power of a wave of 0.5 Hz
    newest, got = average.share(duration, DT), 0.0
    gain = newest / (1.0 - (1.0 - newest) * cmath.exp(-1j * turn))
    start = -(gain * (1.0 - newest) * cmath.exp(-1j * turn)).real  # what the rest at first leaves
    for tick in range(20_000):
        got = average.step(got, math.cos(turn * tick), newest)
        fading = start * math.exp(-tick * DT / duration)
        assert got == pytest.approx((gain * cmath.exp(1j * turn * tick)).real + fading, abs=1e-10)
    assert abs(gain) == pytest.approx(1.0 / math.hypot(1.0, 2.0 * math.pi * duration), rel=1e-3)


def test_what_only_stores_energy_averages_to_no_more_than_the_store_over_the_time() -> None:
    rng, most, duration = random.Random(3), 613.0, 10.0  # J, s
    newest = average.share(duration, DT)
    for _ in range(20):
        energy = got = 0.0
        for _ in range(4000):
            target = rng.choice((0.0, most)) if rng.random() < 0.01 else energy
            got = average.step(got, (target - energy) / DT, newest)
            energy = target
            assert abs(got) <= most / duration * (1.0 + 1e-3)
    got = average.step(0.0, most / DT, newest)  # charged in one tick: the bound is met
    assert got == pytest.approx(most / duration, rel=1e-3)
