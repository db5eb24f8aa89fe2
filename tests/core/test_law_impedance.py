"""The impedance law: its equation, its signs, and bumpless changes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples
from scipy import signal

from controllers import biquads, impedance
from controllers.blocks import finite
from controllers.signals import Demand, Estimate, Gains
from rig.design.impedance import design

DT = 0.001
LAW = impedance.Params(ramp=0.02)
REST = Estimate(0.0, 0.0, 0.0)
NONE = Gains(0.0, 0.0, 0.0)
# Damping of 800 N s/m and a lag of 3000 N s/m at 0.5 rad/s: direct gain and memory.
LAGGED = design([-800.0, -1900.0], [1.0, 0.5], DT)
WITH_ZC = impedance.Params(0.02, LAGGED)
TARGET = st.sampled_from([0.0, 1.0, -1.0, 250.0, -2000.0, 3.7e4]) | st.floats(
    -1e5, 1e5, allow_subnormal=False
)
WEIRD = [math.nan, math.inf, -math.inf]


def settled(gains: Gains, params: impedance.Params = LAW) -> impedance.State:
    state = impedance.start(params)
    for _ in range(30):
        state, _ = impedance.step(params, state, gains, REST, 0.0, 0.0, DT)
    return state


@given(
    *[st.tuples(TARGET, TARGET, TARGET)],
    *[st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0), st.floats(-8.0, 8.0))],
    st.floats(-5e3, 5e3),
)
def test_the_force_is_the_sum_of_its_parts(
    gains: tuple[float, float, float], motion: tuple[float, float, float], reference: float
) -> None:
    kp, ki, km = gains
    state, demand = impedance.step(
        LAW, settled(Gains(*gains)), Gains(*gains), Estimate(*motion), reference, 0.0, DT
    )
    terms = np.array([ki, kp, km, 1.0]) * np.array([*motion, reference])
    assert demand[:3] == (kp, ki, km)
    assert type(demand) is Demand
    assert demand.force == pytest.approx(math.fsum(terms), rel=1e-12, abs=1e-12 * abs(terms).max())
    assert state.active_gains == gains


def test_without_reference_and_mass_it_is_the_pi_law_to_the_bit() -> None:
    rng = np.random.default_rng(3)
    for kp, ki, x, v, a in rng.normal(size=(500, 5)).tolist():
        gains = Gains(1e3 * kp, 1e4 * ki, 0.0)
        _, demand = impedance.step(LAW, settled(gains), gains, Estimate(x, v, a), 0.0, 0.0, DT)
        assert demand.force == 1e3 * kp * v + 1e4 * ki * x


def test_the_sign_of_the_recorded_data() -> None:
    """Kp < 0 dissipates energy; Ki > 0 pushes away from rest, Km > 0 along the acceleration."""
    for gains, motion, product in (
        (Gains(-2000.0, 0.0, 0.0), Estimate(0.1, 0.4, 0.0), -320.0),
        (Gains(0.0, 3000.0, 0.0), Estimate(0.1, 0.0, 0.0), 30.0),
        (Gains(0.0, 0.0, 400.0), Estimate(0.1, 0.0, 2.0), 1600.0),
    ):
        for sign in (1.0, -1.0):
            turned = Estimate(*(sign * number for number in motion))
            _, demand = impedance.step(LAW, settled(gains), gains, turned, 0.0, 0.0, DT)
            where = next(n for n, gain in zip((1, 0, 2), gains, strict=True) if gain)
            assert demand.force * turned[where] == pytest.approx(product)


def test_km_adds_mass_to_a_body_and_takes_it_off() -> None:
    """(M - Km) a = F_0: a body under a constant force accelerates by that equation."""
    mass, push = 1500.0, 900.0
    for km in (-500.0, 500.0):
        state, law, v, a = settled(Gains(0.0, 0.0, km)), Gains(0.0, 0.0, km), 0.0, 0.0
        for _ in range(2000):
            state, demand = impedance.step(LAW, state, law, Estimate(0.0, v, a), 0.0, 0.0, DT)
            a = (push + demand.force) / mass
            v += a * DT
        assert a == pytest.approx(push / (mass - km), rel=1e-9)


@pytest.mark.parametrize("v", [0.7, -0.7])
@pytest.mark.parametrize("params", [LAW, WITH_ZC])
def test_the_first_force_is_within_one_step_of_zero(params: impedance.Params, v: float) -> None:
    gains = Gains(-2000.0, 5000.0, 300.0)
    _, demand = impedance.step(
        params, impedance.start(params), gains, Estimate(0.2, v, 1.0), 0.0, 0.0, DT
    )
    share = DT / LAW.ramp
    assert demand[:3] == pytest.approx([gain * share for gain in gains])
    direct = math.prod(section.b0 for section in params.sections) if params.sections else 0.0
    expected = share * (-2000.0 * v + 5000.0 * 0.2 + 300.0 + direct * v)
    assert demand.force == pytest.approx(expected)


@settings(max_examples=examples(200))
@given(
    st.lists(st.tuples(TARGET, TARGET, TARGET, st.integers(1, 30)), min_size=2, max_size=10),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.3),
    st.floats(0.0, 2.0),
)
def test_no_sequence_of_gain_switches_bumps_the_force(
    switches: list[tuple[float, float, float, int]], v: float, x: float, a: float
) -> None:
    """At constant motion the force changes by at most rate * dt a tick at any switch."""
    state, last = impedance.start(impedance.Params(0.0)), 0.0
    steps = LAW.ramp / DT
    reach = [0.0, 0.0, 0.0]  # largest change that any ramp so far may need
    motion = Estimate(x, v, a)
    for *expected, ticks in switches:
        for i, (old, new) in enumerate(zip(state.active_gains, expected, strict=True)):
            reach[i] = max(reach[i], abs(new - old))
        for _ in range(ticks):
            state, demand = impedance.step(LAW, state, Gains(*expected), motion, 0.0, 0.0, DT)
            bound = (reach[0] * v + reach[1] * x + reach[2] * a) / steps
            size = abs(last) + abs(demand.force) + sum(map(abs, expected)) * (v + x + a)
            assert abs(demand.force - last) <= bound + 1e-9 * size + 1e-9
            last = demand.force
    for _ in range(int(steps) + 1):
        state, demand = impedance.step(LAW, state, Gains(*expected), motion, 0.0, 0.0, DT)
    assert demand[:3] == tuple(expected)


# --- Z_c


def test_sections_agree_with_scipy() -> None:
    """Same difference equation, other code: 1e-9 for another order of summation."""
    v = np.random.default_rng(5).normal(size=4000)
    sections = design([-4e4, -3e3, -9e4, -1.0], [1.0, 3.0, 30.0, 20.0, 5.0], DT)
    state, forces = impedance.start(impedance.Params(0.0, sections)), []
    law = impedance.Params(0.0, sections)  # no ramp: full share from the first tick
    for velocity in v.tolist():
        estimate = Estimate(0.0, velocity, 0.0)
        state, demand = impedance.step(law, state, NONE, estimate, 100.0, 0.0, DT)
        forces.append(demand.force)
    rows = [(*section[:3], 1.0, *section[3:]) for section in sections]
    expected = 100.0 + signal.sosfilt(rows, v)
    assert np.abs(np.array(forces) - expected).max() <= 1e-9 * np.abs(expected).max()


def test_the_memory_gives_the_free_response() -> None:
    sections = design([-4e4, -3e3, -9e4, -1.0], [1.0, 3.0, 30.0, 20.0, 5.0], DT)
    states = biquads.start(sections)
    assert biquads.output(sections, states, 0.0) == 0.0
    for _ in range(300):
        states, _ = biquads.step(sections, states, 0.4)
    for u in (0.0, 0.7):
        assert biquads.output(sections, states, u) == biquads.step(sections, states, u)[1]
    half = biquads.scale_states(states, 0.5)
    assert biquads.output(sections, half, 0.0) == 0.5 * biquads.output(sections, states, 0.0)
    for _ in range(500):  # the free response is scaled too
        states, whole = biquads.step(sections, states, 0.0)
        half, part = biquads.step(sections, half, 0.0)
        assert part == 0.5 * whole


def test_the_share_of_zc_is_ramped_in() -> None:
    """At constant velocity the force changes by at most a ramp's step plus that of Z_c."""
    v, ramp = 0.5, 0.1
    law = impedance.Params(ramp, LAGGED)
    state, alone, forces, replies = impedance.start(law), biquads.start(LAGGED), [0.0], [0.0]
    for _ in range(2000):
        state, demand = impedance.step(law, state, NONE, Estimate(0.0, v, 0.0), 0.0, 0.0, DT)
        alone, reply = biquads.step(LAGGED, alone, v)
        forces.append(demand.force)
        replies.append(reply)
    force, reply = np.array(forces), np.array(replies)
    own = np.abs(np.diff(reply[1:])).max()
    assert np.abs(np.diff(force)).max() <= np.abs(reply).max() * DT / ramp + own + 1e-9
    assert np.array_equal(force[101:2001], reply[101:2001])


