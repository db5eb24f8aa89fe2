"""Laws at the edges: starts, ramps, noise around a standstill, NaN, and a reference."""

from __future__ import annotations

import math
from itertools import pairwise
from types import ModuleType
from typing import Any

import pytest

from controllers import (
    declutching,
    latching,
    nonlinear_damping,
    positioning,
    turning_point,
    velocity_table,
)
from controllers.signals import Estimate

DT = 1e-3
RAMP = 0.5  # s
CASES: dict[str, tuple[ModuleType, dict[str, tuple[float, ...]], Any]] = {
    "table": (
        velocity_table,
        {"velocity_m_per_s": (-1.0, 1.0), "force_n": (500.0, -500.0)},
        velocity_table.SetPoint(1.0, 1.0),
    ),
    "nonlinear": (
        nonlinear_damping,
        {"smoothing_m_per_s": (0.01,)},
        nonlinear_damping.SetPoint(300.0, 100.0),
    ),
    "latching": (
        latching,
        {
            "hold_stiffness_n_per_m": (1e6,),
            "hold_damping_n_s_per_m": (1e4,),
            "arming_speed_m_per_s": (0.02,),
        },
        latching.SetPoint(-400.0, 0.3),
    ),
    "declutching": (
        declutching,
        {"arming_speed_m_per_s": (0.02,)},
        declutching.SetPoint(-400.0, 0.3),
    ),
    "positioning": (
        positioning,
        {
            "hold_stiffness_n_per_m": (1e4,),
            "hold_damping_n_s_per_m": (400.0,),
            "speed_m_per_s": (0.02,),
            "acceleration_m_per_s2": (0.1,),
        },
        positioning.SetPoint(0.0),
    ),
}


@pytest.fixture(params=CASES, name="case")
def of_case(request: pytest.FixtureRequest) -> tuple[ModuleType, Any, Any]:
    """A law, its constants, and a set point."""
    law, settings, setpoint = CASES[request.param]
    return law, law.params(settings, RAMP, DT), setpoint


def test_columns_and_set_point_are_the_same_names(case: tuple[ModuleType, Any, Any]) -> None:
    law, _, setpoint = case
    assert tuple(column.name for column in law.COLUMNS) == setpoint._fields
    assert all(column.low < column.high and column.help.endswith(".") for column in law.COLUMNS)


def test_the_first_force_is_small_and_grows_with_the_ramp(
    case: tuple[ModuleType, Any, Any],
) -> None:
    law, params, setpoint = case
    state, forces = law.start(params), []
    for _ in range(round(2 * RAMP / DT)):
        state, demand = law.step(params, state, setpoint, Estimate(0.1, 0.5, 0.0), 0.0, 0.0, DT)
        forces.append(demand.force)
    final = forces[-1]
    assert final < 0.0  # against the velocity
    assert 0.0 <= forces[0] / final < 0.01
    assert max(abs(a - b) for a, b in pairwise(forces)) < 0.01 * abs(final)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_not_finite_gives_no_finite_force(
    case: tuple[ModuleType, Any, Any], bad: float
) -> None:
    law, params, setpoint = case
    state = law.start(params)
    for velocity in (0.5, 0.5, bad):
        motion = Estimate(velocity, velocity, 0.0)
        state, demand = law.step(params, state, setpoint, motion, 0.0, 0.0, DT)
    assert not math.isfinite(demand.force)


def test_the_reference_is_added_as_it_is(case: tuple[ModuleType, Any, Any]) -> None:
    law, params, setpoint = case
    still = Estimate(0.0, 0.0, 0.0)
    _, demand = law.step(params, law.start(params), setpoint, still, 12.5, 0.0, DT)
    assert demand.force == 12.5


def test_noise_around_a_standstill_has_no_turning_points() -> None:
    state, turns = turning_point.start(), 0
    for tick in range(1000):
        state, turned = turning_point.step(state, 0.019 * (-1.0) ** tick, 0.02)
        turns += turned
    assert turns == 0


def test_a_swing_has_two_turning_points_a_period() -> None:
    state, turns = turning_point.start(), []
    for tick in range(4000):
        noise = 0.01 * (-1.0) ** tick
        velocity = 0.5 * math.cos(2.0 * math.pi * tick * DT) + noise
        state, turned = turning_point.step(state, velocity, 0.02)
        if turned:
            turns.append(tick * DT)
    expected = [0.25 + 0.5 * count for count in range(8)]
    # Noise of 0.01 m/s moves the zero of a velocity that falls by 3.1 m/s^2 by 3 ms.
    assert turns == pytest.approx(expected, abs=0.005)


def test_latching_without_a_time_is_a_damper() -> None:
    law, settings, _ = CASES["latching"]
    params, never = law.params(settings, 0.0, DT), latching.SetPoint(-400.0, 0.0)
    state = law.start(params)
    for tick in range(3000):
        velocity = 0.5 * math.cos(2.0 * math.pi * tick * DT)
        motion = Estimate(0.0, velocity, 0.0)
        state, demand = law.step(params, state, never, motion, 0.0, 0.0, DT)
        assert demand.force == -400.0 * velocity
