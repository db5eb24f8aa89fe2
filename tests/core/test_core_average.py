"""The low-pass of powers against closed forms, and the bound for energy stores."""

from __future__ import annotations

import cmath
import math
import random

import pytest

from rig.realtime import average

DT = 0.001


@pytest.mark.parametrize("time_constant", [0.1, 2.0, 10.0])
def test_the_step_response_is_exact(time_constant: float) -> None:
    weight, got = average.weight_of_tick(time_constant, DT), 0.0
    for tick in range(1, 5001):
        got = average.step(got, 80.0, weight)
        if tick % 500 == 0:
            expected = -80.0 * math.expm1(-tick * DT / time_constant)
            assert got == pytest.approx(expected, rel=1e-11)


def test_the_response_to_a_sinusoid_is_its_phasor() -> None:
    time_constant, turn = 2.0, 2.0 * math.pi * 1.0 * DT  # rad a tick: the power of a wave of 0.5 Hz
    weight, got = average.weight_of_tick(time_constant, DT), 0.0
    gain = weight / (1.0 - (1.0 - weight) * cmath.exp(-1j * turn))
    start = -(gain * (1.0 - weight) * cmath.exp(-1j * turn)).real  # from the initial rest
    for tick in range(20_000):
        got = average.step(got, math.cos(turn * tick), weight)
        fading = start * math.exp(-tick * DT / time_constant)
        assert got == pytest.approx((gain * cmath.exp(1j * turn * tick)).real + fading, abs=1e-10)
    assert abs(gain) == pytest.approx(
        1.0 / math.hypot(1.0, 2.0 * math.pi * time_constant), rel=1e-3
    )


def test_the_average_power_of_an_energy_store_is_bounded() -> None:
    rng, capacity, time_constant = random.Random(3), 613.0, 10.0  # J, s
    weight = average.weight_of_tick(time_constant, DT)
    for _ in range(20):
        energy = got = 0.0
        for _ in range(4000):
            target = rng.choice((0.0, capacity)) if rng.random() < 0.01 else energy
            got = average.step(got, (target - energy) / DT, weight)
            energy = target
            assert abs(got) <= capacity / time_constant * (1.0 + 1e-3)
    got = average.step(0.0, capacity / DT, weight)  # charged in one tick: equals the bound
    assert got == pytest.approx(capacity / time_constant, rel=1e-3)