def test_a_restarted_law_has_no_memory() -> None:
    """A restarted law gives the same forces again, whatever happened before."""
    rng = np.random.default_rng(11)
    motions = [Estimate(*row) for row in rng.normal(size=(400, 3)).tolist()]

    def forces() -> list[float]:
        state, out = impedance.start(WITH_ZC), []
        for motion in motions:
            gains = Gains(-900.0, 500.0, 20.0)
            state, demand = impedance.step(WITH_ZC, state, gains, motion, 0.0, -3.0, DT)
            out.append(demand.force)
        return out

    assert forces() == forces()
    assert impedance.start(impedance.Params(0.0)) == impedance.State(
        *[(0.0, 0.0, 0.0)] * 4, (), (0.0, 0.0, 0.0)
    )
    assert impedance.start(WITH_ZC).sections == ((0.0, 0.0),)


# --- input that is not finite


@pytest.mark.parametrize("bad", WEIRD)
@pytest.mark.parametrize("params", [LAW, WITH_ZC])
@pytest.mark.parametrize("field", range(3))
def test_input_that_is_not_finite_gives_output_that_is_not_finite(
    bad: float, field: int, params: impedance.Params
) -> None:
    gains, motion = [-2000.0, 500.0, 30.0], [0.1, 0.2, 0.3]
    state = settled(Gains(*gains), params)
    odd = [*motion[:field], bad, *motion[field + 1 :]]
    after, demand = impedance.step(params, state, Gains(*gains), Estimate(*odd), 0.0, 0.0, DT)
    assert not finite(demand.force)
    if params.sections and field == 1:  # stays so until the law restarts
        for _ in range(100):
            after, demand = impedance.step(
                params, after, Gains(*gains), Estimate(*motion), 0.0, -1.0, DT
            )
            assert not finite(demand.force)
    odd = [*gains[:field], bad, *gains[field + 1 :]]
    _, demand = impedance.step(params, state, Gains(*odd), Estimate(*motion), 0.0, 0.0, DT)
    assert not finite(demand.force)
    _, demand = impedance.step(params, state, Gains(*gains), Estimate(*motion), bad, 0.0, DT)
    assert not finite(demand.force)
