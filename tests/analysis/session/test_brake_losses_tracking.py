"""Brake map, losses and torque tracking on signals with known truth."""

from typing import Any

import numpy as np
import pytest

from rig.kinds.oswec_bench.products import brake_map, losses, periods, tracking
from rig.kinds.oswec_bench.products.deflection import Motion
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.losses import MovingSamples

DT = 0.002
COUNT = 4 * 750
KNOWN_CONSTANT = Estimate(17.0, 0.0, "N*m/A", "")
T = DT * np.arange(COUNT)
CUT = periods.cut_periods(COUNT, 1.5, DT)


def braked_motion(random: Any, torque: float) -> Motion:
    shaft = 0.2 * np.cos(2.0 * np.pi * T / 1.5)
    speed = np.gradient(shaft, DT)
    noise = random.normal(0.0, 0.02, COUNT)
    drift = np.repeat(random.normal(0.0, 0.03, CUT.period_count), 750)
    return Motion(CUT, shaft, shaft, np.sign(speed) * (torque + drift) + noise)


def test_both_branches_are_recovered() -> None:
    """Truth: 100 N*m/A from 2 N*m, branches 1.5 N*m apart; 95 % of 200 intervals contain it."""
    random = np.random.default_rng(21)
    currents = [0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 0.6, 0.4, 0.2, 0.1, 0.0]
    rising = [True] * 6 + [False] * 5
    covered = []
    for _ in range(20):
        truth = [
            2.0 + 100.0 * i + (0.0 if up else 1.5) for i, up in zip(currents, rising, strict=True)
        ]
        points = brake_map.brake_points([braked_motion(random, x) for x in truth], currents)
        assert [each.rising for each in points] == rising
        covered += [p.torque.covers(x) for p, x in zip(points, truth, strict=True)]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.045)
    measured_map = brake_map.brake_map(points)
    assert measured_map.rising.current.tolist() == sorted(set(currents))
    assert measured_map.falling.current[-1] == 0.8  # both branches meet at the largest current
    assert measured_map.hysteresis.covers(1.5)


def test_equal_currents_of_a_branch_are_averaged() -> None:
    random = np.random.default_rng(22)
    currents = [0.0, 0.2, 0.0, 0.2]
    points = brake_map.brake_points(
        [braked_motion(random, 2.0 + 100.0 * i) for i in currents], currents
    )
    measured_map = brake_map.brake_map(points)
    assert measured_map.rising.current.tolist() == [0.0, 0.2]
    with pytest.raises(ValueError, match="at least 2"):
        brake_map.brake_map(points[:1])


class HiddenLosses:
    """A hidden bench: Coulomb friction per direction, viscous friction, inertia; likewise in the
    gearbox.
    """

    def __init__(self, random: Any) -> None:
        self.behind = random.uniform((0.03, 0.08, 0.02, 0.005), (0.1, 0.2, 0.1, 0.02))
        self.before = random.uniform((0.5, 0.2, 0.04, 0.03), (1.2, 0.5, 0.1, 0.1))

    def samples(self, random: Any, amplitude: float, brake: float, start: float) -> MovingSamples:
        """Return samples from ``start`` s after the tare; the cell's zero drifts by 0.03 N*m."""
        angle = amplitude * np.cos(2.0 * np.pi * T / 1.5)
        v = np.gradient(angle, DT)
        a = np.gradient(v, DT)
        plus, minus, viscous, inertia = self.behind
        torque = plus * (v > 0.0) - minus * (v < 0.0) + viscous * v + inertia * a
        torque += brake * np.sign(v)
        dry, viscous_gearbox, motor_inertia, share = self.before
        motor_torque = (
            torque
            + (dry + share * np.abs(torque)) * np.sign(v)
            + viscous_gearbox * v
            + motor_inertia * a
        )
        time = start + T
        torque = torque + 0.03 * (1.0 - np.exp(-time / 600.0)) + random.normal(0.0, 0.02, COUNT)
        current = motor_torque / 17.0 + random.normal(0.0, 0.0008) + random.normal(0.0, 0.01, COUNT)
        moving = periods.moving_samples(v, 5)
        return MovingSamples(v[moving], a[moving], torque[moving], current[moving], time[moving])


def test_losses_are_recovered_and_separated_from_inertia() -> None:
    random = np.random.default_rng(23)
    behind, before = [], []
    for _ in range(50):
        hidden = HiddenLosses(random)
        free = [
            hidden.samples(random, x, 0.0, 60.0 * i)
            for i, x in enumerate((0.35, 0.1, 0.3, 0.15, 0.25, 0.2, 0.35, 0.1))
        ]
        estimated = losses.losses_behind_cell(free, "set points")
        behind.append([f.covers(x) for f, x in zip(estimated, hidden.behind, strict=False)])
        braked = [
            hidden.samples(random, x, b, 0.0) for x in (0.1, 0.2, 0.35) for b in (0.0, 20.0, 50.0)
        ]
        measured = 17.0 * (1.0 + random.normal(0.0, 0.0025))  # result of a separate session
        estimated_before = losses.losses_before_cell(
            braked, Estimate(measured, 0.085, "N*m/A", ""), "set points"
        )
        estimates_before = (
            estimated_before.dry,
            estimated_before.viscous,
            estimated_before.inertia,
            estimated_before.share,
        )
        before.append([f.covers(x) for f, x in zip(estimates_before, hidden.before, strict=True)])
    for shares in (np.mean(behind, axis=0), np.mean(before, axis=0)):
        assert shares.min() >= 0.8, shares
        assert shares.mean() >= 0.89, shares


def test_the_load_share_needs_different_loads() -> None:
    random = np.random.default_rng(24)
    hidden = HiddenLosses(random)
    estimated = losses.losses_before_cell(
        [hidden.samples(random, x, 0.0, 0.0) for x in (0.1, 0.2, 0.3)], KNOWN_CONSTANT, ""
    )
    assert np.isnan(estimated.share.value)
    assert estimated.dry.value > 0.0


def test_the_tracking_error_is_the_rms_error() -> None:
    random = np.random.default_rng(25)
    demand = 40.0 * np.sin(2.0 * np.pi * T / 1.5)
    rough = [
        tracking.tracking_error(demand, demand + random.normal(0.0, 3.0, COUNT), CUT)
        for _ in range(4)
    ]
    fine = [
        tracking.tracking_error(demand, demand + random.normal(0.0, 0.6, COUNT), CUT)
        for _ in range(4)
    ]
    assert rough[0].error.value == pytest.approx(3.0, rel=0.05)
    assert rough[0].relative == pytest.approx(3.0 / (40.0 / np.sqrt(2.0)), rel=0.05)
    assert tracking.closed_loop_improvement(rough, fine).covers(0.2)
    assert tracking.closed_loop_improvement(rough, fine).uncertainty < 0.02
