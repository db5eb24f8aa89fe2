"""What is read of records, on paper: devices whose numbers are drawn and not shown."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.identification.twin import drivetrain, electrics
from rig.identification.twin.group import Group, least_squares
from rig.identification.twin.hull import hull
from rig.identification.twin.records import Power, Record, analysed, synthesised
from rig.identification.twin.seas import BEM_DEVIATION, SCALE, Coefficient, scale

PERIOD, LINES = 20.0, 50
SHAPE = drivetrain.Shape(True, 0.33047, 0.33047 / 1.649, 0.002)


def record(velocity: Any, lcb: Any, trs: Any, **more: Any) -> Record:
    """A row in calm water of lines 4 .. 20; what is not given is nothing."""
    number = np.arange(1, LINES + 1)
    none = np.zeros(0)
    keys: dict[str, Any] = {
        "place": "paper", "setting": {"spring_rate": 0.0}, "sea": None, "pushed": True,
        "period": PERIOD, "velocity": velocity, "trs": trs, "lcb": lcb,
        "excited": (number >= 4) & (number <= 20), "ac": 0.0, "dc": 0.0, "current_square": 0.0,
        "power": Power(none, none, none, none), **more,
    }  # fmt: skip
    return Record(**keys)


def motion(rng: Any, size: float) -> Any:
    """Velocity lines of a multisine (m/s)."""
    number = np.arange(1, LINES + 1)
    lines = size * np.exp(2j * np.pi * rng.uniform(size=LINES))
    return np.where((number >= 4) & (number <= 20), lines, 0.0)


def test_samples_and_lines_are_one_thing() -> None:
    rng = np.random.default_rng(1)
    velocity = motion(rng, 0.05)
    one = record(velocity, velocity, velocity)
    assert analysed(one, synthesised(one, velocity)) == pytest.approx(velocity, abs=1e-12)
    v = synthesised(one, velocity)
    assert float(np.mean(v * v)) == pytest.approx(0.5 * np.sum(np.abs(velocity) ** 2))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hidden_hull_is_found(seed: int) -> None:
    """Inertia, damping and drag of a draw; radiation is not of the fitted shape but its own."""
    rng = np.random.default_rng(seed)
    mass, stiffness = rng.uniform(800, 1600), rng.uniform(15_000, 30_000)
    viscous, quadratic = rng.uniform(200, 600), rng.uniform(600, 1800)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    s = 1j * omega
    # Bandpasses are passive whatever their numbers are, and zero at rest and at infinity.
    z = mass * s + viscous + stiffness / s
    for middle, width, top in ((3.2, 3.0, 1500.0), (5.0, 6.0, 400.0)):
        z = z + top * width * s / (s * s + width * s + middle * middle)
    rows = []
    for size in (0.02, 0.05, 0.08):
        velocity = motion(rng, size)
        one = record(velocity, velocity, velocity)
        v = synthesised(one, velocity)
        noise = rng.normal(size=(2, LINES)) * 0.2
        force = z * velocity + quadratic * analysed(one, np.abs(v) * v) + noise[0] + 1j * noise[1]
        rows.append(one._replace(lcb=force))
    found = hull(rows)
    # Noise of 0.28 N a line beside forces of some 100 N: half a percent of a drag's own part.
    assert found.quadratic.values[0] == pytest.approx(quadratic, rel=0.02)
    assert abs(found.quadratic.values[0] - quadratic) < 4.0 * found.quadratic.deviation(
        "viscous_quadratic"
    )
    lines = rows[0].excited
    assert found.impedance == pytest.approx(z[lines], rel=0.01)
    assert found.worst < 0.01
    watched = 1j * np.geomspace(0.01, 300.0, 400)
    below = np.polyval([1.0, *found.radiation.denominator], watched)
    memory = np.polyval([*found.radiation.numerator, 0.0], watched) / below
    assert np.min(memory.real + found.linear.known["viscous"]) > -1.0  # N s/m: it gives no energy


def test_a_linear_hull_has_no_drag_and_a_single_line_no_hull() -> None:
    rng = np.random.default_rng(5)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    z = 1500j * omega + 900.0 + 24_000 / (1j * omega)
    rows = []
    for size in (0.02, 0.08):
        velocity = motion(rng, size)
        noise = rng.normal(size=(2, LINES)) * 0.2
        rows.append(record(velocity, z * velocity + noise[0] + 1j * noise[1], velocity))
    assert hull(rows).quadratic.values == (0.0,)
    few = [one._replace(excited=np.arange(LINES) == 8) for one in rows]
    with pytest.raises(ValueError, match="1 lines cannot tell"):
        hull(few)
    with pytest.raises(ValueError, match="no row in calm water"):
        hull([one._replace(pushed=False) for one in rows])


def test_hidden_friction_and_spring_are_found() -> None:
    rng = np.random.default_rng(9)
    viscous, dry, share, rate = 380.0, 62.0, 0.65, -9228.0
    rows = []
    for size in (0.02, 0.05, 0.08):
        velocity = motion(rng, size)
        one = record(velocity, velocity, velocity, setting={"spring_rate": rate})
        v = synthesised(one, velocity)
        x = synthesised(one, velocity / (1j * one.omega))
        spring = share * rate * SHAPE.reach * np.sin(2.0 * x / SHAPE.lever)
        between = viscous * v + dry * np.tanh(v / SHAPE.coulomb_velocity) + spring
        noise = rng.normal(size=(2, LINES)) * 0.2
        rows.append(one._replace(trs=one.lcb + analysed(one, between) + noise[0] + 1j * noise[1]))
    found = drivetrain.drivetrain(rows, SHAPE).known
    assert found[drivetrain.VISCOUS] == pytest.approx(viscous, rel=0.01)
    assert found[drivetrain.WAVES] == pytest.approx(dry, rel=0.01)
    assert found[drivetrain.EFFECT] == pytest.approx(share, rel=0.005)
    weak = [one._replace(setting={"spring_rate": 0.0}) for one in rows]
    assert drivetrain.drivetrain(weak, SHAPE).known[drivetrain.EFFECT] == 1.0


@pytest.mark.parametrize("voltages", [(75.0, 75.0), (67.0, 82.0)])
def test_a_hidden_drive_loss_is_found(voltages: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    rows = []
    for voltage in voltages:
        size = np.abs(rng.normal(size=400)) * 8.0
        volts = voltage + 0.3 * rng.normal(size=400)
        u = volts / 75.0
        loss = 4.0 + 5.0 * u + (1.5 + 0.6 * u) * size + 0.015 * size * size
        loss = loss + 0.05 * rng.normal(size=400)
        power = Power(size, size * size, loss, volts)
        nothing = np.zeros(LINES, dtype=complex)
        rows.append(record(nothing, nothing, nothing, power=power))
    found = electrics.drive_loss(rows, 75.0).known
    apart = electrics.SWITCHED in found
    assert apart is (voltages[0] != voltages[1])
    for u in (voltages[0] / 75.0, voltages[1] / 75.0):
        for amperes in (0.0, 5.0, 15.0):
            told = found["fixed_loss"] + found["conduction_loss"] * amperes
            told += found["square_loss"] * amperes**2
            told += (found.get(electrics.SWITCHED, 0.0) * u) if apart else 0.0
            told += found.get(electrics.SWITCHED_LINEAR, 0.0) * u * amperes if apart else 0.0
            true = 4.0 + 5.0 * u + (1.5 + 0.6 * u) * amperes + 0.015 * amperes**2
            assert told == pytest.approx(true, abs=0.1), (u, amperes)
    cots = electrics.drive_loss(rows[:1], None).known
    assert set(cots) == set(electrics.COTS)


def test_winding_is_what_current_squared_costs() -> None:
    velocity = motion(np.random.default_rng(2), 0.05)
    rows = []
    for square in (9.0, 40.0, 90.0):
        one = record(velocity, velocity, 500.0 * velocity, current_square=square)
        rows.append(one._replace(ac=one.shaft + 0.5 * square / 1.5))
    assert electrics.winding(rows).known[electrics.RESISTANCE] == pytest.approx(0.5)


def test_excitation_is_what_motion_and_load_cell_leave() -> None:
    """A sea 7 % larger than asked for; without rows in waves there is only doubt."""
    rng = np.random.default_rng(4)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    z = 1500j * omega + 900.0 + 24_000 / (1j * omega)
    calm = []
    for size in (0.02, 0.08):
        velocity = motion(rng, size)
        calm.append(record(velocity, z * velocity, velocity))
    known = hull(calm)
    bem = Coefficient(np.array([0.05, 2.0]), np.array([9000.0 + 0j, 9000.0 + 0j]), "BEM paper")
    sea = {"repeat_s": 2.0, "cycles": [1], "amplitude_m": [0.1], "phase_rad": [0.0]}
    force = np.where(np.arange(1, LINES + 1) == 10, 1.07 * 9000.0 * 0.1, 0.0)
    velocity = force / (z + 2500.0)
    waves = record(
        velocity, z * velocity - force, velocity, sea=sea, pushed=False, excited=force > 0.0
    )
    assert scale([*calm, waves], known, bem, 0.03).known[SCALE] == pytest.approx(1.07, rel=0.003)
    alone = scale(calm, known, bem, BEM_DEVIATION)
    assert alone.known[SCALE] == 1.0
    assert alone.deviation(SCALE) == pytest.approx(BEM_DEVIATION)


def test_directions_make_up_the_covariance() -> None:
    rng = np.random.default_rng(6)
    columns = rng.normal(size=(200, 3)) * np.array([1.0, 50.0, 0.01])
    found = least_squares(("a", "b", "c"), np.abs(columns), np.abs(columns).sum(axis=1), "paper")
    mixed = rng.normal(size=(3, 3))
    group = Group(found.names, found.values, mixed @ mixed.T, "paper")
    steps = np.array([[step[name] for name in group.names] for step in group.directions()])
    assert steps.T @ steps == pytest.approx(group.covariance, rel=1e-9, abs=1e-9)
    with pytest.raises(ValueError, match="cannot tell"):
        least_squares(("a", "b"), np.ones((2, 2)), np.ones(2), "paper")
