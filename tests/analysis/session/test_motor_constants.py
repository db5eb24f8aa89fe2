"""Torque and velocity constants from signals of small models that the analysis does not know."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from rig.analysis.session import periods, torque_constant, velocity_constant
from rig.analysis.session.quarters import quarters

BENCHES = 60
T = 0.01 * np.arange(3 * 2000)  # s, three periods of 20 s at 100 Hz
CURRENTS = (1.12, 1.96, 2.79, 3.35, 3.91, 4.47)
VOLTS = (0.35, 0.47, 0.58, 0.70, 0.81, 0.93)
DT = 0.003


def stiction(current: Any, constant: Any, share: Any, dry: float) -> Any:
    """Torque of a motor behind dry friction that grows with the load, on a locked shaft.

    It follows on the line with friction against it, stands on the way back until friction with it
    gives way. ``current`` (samples, ...); ``share`` (oscillations, 2 directions, ...) is what the
    gearbox takes of the load in each.
    """
    torque = np.zeros(current.shape)
    here = np.zeros(current.shape[1:])
    per = len(current) // len(share)
    for i, amperes in enumerate(current):
        forward = (here > 0.0) | ((here == 0.0) & (amperes > 0.0))
        lost = np.where(forward, share[i // per][1], share[i // per][0])
        drive = constant * amperes
        up = np.where(np.abs(drive) < dry, 0.0, (drive - np.sign(drive) * dry) / (1.0 + lost))
        down = np.sign(here) * np.maximum(np.sign(here) * drive + dry, 0.0) / (1.0 - lost)
        grows = (here == 0.0) | ((up * here > 0.0) & (np.abs(up) > np.abs(here)))
        here = np.where(grows, up, np.where(np.abs(down) < np.abs(here), down, here))
        torque[i] = here
    return torque


def test_the_motors_constant_is_recovered_with_friction_taken_out() -> None:
    """Each set point has its own gain, each flank its own friction."""
    random = np.random.default_rng(11)
    of = periods.cut(len(T), 20.0, 0.01)
    truth = random.uniform(15.0, 20.0, BENCHES)
    wide = (BENCHES, len(CURRENTS))
    share = random.normal(0.08, 0.015, (3, 2, *wide))
    share[:, 1] -= 0.03
    current = np.sin(2.0 * np.pi * T / 20.0)[:, None, None] * np.array(CURRENTS)
    current = np.broadcast_to(current, (len(T), *wide))
    torque = stiction(current, truth[:, None], share, 0.5)
    torque *= 1.0 + random.normal(0.0, 0.004, wide)  # temperature, mounting
    held, widths = [], []
    for i in range(BENCHES):
        noise = random.normal(0.0, 0.05, (len(T), len(CURRENTS)))
        found = torque_constant.constants(
            [
                torque_constant.ramps(current[:, i, j], torque[:, i, j] + noise[:, j], of)
                for j in range(len(CURRENTS))
            ]
        )
        held.append(found.motor.holds(truth[i]))
        widths.append(found.motor.uncertainty / truth[i])
        assert found.positive.value > found.negative.value
        assert found.both.value == pytest.approx(truth[i] / 1.065, rel=0.03)
    assert np.mean(held) >= 0.85  # of 60; 0.95 less three and a half standard deviations
    assert np.median(widths) < 0.03


def test_domains_are_where_the_torque_grows() -> None:
    current = 3.0 * np.sin(2.0 * np.pi * T / 20.0)
    torque = stiction(current, 17.0, np.full((3, 2), 0.06), 0.5)
    found = torque_constant.ramps(current, torque, periods.cut(len(T), 20.0, 0.01))
    assert len(found.up) == len(found.back) == 6
    for domain in found.up:
        size = domain.quarter.sign * torque[domain.where]
        assert (np.diff(size) >= 0.0).all()
        assert domain.fitted.slope == pytest.approx(17.0 / 1.06, rel=1e-3)
        assert domain.fitted.r_squared > 0.9999
    assert found.hysteresis > 2.0  # N*m
    assert found.motor == pytest.approx(17.0, rel=2e-3)


def test_quarters_of_a_command_of_any_phase() -> None:
    of = periods.cut(6000, 20.0, 0.01)
    for phase in (0.0, 1.0, 2.5, -2.0):
        command = np.sin(2.0 * np.pi * T / 20.0 + phase)
        found = quarters(command, of)
        assert 11 <= len(found) <= 12
        for each in found:
            size = each.sign * command[each.where]
            assert size.min() > -0.01
            grown = size[-1] > size[0]
            assert grown == each.growing
    assert quarters(np.zeros(6000), of) == []


def slow_drive(random: Any, volts: Any, gain: float, droop: float, lag: float, late: float) -> Any:
    """Motor angle of a drive that keeps behind by ``late`` until the command comes down to it."""
    asked = gain * volts - droop * np.tanh(volts / 0.15)
    speed = np.empty_like(asked)
    last = 0.0
    for i, wanted in enumerate(asked):
        if wanted * last < 0.0:
            last = 0.0
        threshold = late * (1.0 + 0.1 * random.normal()) if last == 0.0 else late
        if abs(wanted) <= abs(last):
            last = wanted
        else:
            last = np.sign(wanted) * max(abs(last), abs(wanted) - threshold)
        speed[i] = last
    t = DT * np.arange(len(volts))
    speed = np.interp(t - lag, t, speed)
    angle = cumulative_trapezoid(speed, dx=DT, initial=0.0) + 1e-3 * t
    return angle + random.normal(0.0, 5e-6, len(t))


def _velocity_runs(
    random: Any, gain: float, *, scatter: float = 0.002, viscous: float = 0.1
) -> list[velocity_constant.Slowing]:
    """Runs against a bearing, ``viscous`` in N*m*s/rad, that takes its share of the droop away."""
    count = 4 * 500
    t = DT * np.arange(count)
    points = []
    for amplitude in VOLTS:
        volts = amplitude * np.cos(2.0 * np.pi * t / 1.5)
        mine = gain * (1.0 + random.normal(0.0, scatter))
        torque = 0.1 * np.sign(volts) + viscous * gain * volts  # N*m
        droop = 0.03 * (1.0 - 0.8 * np.abs(torque).mean())
        angle = slow_drive(random, volts, mine, droop, 0.004, 0.04)
        torque = torque + 0.02 + random.normal(0.0, 0.02, count)  # the cell's zero, its noise
        of = periods.cut(count, 1.5, DT)
        points.append(velocity_constant.slowing(angle, volts, torque, of))
    return points


def test_the_velocity_constant_is_recovered_behind_wait_droop_and_lag() -> None:
    random = np.random.default_rng(12)
    held, biased = [], []
    for _ in range(20):
        truth = random.uniform(1.3, 1.7)
        found = velocity_constant.constants(_velocity_runs(random, truth))
        held.append(found.constant.holds(truth))
        assert found.constant.uncertainty < 0.03 * truth
        biased.append(found.thesis.value / truth - 1.0)
    assert np.mean(held) >= 0.8  # of 20; fewer than 16 has three chances in a thousand
    assert max(biased) < -0.01  # what the thesis's lines take in


def test_a_droop_that_falls_with_the_bearings_torque_is_not_taken_for_a_larger_constant() -> None:
    """With one droop for all loads the constant comes out 0.1 % too large here."""
    random = np.random.default_rng(15)
    off, held, droops = [], [], []
    for _ in range(10):
        truth = random.uniform(1.3, 1.7)
        found = velocity_constant.constants(_velocity_runs(random, truth, scatter=0.0))
        off.append(found.constant.value / truth - 1.0)
        held.append(found.constant.holds(truth))
        droops.append(found.droop.value)
    assert abs(np.mean(off)) < 0.0001
    assert np.max(np.abs(off)) < 0.0004
    assert np.mean(held) >= 0.7  # of 10; fewer than 7 has one chance in a thousand
    assert np.mean(droops) == pytest.approx(0.03, rel=0.03)  # without load


def test_the_thesis_lines_are_lower_at_low_speed() -> None:
    points = _velocity_runs(np.random.default_rng(13), 1.5)
    slopes = [np.mean([d.fitted.slope for d in each.down]) for each in points]
    assert slopes[0] < 0.97 * slopes[-1]
    found = velocity_constant.constants(points)
    assert found.thesis.value < found.fastest.value < found.constant.value
    assert found.lag.value == pytest.approx(0.004, abs=0.0008)


def test_too_few_set_points_have_no_proper_constant() -> None:
    points = _velocity_runs(np.random.default_rng(14), 1.5)[:2]
    assert np.isnan(velocity_constant.constants(points).constant.value)
