"""Brake map, losses and torque tracking on signals with known truth."""

from typing import Any

import numpy as np
import pytest

from rig.analysis.session import brake_map, losses, periods, tracking
from rig.analysis.session.deflection import Motion
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.losses import Turned

DT = 0.002
COUNT = 4 * 750
KNOWN = Estimate(17.0, 0.0, "N*m/A", "")
T = DT * np.arange(COUNT)
OF = periods.cut(COUNT, 1.5, DT)


def held_motion(random: Any, torque: float) -> Motion:
    shaft = 0.2 * np.cos(2.0 * np.pi * T / 1.5)
    speed = np.gradient(shaft, DT)
    noise = random.normal(0.0, 0.02, COUNT)
    drift = np.repeat(random.normal(0.0, 0.03, OF.whole), 750)
    return Motion(OF, shaft, shaft, np.sign(speed) * (torque + drift) + noise)


def test_both_branches_are_recovered() -> None:
    """Truth: 100 N*m/A from 2 N*m, branches 1.5 N*m apart; 200 points, 95 % of them covered."""
    random = np.random.default_rng(21)
    currents = [0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 0.6, 0.4, 0.2, 0.1, 0.0]
    ways = [True] * 6 + [False] * 5
    held = []
    for _ in range(20):
        truth = [
            2.0 + 100.0 * i + (0.0 if up else 1.5) for i, up in zip(currents, ways, strict=True)
        ]
        points = brake_map.held([held_motion(random, x) for x in truth], currents)
        assert [each.rising for each in points] == ways
        held += [p.torque.holds(x) for p, x in zip(points, truth, strict=True)]
    assert np.mean(held) == pytest.approx(0.95, abs=0.045)
    found = brake_map.brake_map(points)
    assert found.rising.current.tolist() == sorted(set(currents))
    assert found.falling.current[-1] == 0.8  # both branches meet at the top
    assert found.hysteresis.holds(1.5)


def test_equal_currents_of_a_branch_are_averaged() -> None:
    random = np.random.default_rng(22)
    currents = [0.0, 0.2, 0.0, 0.2]
    points = brake_map.held([held_motion(random, 2.0 + 100.0 * i) for i in currents], currents)
    found = brake_map.brake_map(points)
    assert found.rising.current.tolist() == [0.0, 0.2]
    with pytest.raises(ValueError, match="at least 2"):
        brake_map.brake_map(points[:1])


class Drag:
    """A hidden bench: Coulomb friction either way, viscous, inertia; gearbox likewise."""

    def __init__(self, random: Any) -> None:
        self.behind = random.uniform((0.03, 0.08, 0.02, 0.005), (0.1, 0.2, 0.1, 0.02))
        self.before = random.uniform((0.5, 0.2, 0.04, 0.03), (1.2, 0.5, 0.1, 0.1))

    def turned(self, random: Any, amplitude: float, brake: float, start: float) -> Turned:
        """At ``start`` s after the tare; the cell's zero drifts away by 0.03 N*m."""
        angle = amplitude * np.cos(2.0 * np.pi * T / 1.5)
        v = np.gradient(angle, DT)
        a = np.gradient(v, DT)
        plus, minus, viscous, inertia = self.behind
        torque = plus * (v > 0.0) - minus * (v < 0.0) + viscous * v + inertia * a
        torque += brake * np.sign(v)
        dry, rub, mass, share = self.before
        driven = torque + (dry + share * np.abs(torque)) * np.sign(v) + rub * v + mass * a
        time = start + T
        torque = torque + 0.03 * (1.0 - np.exp(-time / 600.0)) + random.normal(0.0, 0.02, COUNT)
        current = driven / 17.0 + random.normal(0.0, 0.0008) + random.normal(0.0, 0.01, COUNT)
        good = losses.moving(v, 5)
        return Turned(v[good], a[good], torque[good], current[good], time[good])


def test_losses_are_recovered_and_told_from_inertia() -> None:
    random = np.random.default_rng(23)
    behind, before = [], []
    for _ in range(50):
        hidden = Drag(random)
        free = [
            hidden.turned(random, x, 0.0, 60.0 * i)
            for i, x in enumerate((0.35, 0.1, 0.3, 0.15, 0.25, 0.2, 0.35, 0.1))
        ]
        found = losses.behind(free, "set points")
        behind.append([f.holds(x) for f, x in zip(found, hidden.behind, strict=False)])
        braked = [
            hidden.turned(random, x, b, 0.0) for x in (0.1, 0.2, 0.35) for b in (0.0, 20.0, 50.0)
        ]
        measured = 17.0 * (1.0 + random.normal(0.0, 0.0025))  # by a session of its own
        lost = losses.before(braked, Estimate(measured, 0.085, "N*m/A", ""), "set points")
        got = (lost.dry, lost.viscous, lost.inertia, lost.share)
        before.append([f.holds(x) for f, x in zip(got, hidden.before, strict=True)])
    for shares in (np.mean(behind, axis=0), np.mean(before, axis=0)):
        assert shares.min() >= 0.8, shares
        assert shares.mean() >= 0.89, shares


def test_a_share_of_the_load_needs_loads_that_differ() -> None:
    random = np.random.default_rng(24)
    hidden = Drag(random)
    found = losses.before([hidden.turned(random, x, 0.0, 0.0) for x in (0.1, 0.2, 0.3)], KNOWN, "")
    assert np.isnan(found.share.value)
    assert found.dry.value > 0.0


def test_tracking_error_is_the_rms() -> None:
    random = np.random.default_rng(25)
    wanted = 40.0 * np.sin(2.0 * np.pi * T / 1.5)
    rough = [
        tracking.tracked(wanted, wanted + random.normal(0.0, 3.0, COUNT), OF) for _ in range(4)
    ]
    fine = [tracking.tracked(wanted, wanted + random.normal(0.0, 0.6, COUNT), OF) for _ in range(4)]
    assert rough[0].error.value == pytest.approx(3.0, rel=0.05)
    assert rough[0].share == pytest.approx(3.0 / (40.0 / np.sqrt(2.0)), rel=0.05)
    assert tracking.improvement(rough, fine).holds(0.2)
    assert tracking.improvement(rough, fine).uncertainty < 0.02
