"""Station keeping: its equation, its soft stop, and its passivity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import station_keeping
from controllers.blocks import finite
from controllers.signals import Demand, Estimate, Gains
from controllers.station_keeping import DEFAULT, Params

DT = 0.001
LAW = Params(0.05, station=0.04, reach=0.2, soft_stiffness=3e4, soft_damping=4e4)
WEIRD = [math.nan, math.inf, -math.inf]
GAIN = st.floats(-1e4, 0.0, allow_subnormal=False)
ANY_GAIN = st.sampled_from([0.0, -2500.0, 2500.0]) | st.floats(-1e4, 1e4, allow_subnormal=False)


def settled(gains: Gains, params: Params = LAW) -> station_keeping.State:
    state = station_keeping.start()
    for _ in range(60):
        state, _ = station_keeping.step(params, state, gains, Estimate(0.0, 0.0, 0.0), DT)
    return state


def force(params: Params, gains: Gains, x: float, v: float) -> float:
    state = settled(gains, params)
    return station_keeping.step(params, state, gains, Estimate(x, v, 0.0), DT)[1].force


@given(GAIN, GAIN, st.floats(-0.16, 0.24), st.floats(-2.0, 2.0))
def test_within_reach_the_force_is_damper_and_spring(
    kp: float, ki: float, x: float, v: float
) -> None:
    gains = Gains(kp, ki, 123.0)
    state, demand = station_keeping.step(LAW, settled(gains), gains, Estimate(x, v, 9.9), DT)
    assert type(demand) is Demand
    assert demand[:3] == (kp, ki, 0.0)
    assert demand.force == pytest.approx(np.dot([kp, ki], [v, x - 0.04]), rel=1e-12, abs=1e-9)
    assert state == settled(gains)


@given(GAIN, GAIN, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
def test_beyond_reach_the_soft_stop_adds_its_force(
    kp: float, ki: float, x: float, v: float
) -> None:
    """Hunt and Crossley's contact, written with numpy's sign instead of branches."""
    d = x - 0.04
    depth = np.maximum(np.abs(d) - 0.2, 0.0)
    push = np.maximum(depth * (3e4 + 4e4 * np.sign(d) * v), 0.0)
    expected = kp * v + ki * d - np.sign(d) * push
    assert force(LAW, Gains(kp, ki, 0.0), x, v) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_the_default_is_the_damping_of_the_report() -> None:
    assert DEFAULT == (-2500.0, 0.0, 0.0)
    assert force(LAW, DEFAULT, 0.1, 0.2) == pytest.approx(-500.0)
    assert force(LAW, DEFAULT, 0.1, -0.2) == pytest.approx(500.0)


@given(st.floats(0.0, 1e5), st.floats(0.0, 1e5), st.floats(-0.9, 0.9), st.floats(-2.0, 2.0))
def test_gains_that_would_feed_energy_count_as_zero(
    kp: float, ki: float, x: float, v: float
) -> None:
    gains = Gains(kp, ki, 0.0)
    state, demand = station_keeping.step(LAW, settled(gains), gains, Estimate(x, v, 0.0), DT)
    assert demand[:3] == (0.0, 0.0, 0.0)
    assert demand.force == force(LAW, Gains(0.0, 0.0, 0.0), x, v)
    assert state.kp.value == 0.0


# --- the soft stop


@given(st.floats(-2.0, 2.0), st.floats(-5.0, 5.0), st.floats(-1e5, 1e6), st.floats(-1e5, 1e6))
def test_the_soft_stop_never_pulls_outward(x: float, v: float, k: float, c: float) -> None:
    """Also with a spring or damper of the wrong sign, and for any speed of return."""
    law = LAW._replace(soft_stiffness=k, soft_damping=c)
    alone = force(law, Gains(0.0, 0.0, 0.0), x, v)
    d = x - law.station
    assert alone * d <= 0.0
    assert alone == 0.0 or abs(d) > law.reach


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("v", [-1.5, 0.0, 1.5])
def test_nothing_jumps_at_the_edge(side: float, v: float) -> None:
    edge = LAW.station + side * LAW.reach
    inside, outside = (force(LAW, DEFAULT, edge + side * d, v) for d in (-1e-9, 1e-9))
    assert inside == pytest.approx(outside, abs=1e-3)


def test_a_start_beyond_reach_is_without_a_jolt() -> None:
    state, forces = station_keeping.start(), []
    for _ in range(60):
        state, demand = station_keeping.step(LAW, state, DEFAULT, Estimate(0.5, 0.4, 0.0), DT)
        forces.append(demand.force)
    full = -2500.0 * 0.4 - 0.26 * (3e4 + 4e4 * 0.4)
    assert forces[0] == pytest.approx(full / 50)
    assert forces[24] == pytest.approx(full / 2)
    assert forces[-1] == pytest.approx(full)
    assert np.abs(np.diff(forces)).max() <= abs(full) / 50 * (1 + 1e-9)


@given(
    st.lists(st.tuples(ANY_GAIN, ANY_GAIN, st.integers(1, 80)), min_size=1, max_size=8),
    st.floats(-0.16, 0.24),
    st.floats(-1.0, 1.0),
)
def test_no_change_of_gains_bumps_the_force(
    switches: list[tuple[float, float, int]], x: float, v: float
) -> None:
    state, last, widest = station_keeping.start(), 0.0, [0.0, 0.0]
    for kp, ki, ticks in switches:
        for i, (ramp, gain) in enumerate(((state.kp, kp), (state.ki, ki))):
            widest[i] = max(widest[i], abs(min(gain, 0.0) - ramp.value))
        bound = (widest[0] * abs(v) + widest[1] * abs(x - 0.04)) * DT / LAW.ramp
        for _ in range(ticks):
            gains = Gains(kp, ki, 0.0)
            state, demand = station_keeping.step(LAW, state, gains, Estimate(x, v, 0.0), DT)
            assert abs(demand.force - last) <= bound + 1e-6
            last = demand.force


# --- passivity


Motions = st.lists(
    st.tuples(st.floats(-0.4, 0.4), st.integers(1, 6)), min_size=1, max_size=5
).filter(lambda parts: any(abs(a) > 1e-3 for a, _ in parts))


def travel(parts: list[tuple[float, int]], span: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a motion that starts and ends at rest at the same place: x (m) and v (m/s)."""
    t = np.arange(round(span / DT)) * DT
    x, v = np.zeros_like(t), np.zeros_like(t)
    for amplitude, cycles in parts:
        w = 2.0 * np.pi * cycles / span
        x += amplitude * (1.0 - np.cos(w * t))
        v += amplitude * w * np.sin(w * t)
    return x, v


