"""The periodic solution against time integration, and its equivalents against published ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig.design.predictions.grid import Floats, grid, lines, record
from rig.design.predictions.steady import CLOSE, Motion, System, steady

MASS, DAMPING, STIFFNESS = 10.0, 4.0, 90.0


def solved(
    period: float, forces: dict[int, complex], passive: object, loop: complex = 0.0
) -> Motion:
    on = grid(period)
    s = 1j * on.omega
    excitation = lines(
        on, np.array(list(forces)), np.conj(np.array(list(forces.values()), dtype=complex))
    )
    body = (MASS * s * s + DAMPING * s + STIFFNESS)[None, :]
    one = np.ones(on.omega.size, dtype=complex)
    return steady(
        on, System(body, excitation, loop * one[None, :], 0.0 * one[None, :], one, passive)
    )  # type: ignore[arg-type]


def integrated(
    period: float, forces: dict[int, complex], force: object, samples: int
) -> tuple[Floats, Floats]:
    """Position and velocity of the same oscillator once its start is forgotten, one period."""

    def pushed(t: float) -> float:
        turn = 2j * math.pi * t / period
        return sum((f * np.exp(k * turn)).real for k, f in forces.items())

    def slope(t: float, state: Floats) -> list[float]:
        x, v = state
        free = -DAMPING * v - STIFFNESS * x + force(x, v)  # type: ignore[operator]
        return [v, (pushed(t) + free) / MASS]

    begin = math.ceil(60.0 / period) * period
    at = begin + period * np.arange(samples) / samples
    out = solve_ivp(slope, (0.0, at[-1]), [0.0, 0.0], t_eval=at, rtol=1e-9, atol=1e-11)
    return out.y[0], out.y[1]


def nonlinear(x: Floats, v: Floats) -> Floats:
    """Quadratic drag, friction and a spring that hardens, all as large as the linear forces."""
    return -8.0 * np.abs(v) * v - 3.0 * np.tanh(v / 0.05) - 60.0 * x * x * x


@pytest.mark.parametrize(
    "forces", [{1: 40.0 + 0j}, {1: 15.0 + 0j, 2: 20.0j, 5: -12.0 + 4.0j}], ids=["one", "three"]
)
def test_against_time_integration(forces: dict[int, complex]) -> None:
    period = 2.5
    found = solved(period, forces, nonlinear)
    x, v = integrated(period, forces, nonlinear, found.position.shape[1])
    size = float(np.std(x))
    assert found.change[0] < CLOSE
    np.testing.assert_allclose(found.position[0], x, atol=2e-3 * size)
    np.testing.assert_allclose(found.velocity[0], v, atol=4e-3 * float(np.std(v)))
    rms = float(np.std(found.position[0]))
    assert rms == pytest.approx(size, rel=3e-4)


def test_nothing_but_linear_needs_one_round() -> None:
    found = solved(2.0, {1: 10.0 + 0j}, lambda x, v: 0.0 * x)
    s = 1j * math.pi
    amplitude = abs(10.0 / (MASS * s * s + DAMPING * s + STIFFNESS))
    assert float(np.max(found.position)) == pytest.approx(amplitude, rel=1e-4)
    assert found.rounds <= 2


def test_still_water_moves_nothing() -> None:
    found = solved(2.0, {1: 0j}, nonlinear)
    assert not np.any(found.position)
    assert found.rounds == 0


def test_a_cut_demand_cannot_hold_the_body() -> None:
    """A stiff loop with a small largest force: force at its bound, motion near that without it."""
    on = grid(2.0)
    s = 1j * on.omega
    body = (MASS * s * s + DAMPING * s + STIFFNESS)[None, :]
    one = np.ones(on.omega.size, dtype=complex)
    excitation = lines(on, np.array([1]), np.array([50.0 + 0j]))
    loop = np.full((1, on.omega.size), -400.0 + 0j)
    held = System(body, excitation, loop, 0.0 * loop, one, lambda x, v: 0.0 * x)
    cut = held._replace(granted=lambda d, x, v: np.clip(d, -2.0, 2.0))
    free = held._replace(loop=0.0 * loop)
    strokes = [float(np.std(steady(on, each).position)) for each in (held, cut, free)]
    found = steady(on, cut)
    assert np.abs(found.motor).max() < 2.6  # Gibbs
    assert np.abs(found.demand).max() > 100.0
    assert strokes[0] < 0.3 * strokes[2]
    assert strokes[1] == pytest.approx(strokes[2], rel=0.15)


def test_lines_and_samples_are_one_thing() -> None:
    on = grid(20.0)
    t = np.arange(on.samples) * on.step
    found = record(on, lines(on, np.array([3, 7]), np.array([2.0 + 1.0j, 0.5j])))
    w = 2.0 * math.pi / 20.0
    told = ((2.0 + 1.0j) * np.exp(-3j * w * t) + 0.5j * np.exp(-7j * w * t)).real
    np.testing.assert_allclose(found, told, atol=1e-12)
