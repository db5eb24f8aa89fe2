"""Heave imposed by a hoist: tables, blending, forces, release."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plant_files import DT, QUIET, command, plant, world

from sim_plant.prescribed import blend_in, hoist_cycle_profile, table_profile


def test_a_table_is_followed_point_by_point() -> None:
    profile = table_profile([0.0, 10.0, 30.0, 40.0], [0.0, 0.2, -0.2, -0.2])
    assert [profile(t) for t in (-1.0, 0.0, 40.0, 50.0)] == [(0.0, 0.0)] * 2 + [(-0.2, 0.0)] * 2
    assert profile(10.0) == (pytest.approx(0.2), pytest.approx(0.0))
    times = np.linspace(0.0, 40.0, 40001)
    x, v = np.array([profile(float(t)) for t in times]).T
    assert x.min() == pytest.approx(-0.2)  # no overshoot
    assert x.max() == pytest.approx(0.2)
    np.testing.assert_allclose(np.gradient(x, times)[1:-1], v[1:-1], atol=1e-4)
    assert np.abs(np.diff(v)).max() < 1e-4


@pytest.mark.parametrize(
    ("times", "positions"),
    [([0.0], [0.0]), ([0.0, 1.0], [0.0]), ([0.0, 0.0], [0.0, 1.0]), ([0.0, 1.0], [0.0, math.nan])],
)
def test_invalid_motion_tables_are_refused(times: list[float], positions: list[float]) -> None:
    with pytest.raises(ValueError, match="motion table"):
        table_profile(times, positions)


def test_blend_is_smooth_from_any_motion() -> None:
    profile = blend_in(lambda t: (0.3 * math.sin(t), 0.3 * math.cos(t)), -0.1, 0.2, 2.0)
    assert profile(0.0) == (pytest.approx(-0.1), pytest.approx(0.2))
    times = np.linspace(0.0, 4.0, 40001)
    x, v = np.array([profile(float(t)) for t in times]).T
    np.testing.assert_allclose(np.gradient(x, times)[1:-1], v[1:-1], atol=1e-5)
    assert np.abs(np.diff(v)).max() / 1e-4 < 3.0  # m/s2
    assert profile(3.0) == (0.3 * math.sin(3.0), 0.3 * math.cos(3.0))


def test_hull_follows_the_hoist_and_sensors_keep_measuring() -> None:
    """Spring map: slow sweep through the stroke, drive off; load cells against the plant file."""
    rig = world(stator__start=47.0, **QUIET)
    sweep = table_profile([0.0, 20.0, 60.0], [0.0, 0.3, -0.3])
    rig.prescribe(sweep)
    for tick in range(60000):
        rig.actuate(command(heave_enable=0))
        rig.advance(DT)
        now = (tick + 1) * DT
        if now > 3.0 and tick % 500 == 0:
            x, v = sweep(now)
            truth, read = rig.truth(), rig._delay_line[-1]
            assert (truth.position, truth.velocity) == (pytest.approx(x), pytest.approx(v))
            friction = -(400.0 * v + 50.0 * math.tanh(v / 0.002))
            assert truth.friction == pytest.approx(friction, abs=1e-6)
            assert read.force_lcb == pytest.approx(truth.spring + friction, abs=1e-6)
            assert read.force_trs == 0.0
            angle = x / 0.33047
            peak = -8508.0 * 0.33047**2 / 1.649
            slew = peak * math.sin(2 * angle) / 0.254
            assert read.force_slew == pytest.approx(slew, rel=1e-3, abs=1e-6)
            assert read.rotor_angle == pytest.approx(angle)
            counts = read.heave_counts - plant().sensors.encoder_offset.value
            assert counts / (20000 * 12.4666 / (2 * math.pi)) == pytest.approx(x, abs=2e-5)


def test_hoist_force_balances_the_remaining_forces() -> None:
    """At 0.1 m in calm water the hoist force balances hydrostatics and spring."""
    rig = world(**QUIET)
    rig.prescribe(lambda t: (0.1, 0.0))
    for _ in range(30000):
        rig.advance(DT)
    truth = rig.truth()
    assert truth.velocity == 0.0
    assert abs(truth.acceleration) < 1e-6
    assert truth.hoist == pytest.approx(24337.0 * 0.1 - truth.spring, rel=1e-3)


def test_released_hull_continues_from_its_position() -> None:
    rig = world(name="wavebot_linear", **QUIET)
    rig.prescribe(lambda t: (0.05, 0.0))
    for _ in range(30000):
        rig.advance(DT)
    assert rig.truth().position == 0.05
    rig.release()
    positions = []
    for _ in range(8000):
        rig.advance(DT)
        positions.append(rig.truth().position)
    other = world(name="wavebot_linear", **QUIET)
    other.release(0.05)
    free = []
    for _ in range(8000):
        other.advance(DT)
        free.append(other.truth().position)
    # the radiation memory of the blend has decayed after 28 s: both are the same free decay
    np.testing.assert_allclose(positions, free, atol=2e-5)
    assert rig.truth().hoist == 0.0


def test_start_is_smooth_for_a_moving_hull() -> None:
    rig = world(**QUIET)
    rig.release(0.1)
    for _ in range(300):
        rig.advance(DT)
    before = rig.truth()
    assert abs(before.velocity) > 0.1
    rig.prescribe(table_profile([0.0, 10.0], [0.0, 0.1]))
    velocities = [before.velocity]
    for _ in range(3000):
        rig.advance(DT)
        velocities.append(rig.truth().velocity)
    assert np.abs(np.diff(velocities)).max() / DT < 1.0  # m/s2


def test_periodic_hoist_cycle() -> None:
    """From zero upwards, at one speed between the turns, within the travel; 2 (travel/speed +
    turn/2) a cycle."""
    profile = hoist_cycle_profile(-0.2, 0.3, 0.05, 1.0)
    period = 2.0 * (0.5 / 0.05 + 0.5)
    assert profile(0.0) == (pytest.approx(0.0), pytest.approx(0.05))
    times = np.linspace(0.0, 2.0 * period, 84001)
    x, v = np.array([profile(float(t)) for t in times]).T
    assert (x.min(), x.max()) == (pytest.approx(-0.2, abs=1e-9), pytest.approx(0.3, abs=1e-9))
    np.testing.assert_allclose(np.gradient(x, times)[1:-1], v[1:-1], atol=1e-4)
    assert np.abs(np.diff(v)).max() / (times[1] - times[0]) < 0.101  # 2 speed / turn
    assert np.mean(np.abs(np.abs(v) - 0.05) < 1e-9) == pytest.approx(1.0 - 2.0 / period, abs=1e-3)
    np.testing.assert_allclose(x[:42001], x[42000:], atol=1e-9)


@pytest.mark.parametrize(
    "travel", [(0.1, 0.3, 0.05, 1.0), (-0.1, 0.1, 0.5, 1.0), (-0.1, 0.1, 0.0, 1.0)]
)
def test_invalid_hoist_cycles_are_refused(travel: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="no way"):
        hoist_cycle_profile(*travel)


def test_a_hoist_moves_the_body_while_the_trigger_is_on() -> None:
    profile = hoist_cycle_profile(-0.1, 0.1, 0.05, 0.5)
    rig = world(hoist=profile, **QUIET)
    for _ in range(500):
        rig.advance(DT)
    assert rig.motion() == (0.0, 0.0)
    rig.actuate(command(heave_enable=0, wave_trigger=1))
    for _ in range(5000):
        rig.advance(DT)
    assert rig.motion() == (pytest.approx(profile(5.0)[0]), pytest.approx(profile(5.0)[1]))
    rig.actuate(command(heave_enable=0))
    for _ in range(3000):
        rig.advance(DT)
    stopped, velocity = rig.motion()
    assert velocity == 0.0
    for _ in range(500):
        rig.advance(DT)
    assert rig.motion() == (stopped, 0.0)
