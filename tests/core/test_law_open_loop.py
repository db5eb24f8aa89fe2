"""The open-loop reference: a periodic table, scaled without jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers import open_loop
from controllers.blocks import finite

DT = 0.001
TABLE = tuple(np.random.default_rng(2).normal(scale=500.0, size=750).tolist())
LAW = open_loop.Params(TABLE, 0.05, 1)
FLAT = open_loop.Params((800.0,), 0.05, 1)
NONE = open_loop.Params((), 0.1, 1)
WEIRD = [math.nan, math.inf, -math.inf]


def settled(scale: float, law: open_loop.Params = LAW) -> open_loop.State:
    state = open_loop.start()
    for tick in range(60):
        state, _ = open_loop.step(law, state, scale, 0, tick, DT)
    return state


@given(st.floats(-3.0, 3.0, allow_subnormal=False), st.integers(0, 10**12))
def test_the_force_repeats_the_scaled_table(scale: float, tick: int) -> None:
    state, force = open_loop.step(LAW, settled(scale), scale, 0, tick, DT)
    whole = math.floor(tick / 750)  # exact: below 2^53
    assert force == scale * TABLE[tick - 750 * whole]
    assert state.scale.value == scale


def test_one_period_keeps_its_spectrum() -> None:
    """A multisine of three whole cycles a period: the spectrum has only its lines."""
    t = np.arange(1000) * DT
    wave = 300.0 * np.sin(2 * np.pi * 3 * t) + 80.0 * np.cos(2 * np.pi * 7 * t)
    law, state, out = open_loop.Params(tuple(wave.tolist()), 0.0, 1), open_loop.start(), []
    for tick in range(4000):
        state, force = open_loop.step(law, state, 2.0, 0, tick, DT)
        out.append(force)
    lines = np.abs(np.fft.rfft(out)) / 2000.0
    assert lines[[12, 28]] == pytest.approx([600.0, 160.0])
    lines[[12, 28]] = 0.0
    assert lines.max() < 1e-9


def test_before_the_wave_clock_there_is_no_force_and_then_it_ramps() -> None:
    state, forces = settled(1.0, FLAT), []
    for tick in [*range(-20, 0), *range(60)]:
        state, force = open_loop.step(FLAT, state, 1.0, 0, tick, DT)
        forces.append(force)
    assert forces[:20] == [0.0] * 20
    assert forces[20] == pytest.approx(800.0 / 50)
    assert forces[44] == pytest.approx(400.0)
    assert forces[-9:] == [800.0] * 9


@given(st.lists(st.tuples(st.floats(-4.0, 4.0), st.integers(1, 80)), min_size=1, max_size=8))
def test_no_change_of_scale_bumps_the_force(switches: list[tuple[float, int]]) -> None:
    state, last, widest, tick = open_loop.start(), 0.0, 0.0, 0
    for scale, ticks in switches:
        widest = max(widest, abs(scale - state.scale.value))
        for _ in range(ticks):
            state, force = open_loop.step(FLAT, state, scale, 0, tick, DT)
            assert abs(force - last) <= 800.0 * widest * DT / FLAT.ramp + 1e-9
            last, tick = force, tick + 1


@pytest.mark.parametrize("tick", [-5, 0, 5])
def test_an_empty_table_is_no_force(tick: int) -> None:
    state = open_loop.start()
    for scale in (0.0, 1.0, *WEIRD):
        assert open_loop.step(open_loop.Params((), 0.1, 1), state, scale, 0, tick, DT) == (
            state,
            0.0,
        )


@pytest.mark.parametrize("bad", WEIRD)
def test_input_that_is_not_finite_gives_output_that_is_not_finite(bad: float) -> None:
    state = settled(1.0)
    for tick in range(10):
        state, force = open_loop.step(LAW, state, bad, 0, tick, DT)
        assert not finite(force)
    law = open_loop.Params((100.0, bad), 0.0, 1)
    _, force = open_loop.step(law, settled(1.0, law), 1.0, 0, 1, DT)
    assert not finite(force)


def test_a_restarted_law_has_no_memory() -> None:
    assert open_loop.start() == ((0.0, 0.0, 0.0), 0)
    _, force = open_loop.step(FLAT, open_loop.start(), 1.0, 0, 123456, DT)
    assert force == pytest.approx(16.0)


def test_a_new_realisation_starts_from_zero_force() -> None:
    """Two realisations: the force is ramped down before the change and up after it."""
    law = open_loop.Params((500.0,) * 4 + (-900.0,) * 4, 0.05, 2)
    state, forces, requested = open_loop.start(), [], []
    for tick in range(400):
        realisation = 0 if tick < 100 or tick >= 250 else 1
        state, force = open_loop.step(law, state, 1.0, realisation, tick, DT)
        forces.append(force)
        requested.append(state.realisation)
    steps = np.abs(np.diff(forces))
    assert steps.max() <= 900.0 * DT / law.ramp + 1e-9
    assert [forces[99], forces[249], forces[399]] == [500.0, -900.0, 500.0]
    assert forces[requested.index(1) - 1] == 0.0
    assert requested.index(1) == 150  # one ramp after the request


@pytest.mark.parametrize(("number", "value"), [(-3, 1.0), (0, 1.0), (1, 2.0), (7, 2.0)])
def test_an_unknown_realisation_selects_the_nearest(number: int, value: float) -> None:
    law, state = open_loop.Params((1.0, 1.0, 2.0, 2.0), 0.0, 2), open_loop.start()
    for tick in range(3):
        state, force = open_loop.step(law, state, 1.0, number, tick, DT)
    assert force == value
