"""Torque and velocity constants from signals of small models that the analysis does not know."""

from typing import Any

import numpy as np
import pytest

from rig.analysis.session import periods, torque_constant, velocity_constant
from rig.analysis.session.quarters import quarters

BENCHES = 100
T = 0.01 * np.arange(3 * 2000)  # s, three periods of 20 s at 100 Hz
CURRENTS = (1.12, 1.96, 2.79, 3.35, 3.91, 4.47)
VOLTS = (0.35, 0.47, 0.58, 0.70, 0.81, 0.93)
DT = 0.003


def stiction(current: Any, constant: Any, share: Any, dry: float) -> Any:
    """Torque of a motor behind dry friction that grows with the load, on a locked shaft.

    It follows on the line with friction against it, stands on the way back until friction with it
    gives way. ``share`` (oscillations, two directions) is drawn anew each time the sign changes.
    """
    torque = np.zeros_like(current)
    here = 0.0
    per = len(current) // len(share)
    for i, amperes in enumerate(current):
        lost = share[i // per][int(here > 0.0 or (here == 0.0 and amperes > 0.0))]
        drive = constant * amperes
        up = (drive - np.sign(drive) * dry) / (1.0 + lost)
        if abs(drive) < dry:
            up = 0.0
        down = (drive + np.sign(here) * dry) / (1.0 - lost)
        if here == 0.0 or abs(up) > abs(here) or up * here < 0.0:
            here = up
        elif down * here < abs(here) * abs(here):
            here = down if down * here > 0.0 else 0.0
        torque[i] = here
    return torque


def test_the_motors_constant_is_recovered_with_friction_taken_out() -> None:
    random = np.random.default_rng(11)
    held, widths = [], []
    for _ in range(BENCHES // 2):
        truth = random.uniform(15.0, 20.0)
        points = []
        for amplitude in CURRENTS:
            share = random.normal((0.08, 0.05), 0.015, (3, 2))
            current = amplitude * np.sin(2.0 * np.pi * T / 20.0)
            torque = stiction(current, truth, share, 0.5) + random.normal(0.0, 0.05, len(T))
            torque *= 1.0 + random.normal(0.0, 0.004)  # of the set point: temperature, mounting
            points.append(torque_constant.ramps(current, torque, periods.cut(len(T), 20.0, 0.01)))
        found = torque_constant.constants(points)
        held.append(found.motor.holds(truth))
        widths.append(found.motor.uncertainty / truth)
        assert found.positive.value > found.negative.value
        assert found.both.value == pytest.approx(truth / 1.065, rel=0.03)
    assert np.mean(held) > 0.84  # of 50; 0.95 less three and a half standard deviations
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
    assert found.motor == pytest.approx(17.0, rel=1e-3)


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
    angle = np.cumsum(speed) * DT + 1e-3 * t
    return angle + random.normal(0.0, 5e-6, len(t))


def _velocity_runs(random: Any, gain: float) -> list[velocity_constant.Slowing]:
    count = 5 * 500
    t = DT * np.arange(count)
    points = []
    for amplitude in VOLTS:
        volts = amplitude * np.cos(2.0 * np.pi * t / 1.5)
        mine = gain * (1.0 + random.normal(0.0, 0.002))
        angle = slow_drive(random, volts, mine, 0.03, 0.004, 0.04)
        points.append(velocity_constant.slowing(angle, volts, periods.cut(count, 1.5, DT)))
    return points


def test_the_velocity_constant_is_recovered_behind_wait_droop_and_lag() -> None:
    random = np.random.default_rng(12)
    held, biased = [], []
    for _ in range(BENCHES // 4):
        truth = random.uniform(1.3, 1.7)
        found = velocity_constant.constants(_velocity_runs(random, truth))
        held.append(found.constant.holds(truth))
        assert found.constant.uncertainty < 0.03 * truth
        biased.append(found.thesis.value / truth - 1.0)
    assert np.mean(held) >= 0.8  # of 25; fewer than 20 of 25 has one chance in a thousand
    assert max(biased) < -0.01  # what the thesis's lines take in


def test_the_thesis_lines_are_lower_at_low_speed() -> None:
    points = _velocity_runs(np.random.default_rng(13), 1.5)
    slopes = [np.mean([d.fitted.slope for d in each.down]) for each in points]
    assert slopes[0] < 0.97 * slopes[-1]
    found = velocity_constant.constants(points)
    assert found.thesis.value < found.fastest.value < found.constant.value
    assert found.lag.value == pytest.approx(0.004, abs=0.001)


def test_too_few_set_points_have_no_proper_constant() -> None:
    points = _velocity_runs(np.random.default_rng(14), 1.5)[:2]
    assert np.isnan(velocity_constant.constants(points).constant.value)