def energies(
    params: Params, gains: Gains, x: np.ndarray, v: np.ndarray
) -> tuple[float, float, float]:
    """Return the energy given to the body (J), the turnover, and the energy of the damper."""
    state, forces = settled(gains, params), []
    for position, velocity in zip(x.tolist(), v.tolist(), strict=True):
        motion = Estimate(position, velocity, 0.0)
        state, demand = station_keeping.step(params, state, gains, motion, DT)
        forces.append(demand.force)
    power = np.array(forces) * v
    return power.sum() * DT, np.abs(power).sum() * DT, (gains.kp * v * v).sum() * DT


@settings(max_examples=examples(60))
@given(Motions, GAIN, GAIN, st.floats(-0.3, 0.3))
def test_a_closed_path_never_gains_energy(
    parts: list[tuple[float, int]], kp: float, ki: float, station: float
) -> None:
    """For smooth forces the sum over whole cycles equals the integral, so within reach it is
    the damper's loss to rounding; the soft stop's corner costs (v dt)^2 K of accuracy a crossing.
    """
    x, v = travel(parts, 4.0)
    inside = LAW._replace(station=station, reach=10.0)
    got, turnover, lost = energies(inside, Gains(kp, ki, 0.0), x, v)
    assert got == pytest.approx(lost, abs=1e-9 * turnover)
    assert got <= 1e-9 * turnover
    law = LAW._replace(station=station)
    got, turnover, lost = energies(law, Gains(kp, ki, 0.0), x, v)
    corner = 40 * 3e4 * (np.abs(v).max() * DT) ** 2
    assert got <= lost + corner + 1e-9 * turnover
    undamped = law._replace(soft_damping=0.0)
    got, turnover, lost = energies(undamped, Gains(kp, ki, 0.0), x, v)
    assert got == pytest.approx(lost, abs=corner + 1e-9 * turnover)


@settings(max_examples=examples(60))
@given(Motions)
def test_contact_with_the_soft_stop_dissipates_energy(parts: list[tuple[float, int]]) -> None:
    x, v = travel(parts, 4.0)
    got, turnover, _ = energies(LAW._replace(station=0.0), Gains(0.0, 0.0, 0.0), x, v)
    met = np.abs(x).max() > 0.25
    assert got <= (-1e-3 * turnover if met else 40 * 3e4 * (np.abs(v).max() * DT) ** 2)


def test_a_released_body_comes_to_rest_at_the_station() -> None:
    """1420 kg in surge with a guide of 20 kN/m, released beyond reach, only loses energy."""
    state, x, v, mass, guide = settled(DEFAULT), 0.6, 0.0, 1420.0, 2e4
    energies_seen = []
    for _ in range(20_000):
        state, demand = station_keeping.step(LAW, state, DEFAULT, Estimate(x, v, 0.0), DT)
        v += DT * (demand.force - guide * (x - 0.04)) / mass
        x += DT * v
        depth = max(abs(x - 0.04) - LAW.reach, 0.0)
        energy = mass * v * v + guide * (x - 0.04) ** 2 + LAW.soft_stiffness * depth**2
        energies_seen.append(0.5 * energy)
    assert (
        max(np.diff(energies_seen)) <= 1e-4 * energies_seen[0]
    )  # energy ripple of symplectic Euler
    assert energies_seen[-1] <= 1e-4 * energies_seen[0]


# --- input that is not finite


@pytest.mark.parametrize("bad", WEIRD)
@pytest.mark.parametrize("x", [0.0, 0.5, -0.5])
def test_input_that_is_not_finite_gives_output_that_is_not_finite(bad: float, x: float) -> None:
    for motion in (Estimate(bad, 0.1, 0.0), Estimate(x, bad, 0.0)):
        for gains in (DEFAULT, Gains(0.0, 0.0, 0.0), Gains(-100.0, -100.0, 0.0)):
            _, demand = station_keeping.step(LAW, settled(gains), gains, motion, DT)
            assert not finite(demand.force)
    for gains in (Gains(bad, 0.0, 0.0), Gains(0.0, bad, 0.0)):
        state = settled(DEFAULT)
        _, demand = station_keeping.step(LAW, state, gains, Estimate(x, 0.2, 0.0), DT)
        assert not finite(demand.force) or bad == math.inf  # plus infinity counts as zero


def test_a_restarted_law_has_no_memory() -> None:
    none = (0.0, 0.0, 0.0)
    assert station_keeping.start() == (none, none, none, none, 0.0)
    motion = Estimate(0.9, -3.0, 0.0)
    _, demand = station_keeping.step(LAW, station_keeping.start(), DEFAULT, motion, DT)
    assert demand[:3] == pytest.approx((-50.0, 0.0, 0.0))
