"""Parts of plants against their closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from sim_plant.parts import bus, drag, end_stop, friction, gear, hydraulic, linear_motor, spring
from sim_plant.parts import mooring_line as lines
from sim_plant.parts.bus import BusParams
from sim_plant.parts.end_stop import EndStopParams
from sim_plant.parts.friction import FrictionParams
from sim_plant.parts.hydraulic import HydraulicParams
from sim_plant.parts.mooring_line import LineParams
from sim_plant.parts.spring import MagneticParams, SpringParams

AMPLITUDE, OMEGA = 0.8, 2.5  # of a sinusoidal velocity, m/s and rad/s
OIL = HydraulicParams(
    area=0.005, displacement=2.0e-5, low_pressure=5.0e5, precharge=4.0e6, volume=0.01,
    least_volume=0.004, exponent=1.4, leakage=0.0, inertia=0.05, viscous=0.01,
    valve_width=0.01,
)  # fmt: skip


def mean_power(force: object, velocity: float = AMPLITUDE) -> float:
    """Return the mean of force times velocity over a period of a sinusoidal velocity."""
    assert callable(force)
    phase = (np.arange(100_000) + 0.5) * 2.0 * np.pi / 100_000
    speeds = velocity * np.sin(phase)
    return float(np.mean([force(v) * v for v in speeds]))


def test_friction_takes_the_power_of_viscous_and_coulomb_friction() -> None:
    """B V²/2 + 2/pi F_c V; the width of the sign costs (v_c / V)², 6e-6."""
    params = FrictionParams(30.0, 50.0, 0.002)
    expected = -(30.0 * AMPLITUDE**2 / 2.0 + 2.0 / math.pi * 50.0 * AMPLITUDE)
    assert mean_power(lambda v: friction.force(params, v)) == pytest.approx(expected, rel=1e-4)


def test_drag_takes_the_power_of_its_equivalent_linear_damping() -> None:
    """8 / (3 pi) c V (H. A. Lorentz) damps as much in a period as c |v|: 4 / (3 pi) c V³."""
    expected = -(20.0 * AMPLITUDE**2 / 2.0 + 4.0 / (3.0 * math.pi) * 300.0 * AMPLITUDE**3)
    assert mean_power(lambda v: drag.force(20.0, 300.0, v)) == pytest.approx(expected, rel=1e-8)


def test_end_stops_are_springs_that_never_pull() -> None:
    params = EndStopParams(0.1, 1.0e4, 200.0)
    assert end_stop.force(params, 0.12, 0.0) == pytest.approx(-200.0)
    assert end_stop.force(params, -0.12, 0.0) == pytest.approx(200.0)
    assert end_stop.force(params, 0.12, 0.5) == pytest.approx(-300.0)
    assert end_stop.force(params, 0.12, -2.0) == 0.0  # it leaves faster than the spring pushes
    assert end_stop.force(params, -0.12, 2.0) == 0.0
    assert [end_stop.force(params, x, 9.0) for x in (-0.1, 0.0, 0.1)] == [0.0, 0.0, 0.0]


def test_an_undamped_end_stop_returns_its_energy() -> None:
    params = EndStopParams(0.1, 1.0e4, 0.0)
    work, _ = quad(lambda x: end_stop.force(params, x, 0.0), 0.0, 0.15, points=[0.1])
    assert work == pytest.approx(-0.5 * 1.0e4 * 0.05**2)


def test_a_gear_loses_its_share_of_the_power_in_both_directions() -> None:
    for velocity in (0.5, -0.5):
        for force in (400.0, -400.0):
            lost = gear.load_loss(0.93, 0.002, force, velocity) * velocity
            assert lost == pytest.approx(-0.07 * 400.0 * 0.5)


def test_backlash_transmits_only_beyond_the_gap() -> None:
    params = EndStopParams(0.01, 1.0e5, 0.0)
    twist = np.array([-0.012, -0.01, 0.0, 0.01, 0.012])
    force = [gear.backlash_force(params, x, 0.0) for x in twist]
    assert force == pytest.approx([-200.0, 0.0, 0.0, 0.0, 200.0])


def test_cogging_has_a_potential() -> None:
    work, _ = quad(lambda x: linear_motor.cogging_force(20.0, 0.03, x), 0.0, 0.015)
    assert work == pytest.approx(-20.0 * 0.03 / math.pi)
    work, _ = quad(lambda x: linear_motor.cogging_force(20.0, 0.03, x), 0.004, 0.034)
    assert work == pytest.approx(0.0, abs=1e-9)


def test_a_linear_spring_stores_the_work_on_it() -> None:
    """From its rest at F_0 / k = 0.02 m to 0.1 m: k d² / 2; a negative rate gives that work."""
    for rate in (5000.0, -5000.0):
        params = SpringParams(rate, 0.02 * rate)
        assert spring.force(params, 0.02) == 0.0
        work, _ = quad(lambda x, p=params: spring.force(p, x), 0.02, 0.1)
        assert work == pytest.approx(-0.5 * rate * 0.08**2)


def test_both_forces_of_a_magnetic_spring_are_those_of_one_energy() -> None:
    """Round a closed path of axis and stator they do no work; so the energy has one value."""
    params = MagneticParams(1.0 / 0.3, 0.045, 7.0)
    first, slope = 4000.0, -30_000.0  # of the rate, N/m and N/m per m of the stator

    def sides(x: float, z: float) -> tuple[float, float]:
        return spring.magnetic_forces(params, first + slope * z, slope, x)

    path = np.linspace(0.0, 2.0 * np.pi, 2001)
    middle = 0.5 * (path[:-1] + path[1:])
    work = moved = 0.0
    for start, end, at in zip(path[:-1], path[1:], middle, strict=True):
        f, s = sides(0.1 + 0.2 * math.cos(at), 0.04 + 0.06 * math.sin(at))
        axis = 0.2 * (math.cos(end) - math.cos(start))
        stator = 0.06 * (math.sin(end) - math.sin(start))
        work += f * axis + s * stator
        moved += abs(f * axis)
    assert moved > 100.0
    assert abs(work) < 1e-5 * moved  # the chords of 2000 steps leave 2e-6


def test_the_rate_of_a_magnetic_spring_and_its_period_over_the_angle() -> None:
    params = MagneticParams(1.0 / 0.3, 0.3**2 / 2.0, 0.0)
    small = spring.magnetic_forces(params, 4000.0, 0.0, 1.0e-5).axis
    assert small == pytest.approx(-4000.0 * 1.0e-5, rel=1e-8)
    for turn in (0.5 * math.pi, math.pi):  # of the rotor: no force, and unstable, at a quarter
        assert spring.magnetic_forces(params, 4000.0, 0.0, 0.3 * turn).axis == pytest.approx(
            0.0, abs=1e-9
        )
    beyond = spring.magnetic_forces(params, 4000.0, 0.0, 0.3 * (0.5 * math.pi + 0.1)).axis
    assert beyond == pytest.approx(0.5 * 4000.0 * 0.3 * math.sin(0.2))


def stiffness(params: LineParams, step: float = 1.0e-6) -> np.ndarray:
    """Return minus the derivative of the force by the displacement of the fairlead."""
    columns = []
    for axis in range(3):
        ends = []
        for sign in (1.0, -1.0):
            d = [0.0, 0.0, 0.0]
            d[axis] = sign * step
            ends.append(np.array(lines.pull(params, *d, 0.0, 0.0, 0.0)[1:]))
        columns.append(-(ends[0] - ends[1]) / (2.0 * step))
    return np.array(columns).T


def test_a_line_has_the_stiffness_of_a_taut_string() -> None:
    """Axially k, across T0 / L; central differences of 1e-6 m leave 1e-7 of that."""
    params = LineParams(0.0, 0.0, 2.0, 285.0, 963.0, 0.0)
    expected = np.diag([285.0 / 2.0, 285.0 / 2.0, 963.0])
    np.testing.assert_allclose(stiffness(params), expected, atol=1e-4)


def test_four_lines_hold_a_spar() -> None:
    """LUPA (Oregon State University): 4 lines, 285 N, 963 N/m, fairleads (±.19, ±.19, -.228) m,
    anchors (±1.95, ±1.6, -.368) m. Its tutorial has 504.8 N/m in heave by a formula that squares
    the vertical distance, and 2178 N/m in surge for lines at 45 degrees: the mean of surge, sway.
    """
    total = np.zeros((3, 3))
    for sx in (1.0, -1.0):
        for sy in (1.0, -1.0):
            vector = (sx * (0.19 - 1.95), sy * (0.19 - 1.6), -0.228 + 0.368)
            total += stiffness(LineParams(*vector, 285.0, 963.0, 0.0))
    assert total[2, 2] == pytest.approx(517.4, rel=2e-4)
    assert total[0, 0] == pytest.approx(2535.6, rel=1e-4)
    assert total[1, 1] == pytest.approx(1808.0, rel=1e-4)
    assert 0.5 * (total[0, 0] + total[1, 1]) == pytest.approx(2178.0, rel=4e-3)


def test_a_line_goes_slack_and_its_force_at_rest_is_taken_off() -> None:
    params = LineParams(0.0, 0.0, 2.0, 100.0, 1000.0, 50.0)
    assert lines.pull(params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) == (100.0, 0.0, 0.0, 0.0)
    slack = lines.pull(params, 0.0, 0.0, -0.2, 0.0, 0.0, 0.0)
    assert slack == (0.0, 0.0, 0.0, 100.0)
    moving = lines.pull(params, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4)
    assert moving == pytest.approx((120.0, 0.0, 0.0, -20.0))


def test_gas_follows_its_polytrope() -> None:
    for pressure in (4.0e6, 6.0e6, 12.0e6):
        volume = hydraulic.volume_at(OIL, pressure)
        assert pressure * volume**1.4 == pytest.approx(4.0e6 * 0.01**1.4)
        if pressure > 4.0e6:
            assert hydraulic.pressure(OIL, volume) == pytest.approx(pressure)
    empty = 0.01 * (1.0 + hydraulic.COMPLIANCE)
    assert hydraulic.pressure(OIL, 0.5 * (0.01 + empty)) == pytest.approx(2.25e6)
    assert hydraulic.pressure(OIL, 1.01 * empty) == pytest.approx(OIL.low_pressure)
    assert hydraulic.volume_rate(OIL, empty, 0.0, 100.0) == 0.0
    assert hydraulic.volume_rate(OIL, 0.004, 1.0, 0.0) == 0.0  # the relief valve is open


def test_the_oil_takes_the_power_of_the_cylinder() -> None:
    volume = hydraulic.volume_at(OIL, 6.0e6)
    for velocity in (-0.6, 0.004, 0.6):
        power = hydraulic.cylinder_force(OIL, 6.0e6, velocity) * velocity
        inflow = -hydraulic.volume_rate(OIL, volume, velocity, 0.0)
        assert -power == pytest.approx((6.0e6 - 5.0e5) * inflow, rel=1e-9)
        assert power < 0.0


def test_a_hydraulic_motor_runs_at_the_speed_at_which_torques_balance() -> None:
    speed = 150.0
    torque = OIL.displacement * 5.5e6 - OIL.viscous * speed
    brake = hydraulic.brake_torque(-torque, speed)
    assert hydraulic.acceleration(OIL, 6.0e6, speed, brake) == pytest.approx(0.0, abs=1e-9)
    assert hydraulic.brake_torque(torque, 0.0) == 0.0  # a brake does not turn a standing shaft


def test_the_bus_stores_what_flows_in_less_what_flows_out() -> None:
    params = BusParams(0.05, 60.0, 0, 0.0, 1.0, 80.0, 70.0, 0.1, 1, 30.0, 20.0, 120.0, 0.1)
    state = bus.initial(params)
    for _ in range(500):
        state = bus.bus_step(params, state, -100.0, 1.0e-3)
    assert state.voltage == pytest.approx(math.sqrt(60.0**2 + 2.0 * 50.0 / 0.05), rel=1e-9)
    while state.dumping == 0:
        state = bus.bus_step(params, state, -100.0, 1.0e-3)
    assert state.voltage == pytest.approx(80.0, rel=1e-3)
    at, steps = state.voltage, 0
    while state.dumping == 1:
        state, steps = bus.bus_step(params, state, 0.0, 1.0e-5), steps + 1
    expected = 0.05 / 0.1 * math.log(at / 70.0)  # R C ln(V1 / V2)
    assert steps * 1.0e-5 == pytest.approx(expected, rel=1e-3)
