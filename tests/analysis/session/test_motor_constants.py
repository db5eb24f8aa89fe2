"""Torque and velocity constants from signals of small independent models."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from rig.kinds.oswec_bench.products import periods, torque_constant, velocity_constant
from rig.kinds.oswec_bench.products.quarters import split_quarters

BENCHES = 60
T = 0.01 * np.arange(3 * 2000)  # s, three periods of 20 s at 100 Hz
CURRENTS = (1.12, 1.96, 2.79, 3.35, 3.91, 4.47)
VOLTS = (0.35, 0.47, 0.58, 0.70, 0.81, 0.93)
DT = 0.003


def locked_torque(current: Any, constant: Any, share: Any, dry: float) -> Any:
    """Return the torque of a motor behind dry friction that grows with the load, on a locked shaft.

    The torque rises on the line with friction against it, and stays constant during the back-off
    until friction reverses. ``current`` (samples, ...); ``share`` (oscillations, 2 directions, ...)
    is the share of the load that the gearbox takes in each.
    """
    torque = np.zeros(current.shape)
    static_torque = np.zeros(current.shape[1:])
    period_samples = len(current) // len(share)
    for i, amperes in enumerate(current):
        forward = (static_torque > 0.0) | ((static_torque == 0.0) & (amperes > 0.0))
        loss_share = np.where(forward, share[i // period_samples][1], share[i // period_samples][0])
        motor_torque = constant * amperes
        rising = np.where(
            np.abs(motor_torque) < dry,
            0.0,
            (motor_torque - np.sign(motor_torque) * dry) / (1.0 + loss_share),
        )
        falling = (
            np.sign(static_torque)
            * np.maximum(np.sign(static_torque) * motor_torque + dry, 0.0)
            / (1.0 - loss_share)
        )
        grows = (static_torque == 0.0) | (
            (rising * static_torque > 0.0) & (np.abs(rising) > np.abs(static_torque))
        )
        static_torque = np.where(
            grows, rising, np.where(np.abs(falling) < np.abs(static_torque), falling, static_torque)
        )
        torque[i] = static_torque
    return torque


def test_the_motor_constant_is_recovered_without_friction() -> None:
    """Each set point has its own gain, each flank its own friction."""
    random = np.random.default_rng(11)
    cut = periods.cut_periods(len(T), 20.0, 0.01)
    truth = random.uniform(15.0, 20.0, BENCHES)
    shape = (BENCHES, len(CURRENTS))
    share = random.normal(0.08, 0.015, (3, 2, *shape))
    share[:, 1] -= 0.03
    current = np.sin(2.0 * np.pi * T / 20.0)[:, None, None] * np.array(CURRENTS)
    current = np.broadcast_to(current, (len(T), *shape))
    torque = locked_torque(current, truth[:, None], share, 0.5)
    torque *= 1.0 + random.normal(0.0, 0.004, shape)  # temperature, mounting
    covered, widths = [], []
    for i in range(BENCHES):
        noise = random.normal(0.0, 0.05, (len(T), len(CURRENTS)))
        constants = torque_constant.torque_constants(
            [
                torque_constant.fit_ramps(current[:, i, j], torque[:, i, j] + noise[:, j], cut)
                for j in range(len(CURRENTS))
            ]
        )
        covered.append(constants["torque_constant_motor"].covers(truth[i]))
        widths.append(constants["torque_constant_motor"].uncertainty / truth[i])
        assert (
            constants["torque_constant_positive"].value
            > constants["torque_constant_negative"].value
        )
        assert constants["torque_constant"].value == pytest.approx(truth[i] / 1.065, rel=0.03)
    assert np.mean(covered) >= 0.85  # of 60; 0.95 minus three and a half standard deviations
    assert np.median(widths) < 0.03


def test_fit_domains_lie_where_the_torque_grows() -> None:
    current = 3.0 * np.sin(2.0 * np.pi * T / 20.0)
    torque = locked_torque(current, 17.0, np.full((3, 2), 0.06), 0.5)
    ramps = torque_constant.fit_ramps(current, torque, periods.cut_periods(len(T), 20.0, 0.01))
    assert len(ramps.ramp_up) == len(ramps.motor_constants) == 6
    for domain in ramps.ramp_up:
        magnitude = domain.quarter.sign * torque[domain.samples]
        assert (np.diff(magnitude) >= 0.0).all()
        assert domain.line.slope == pytest.approx(17.0 / 1.06, rel=1e-3)
        assert domain.line.r_squared > 0.9999
    assert ramps.hysteresis > 2.0  # N*m
    assert ramps.motor_constants == pytest.approx(17.0, rel=2e-3)


def test_a_command_of_any_phase_splits_into_quarters() -> None:
    cut = periods.cut_periods(6000, 20.0, 0.01)
    for phase in (0.0, 1.0, 2.5, -2.0):
        command = np.sin(2.0 * np.pi * T / 20.0 + phase)
        result = split_quarters(command, cut)
        assert 11 <= len(result) <= 12
        for each in result:
            magnitude = each.sign * command[each.samples]
            assert magnitude.min() > -0.01
            grown = magnitude[-1] > magnitude[0]
            assert grown == each.growing
    assert split_quarters(np.zeros(6000), cut) == []


def lagging_drive(
    random: Any, volts: Any, gain: float, droop: float, lag: float, following_gap: float
) -> Any:
    """Return the motor angle of a drive that lags by ``following_gap`` until the command comes down
    to it.
    """
    demand = gain * volts - droop * np.tanh(volts / 0.15)
    speed = np.empty_like(demand)
    previous = 0.0
    for i, demanded in enumerate(demand):
        if demanded * previous < 0.0:
            previous = 0.0
        threshold = (
            following_gap * (1.0 + 0.1 * random.normal()) if previous == 0.0 else following_gap
        )
        if abs(demanded) <= abs(previous):
            previous = demanded
        else:
            previous = np.sign(demanded) * max(abs(previous), abs(demanded) - threshold)
        speed[i] = previous
    t = DT * np.arange(len(volts))
    speed = np.interp(t - lag, t, speed)
    angle = cumulative_trapezoid(speed, dx=DT, initial=0.0) + 1e-3 * t
    return angle + random.normal(0.0, 5e-6, len(t))


def _velocity_runs(
    random: Any, gain: float, *, scatter: float = 0.002, viscous: float = 0.1
) -> list[velocity_constant.Deceleration]:
    """Return runs against a bearing, ``viscous`` in N*m*s/rad, whose load reduces the droop."""
    count = 4 * 500
    t = DT * np.arange(count)
    points = []
    for amplitude in VOLTS:
        volts = amplitude * np.cos(2.0 * np.pi * t / 1.5)
        point_gain = gain * (1.0 + random.normal(0.0, scatter))
        torque = 0.1 * np.sign(volts) + viscous * gain * volts  # N*m
        droop = 0.03 * (1.0 - 0.8 * np.abs(torque).mean())
        angle = lagging_drive(random, volts, point_gain, droop, 0.004, 0.04)
        torque = torque + 0.02 + random.normal(0.0, 0.02, count)  # the cell's zero, its noise
        cut = periods.cut_periods(count, 1.5, DT)
        points.append(velocity_constant.fit_decelerations(angle, volts, torque, cut))
    return points


def test_the_velocity_constant_is_recovered_despite_following_gap_droop_and_lag() -> None:
    random = np.random.default_rng(12)
    covered, biased = [], []
    for _ in range(20):
        truth = random.uniform(1.3, 1.7)
        constants = velocity_constant.velocity_constants(_velocity_runs(random, truth))
        covered.append(constants["velocity_constant"].covers(truth))
        assert constants["velocity_constant"].uncertainty < 0.03 * truth
        biased.append(constants["velocity_constant_deceleration"].value / truth - 1.0)
    assert np.mean(covered) >= 0.8  # of 20; fewer than 16 has three chances in a thousand
    assert max(biased) < -0.01  # bias of the thesis's lines


def test_a_load_dependent_droop_does_not_bias_the_velocity_constant() -> None:
    """A single droop for all loads would make the constant 0.1 % too large here."""
    random = np.random.default_rng(15)
    errors, covered, droops = [], [], []
    for _ in range(10):
        truth = random.uniform(1.3, 1.7)
        constants = velocity_constant.velocity_constants(_velocity_runs(random, truth, scatter=0.0))
        errors.append(constants["velocity_constant"].value / truth - 1.0)
        covered.append(constants["velocity_constant"].covers(truth))
        droops.append(constants["velocity_droop"].value)
    assert abs(np.mean(errors)) < 0.0001
    assert np.max(np.abs(errors)) < 0.0004
    assert np.mean(covered) >= 0.7  # of 10; fewer than 7 has one chance in a thousand
    assert np.mean(droops) == pytest.approx(0.03, rel=0.03)  # without load


def test_the_thesis_fits_are_lower_at_low_speed() -> None:
    points = _velocity_runs(np.random.default_rng(13), 1.5)
    slopes = [np.mean([d.line.slope for d in each.thesis_fits]) for each in points]
    assert slopes[0] < 0.97 * slopes[-1]
    constants = velocity_constant.velocity_constants(points)
    deceleration, fastest, following = (
        constants[f"velocity_constant{name}"].value for name in ("_deceleration", "_fastest", "")
    )
    assert deceleration < fastest < following
    assert constants["velocity_lag"].value == pytest.approx(0.004, abs=0.0008)


def test_too_few_set_points_give_no_velocity_constant() -> None:
    points = _velocity_runs(np.random.default_rng(14), 1.5)[:2]
    assert np.isnan(velocity_constant.velocity_constants(points)["velocity_constant"].value)
