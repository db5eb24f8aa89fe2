"""The periodic solution against time integration and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.fft import next_fast_len
from scipy.integrate import solve_ivp

from rig.design.grid import (
    Floats,
    build_grid,
    samples_from_spectrum,
    spectrum_from_amplitudes,
)
from rig.design.steady_motion import TOLERANCE, Motion, System, solve_steady_motion

MASS, DAMPING, STIFFNESS = 10.0, 4.0, 90.0


def solve(
    period: float, forces: dict[int, complex], passive: object, loop: complex = 0.0
) -> Motion:
    sampling_grid = build_grid(period)
    s = 1j * sampling_grid.omega
    excitation = spectrum_from_amplitudes(
        sampling_grid,
        np.array(list(forces)),
        np.conj(np.array(list(forces.values()), dtype=complex)),
    )
    body = (MASS * s * s + DAMPING * s + STIFFNESS)[None, :]
    ones = np.ones(sampling_grid.omega.size, dtype=complex)
    return solve_steady_motion(
        sampling_grid,
        System(
            body, excitation, loop * ones[None, :], 0.0 * ones[None, :], ones, passive, unsaturated
        ),
    )  # type: ignore[arg-type]


def unsaturated(demand: Floats, x: Floats, v: Floats) -> Floats:
    return demand


def integrate(
    period: float, forces: dict[int, complex], force: object, samples: int
) -> tuple[Floats, Floats]:
    """Return position and velocity of the same oscillator over one period, after its transient."""

    def external_force(t: float) -> float:
        phase = 2j * math.pi * t / period
        return sum((f * np.exp(k * phase)).real for k, f in forces.items())

    def slope(t: float, state: Floats) -> list[float]:
        x, v = state
        internal_force = -DAMPING * v - STIFFNESS * x + force(x, v)  # type: ignore[operator]
        return [v, (external_force(t) + internal_force) / MASS]

    start = math.ceil(60.0 / period) * period
    times = start + period * np.arange(samples) / samples
    solution = solve_ivp(slope, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-11)
    return solution.y[0], solution.y[1]


def nonlinear(x: Floats, v: Floats) -> Floats:
    """Quadratic drag, friction and a hardening spring, all as large as the linear forces."""
    return -8.0 * np.abs(v) * v - 3.0 * np.tanh(v / 0.05) - 60.0 * x * x * x


@pytest.mark.parametrize(
    "forces", [{1: 40.0 + 0j}, {1: 15.0 + 0j, 2: 20.0j, 5: -12.0 + 4.0j}], ids=["one", "three"]
)
def test_against_time_integration(forces: dict[int, complex]) -> None:
    period = 2.5
    motion = solve(period, forces, nonlinear)
    x, v = integrate(period, forces, nonlinear, motion.position.shape[1])
    rms_expected = float(np.std(x))
    assert motion.change[0] < TOLERANCE
    np.testing.assert_allclose(motion.position[0], x, atol=2e-3 * rms_expected)
    np.testing.assert_allclose(motion.velocity[0], v, atol=4e-3 * float(np.std(v)))
    rms = float(np.std(motion.position[0]))
    assert rms == pytest.approx(rms_expected, rel=3e-4)


def test_a_linear_system_converges_in_two_iterations() -> None:
    motion = solve(2.0, {1: 10.0 + 0j}, lambda x, v: 0.0 * x)
    s = 1j * math.pi
    amplitude = abs(10.0 / (MASS * s * s + DAMPING * s + STIFFNESS))
    assert float(np.max(motion.position)) == pytest.approx(amplitude, rel=1e-4)
    assert motion.iterations <= 2


def test_no_excitation_gives_no_motion() -> None:
    motion = solve(2.0, {1: 0j}, nonlinear)
    assert not np.any(motion.position)
    assert motion.iterations == 0


def test_a_saturated_demand_cannot_restrain_the_body() -> None:
    """A stiff loop with a small force limit: the force saturates, motion is as without the loop."""
    sampling_grid = build_grid(2.0)
    s = 1j * sampling_grid.omega
    body = (MASS * s * s + DAMPING * s + STIFFNESS)[None, :]
    ones = np.ones(sampling_grid.omega.size, dtype=complex)
    excitation = spectrum_from_amplitudes(sampling_grid, np.array([1]), np.array([50.0 + 0j]))
    loop = np.full((1, sampling_grid.omega.size), -400.0 + 0j)
    unlimited = System(body, excitation, loop, 0.0 * loop, ones, lambda x, v: 0.0 * x, unsaturated)
    limited = unlimited._replace(saturation=lambda d, x, v: np.clip(d, -2.0, 2.0))
    without_loop = unlimited._replace(loop=0.0 * loop)
    rms_positions = [
        float(np.std(solve_steady_motion(sampling_grid, system).position))
        for system in (unlimited, limited, without_loop)
    ]
    motion = solve_steady_motion(sampling_grid, limited)
    assert np.abs(motion.motor_force).max() < 2.6  # Gibbs
    assert np.abs(motion.demand).max() > 100.0
    assert rms_positions[0] < 0.3 * rms_positions[2]
    assert rms_positions[1] == pytest.approx(rms_positions[2], rel=0.15)


def test_samples_of_a_spectrum() -> None:
    sampling_grid = build_grid(20.0)
    t = np.arange(sampling_grid.samples) * sampling_grid.step
    samples = samples_from_spectrum(
        sampling_grid,
        spectrum_from_amplitudes(sampling_grid, np.array([3, 7]), np.array([2.0 + 1.0j, 0.5j])),
    )
    w = 2.0 * math.pi / 20.0
    expected = ((2.0 + 1.0j) * np.exp(-3j * w * t) + 0.5j * np.exp(-7j * w * t)).real
    np.testing.assert_allclose(samples, expected, atol=1e-12)


def test_the_samples_of_a_period_are_the_fewest_with_a_quick_transform() -> None:
    for period in (*range(1, 2000, 7), 7.3, 3600.0, 36000.0):
        least = math.ceil(max(512, math.ceil(32.0 * period)) / 2)
        assert build_grid(period).samples == 2 * next_fast_len(least, real=True)
