"""Axial force of the magnetic spring's stator: one energy with the torque, reversal, load cells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from plant_files import DT, QUIET, changed, command, plant, world
from test_plant_spring import STATIONS, TABLE_4_1

from sim_plant.magnetic_spring import force, stator_at_rest, table_rate, table_slope
from sim_plant.stator_force import ForceReversal, axial_force, force_reversal, torque

LEVER = 0.33047  # m/rad


class Spring(NamedTuple):
    """Torque (N m) and axial force (N) over rotor angle and axial position (m)."""

    name: str = "wavebot"

    def torque(self, angle: float, z: float) -> float:
        params = plant(self.name).build()
        return torque(params.stator, table_rate(params.spring, z / 0.0015), angle)

    def axial(self, angle: float, z: float) -> float:
        params = plant(self.name).build()
        state = stator_at_rest(params.spring, z / 0.0015)
        return axial_force(params.stator, state.rate, state.slope, angle)


def reversal_at(station: float, name: str = "wavebot") -> ForceReversal:
    params = plant(name).build()
    return force_reversal(params.stator, params.spring, station)


@pytest.mark.parametrize("name", ["wavebot", "wavebot_linear", "wavebot_as_measured"])
@pytest.mark.parametrize("station", [-80.0, -13.0, -10.0, 5.0, 50.0])
def test_torque_and_axial_force_have_one_energy(name: str, station: float) -> None:
    """No work over a closed path in (angle, position): d T/d z = d F_stator/d angle."""
    spring = Spring(name)
    z, half = 0.0015 * station, 1e-4
    for angle in (-0.9, -0.3, 0.0, 0.2, 0.7, 1.1):
        torque_slope = (spring.torque(angle, z + half) - spring.torque(angle, z - half)) / (
            2 * half
        )
        axial_slope = (spring.axial(angle + half, z) - spring.axial(angle - half, z)) / (2 * half)
        assert torque_slope == pytest.approx(axial_slope, rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("station", [-53.0, -20.0, 7.0, 35.0])
def test_torque_and_force_are_derivatives_of_the_energy(station: float) -> None:
    """W(theta, z) = -1/2 Tp cos 2 theta + 10 integral |Tp| dz, differentiated numerically."""
    spring = Spring()

    def peak(z: float) -> float:
        return float(np.interp(z / 0.0015, STATIONS, TABLE_4_1)) * LEVER**2 / 1.649

    def energy(angle: float, z: float) -> float:
        grid = np.linspace(-0.1395, z, 20001)
        pulled = np.trapezoid([abs(peak(x)) for x in grid], grid)
        return -0.5 * peak(z) * math.cos(2 * angle) + 10.0 * float(pulled)

    z, half = 0.0015 * station, 2e-5
    for angle in (0.0, 0.4, 0.9):
        energy_slope = (energy(angle, z + half) - energy(angle, z - half)) / (2 * half)
        turned = (energy(angle + half, z) - energy(angle - half, z)) / (2 * half)
        assert spring.axial(angle, z) == pytest.approx(energy_slope, rel=2e-3, abs=2.0)
        assert spring.torque(angle, z) == pytest.approx(turned, rel=1e-3, abs=0.01)


def test_the_slope_is_the_tables_central_difference() -> None:
    spring = plant().build().spring
    for station in (*STATIONS[1:-1], -40.0, 0.0, 60.0):
        central = (table_rate(spring, station + 0.5) - table_rate(spring, station - 0.5)) / 1.0
        assert table_slope(spring, station) == pytest.approx(central)
    assert table_slope(spring, -93.0) == table_slope(spring, -200.0) == pytest.approx(-670 / 20)
    assert table_slope(spring, 67.0) == table_slope(spring, 200.0) == pytest.approx(-1505 / 20)
    assert table_slope(spring, math.nan) == 0.0


def test_force_reverses_at_45_degrees_where_the_torque_is_zero() -> None:
    """Tp is zero at -9.98 %: there the sign changes at 45 degrees exactly, 0.2596 m of heave."""
    spring = plant().build().spring
    zero = -13.0 + 20.0 * 490.9 / (490.9 + 2763.0)
    assert table_rate(spring, zero) == pytest.approx(0.0, abs=1e-9)
    result = reversal_at(zero)
    assert math.degrees(result.angle) == pytest.approx(45.0, abs=1e-6)
    assert result.stroke == pytest.approx(0.2596, abs=1e-4)


@pytest.mark.parametrize(("station", "rate"), list(zip(STATIONS, TABLE_4_1, strict=True)))
def test_small_rates_reverse_beyond_45_degrees_and_large_ones_never(
    station: float, rate: float
) -> None:
    """MASK4 report (Sandia), Fig. 4-3: smaller-magnitude rates, at the extremes of motion."""
    result = reversal_at(station)
    spring = Spring()
    z = 0.0015 * station
    swept = [spring.axial(math.radians(a), z) for a in range(91)]
    if abs(rate) > 4800.0:
        assert result.angle == result.stroke == math.inf
        assert min(swept) > 0.0
    else:
        assert 45.0 < math.degrees(result.angle) < 70.0
        assert spring.axial(result.angle, z) == pytest.approx(0.0, abs=1e-6)
        assert spring.axial(result.angle - 0.01, z) > 0.0 > spring.axial(result.angle + 0.01, z)
        # inside the travel of the rotor, outside the linear region
        assert 0.231 < result.stroke < 0.66


def test_reversal_of_the_linear_spring() -> None:
    """cos 2 theta -> 1 - 2 theta²: 0.707 rad where the rate is zero."""
    zero = -13.0 + 20.0 * 490.9 / (490.9 + 2763.0)
    assert reversal_at(zero, "wavebot_linear").angle == pytest.approx(math.sqrt(0.5), abs=1e-6)


def test_torque_is_the_springs_force_on_its_lever() -> None:
    for name in ("wavebot", "wavebot_linear"):
        params = plant(name).build()
        for x in (-0.3, -0.02, 0.15):
            pull = force(params.spring, -5715.0, x)
            assert torque(params.stator, -5715.0, x / LEVER) == pytest.approx(-pull * LEVER)


def test_load_cells_read_torque_and_axial_force() -> None:
    """Slew T/0.254; stator A + B, A with 55 %; with bias, noise and resolution of the file."""
    quiet = world(stator__start=27.0, **QUIET)
    quiet.release(0.15)
    quiet.advance(DT)
    quiet.advance(DT)
    read, z = quiet.readings(), 0.0015 * 27.0
    spring, angle = Spring(), 0.15 / LEVER
    assert read.force_slew == pytest.approx(spring.torque(angle, z) / 0.254, rel=1e-4)
    assert read.force_slew < 0.0  # a negative rate pushes away from balance
    both = read.force_stator_a + read.force_stator_b
    assert both == pytest.approx(spring.axial(angle, z), rel=1e-4)
    assert read.force_stator_a == pytest.approx(0.55 * both)
    rig = world(stator__start=27.0)
    rows = []
    for _ in range(4000):
        rig.advance(DT)
        read = rig.readings()
        rows.append((read.force_slew, read.force_stator_a, read.force_stator_b))
    table = np.array(rows)
    axial = spring.axial(0.0, z)
    expected = np.array([8.0, 20.0 + 0.55 * axial, -12.0 + 0.45 * axial])
    np.testing.assert_allclose(table.mean(axis=0), expected, atol=0.5)
    np.testing.assert_allclose(table.std(axis=0), [3.0, 4.0, 4.0], rtol=0.06)
    assert np.all(np.abs(np.corrcoef(table.T)[np.triu_indices(3, 1)]) < 0.06)
    assert np.all(table / 0.25 == np.round(table / 0.25))


def test_effect_scales_torque_and_axial_force_alike() -> None:
    full, part = (changed(spring__spring_effect=effect).build() for effect in (1.0, 0.65))
    values = []
    for params in (full, part):
        state = stator_at_rest(params.spring, 40.0)
        values.append(axial_force(params.stator, state.rate, state.slope, 0.5))
    assert values[1] == pytest.approx(0.65 * values[0])


def test_the_stator_force_follows_a_moving_stator() -> None:
    """Across a table position the slope changes, and the force with it, without a lost sample."""
    rig = world(stator__start=5.0, **QUIET)
    samples = []
    for _ in range(2000):
        rig.actuate(command(heave_enable=0, stator_target=9.0, stator_enable=1))
        rig.advance(DT)
        read = rig.readings()
        samples.append((read.stator_position, read.force_stator_a + read.force_stator_b))
    for position, both in samples[::100]:
        state = stator_at_rest(rig.params.spring, position)
        expected = axial_force(rig.params.stator, state.rate, state.slope, 0.0)
        assert both == pytest.approx(expected, rel=1e-4, abs=1.0)
    assert samples[-1][0] == 9.0
