"""Magnetic spring and stator actuator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plant_files import changed, plant

from sim_plant.magnetic_spring import (
    StatorState,
    fit_slope,
    force,
    rotor_angle,
    stator_at_rest,
    stator_step,
    table_rate,
)

DT = 0.001
STATIONS = (-93.0, -73.0, -53.0, -33.0, -13.0, 7.0, 27.0, 47.0, 67.0)
TABLE_4_1 = (8340.0, 7670.0, 5873.0, 3379.0, 490.9, -2763.0, -5715.0, -8508.0, -10013.0)


@pytest.mark.parametrize(("station", "rate"), list(zip(STATIONS, TABLE_4_1, strict=True)))
def test_fitted_slope_is_table_4_1(station: float, rate: float) -> None:
    spring = plant().build().spring
    x = np.radians(np.linspace(-39.27, 39.27, 4001)) * 0.33047
    pull = np.array([force(spring, table_rate(spring, station), float(xi)) for xi in x])
    assert -np.polyfit(x, pull, 1)[0] == pytest.approx(rate, rel=2e-3)


@pytest.mark.parametrize(("station", "torque"), [(67.0, 663.0), (-93.0, 552.0)])
def test_peak_torque(station: float, torque: float) -> None:
    spring = plant().build().spring
    at_45_degrees = math.pi / 4 * 0.33047
    peak = abs(force(spring, table_rate(spring, station), at_45_degrees)) * 0.33047
    assert peak == pytest.approx(torque, abs=0.5)


@pytest.mark.parametrize(
    ("stroke", "share"), [(1e-4, 1.213), (0.10, 1.16), (0.20, 1.00), (0.30, 0.78)]
)
def test_rate_falls_with_amplitude(stroke: float, share: float) -> None:
    """Describing function (first harmonic) over one cycle of a stroke amplitude."""
    spring = plant().build().spring
    turn = np.linspace(0, 2 * np.pi, 721)[:-1]
    pull = [force(spring, -5715.0, float(stroke * np.sin(a))) for a in turn]
    rate = -2 / stroke * float(np.mean(pull * np.sin(turn)))
    assert rate / -5715.0 == pytest.approx(share, abs=0.01)


def test_effect_scales_and_linear_law_is_linear() -> None:
    soft = plant("wavebot_as_measured").build().spring
    assert table_rate(soft, 67.0) == pytest.approx(-0.539 * 10013.0)
    line = plant("wavebot_linear").build().spring
    assert force(line, table_rate(line, 27.0), 0.3) == 5715.0 * 0.3


def test_between_and_beyond_the_stations() -> None:
    spring = plant().build().spring
    assert table_rate(spring, 17.0) == pytest.approx(0.5 * (-2763.0 - 5715.0))
    assert table_rate(spring, -200.0) == 8340.0
    assert table_rate(spring, 200.0) == -10013.0
    assert fit_slope(math.pi / 4 - 0.1) == pytest.approx(1.649, abs=1e-3)
    assert rotor_angle(spring, 0.33047) == pytest.approx(1.0)
    assert force(spring, 1.0, math.inf) == 0.0


def travel(target: float, enable: int = 1, ticks: int = 20000) -> tuple[int, StatorState]:
    spring = plant().build().spring
    state = stator_at_rest(spring, -13.0)
    for k in range(ticks):
        state = stator_step(spring, state, target, enable, DT)
        if state.arrived == 1:
            return k + 1, state
    return ticks, state


def test_stator_travel_time() -> None:
    """40 % of 0.15 m per 100 % at 10 mm/s: 6 s, and arrival one tick at rest later."""
    ticks, state = travel(27.0)
    assert ticks * DT == pytest.approx(6.0, abs=0.003)
    assert state == stator_at_rest(plant().build().spring, 27.0)
    assert state.rate == -5715.0


@pytest.mark.parametrize("target", [90.0, -99.0, math.nan, math.inf])
def test_stator_never_arrives_beyond_its_ends(target: float) -> None:
    assert travel(target)[1].arrived == 0


def test_stator_holds_when_disabled() -> None:
    assert travel(27.0, enable=0, ticks=100)[1] == stator_at_rest(
        plant().build().spring, -13.0
    )._replace(arrived=0)


def test_stator_starts_on_the_table() -> None:
    assert changed(stator__start=7).stator.start.value == 7
    with pytest.raises(ValueError, match="outside the spring table"):
        changed(stator__start=95.0)
