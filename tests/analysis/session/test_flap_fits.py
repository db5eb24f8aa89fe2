"""The fits of the flap's sessions against closed forms, and blind on flaps drawn from a seed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from flap_files import DT, SMOOTH, changed, flap
from numpy.typing import NDArray

from rig.analysis.session import flap_decay, flap_pto, flap_rao, flap_stiffness, periods
from rig.analysis.session.estimate import Estimate
from rig.analysis.session.flap_pto import Taken
from rig.analysis.session.flap_stiffness import Turned
from rig.execution.rehearsal.compiled_bench import CompiledFlapStepper
from sim_plant import waves
from sim_plant.bem import excitation_at
from sim_plant.flap import hydrodynamics
from sim_plant.flap.oswec import FlapParams
from sim_plant.flap.world import OFF

Floats = NDArray[np.float64]
ANGLES = (6.0, -10.0, 14.0, -20.0)  # deg, let go
COUNT = 1.0 / 524288.0 * 2.0 * math.pi  # rad


def slow_root(params: FlapParams) -> complex:
    """Of the flap with its viscous losses, both seals' among them, and its radiation."""
    inertia, buoyancy, viscous, _, r1, d0, d1 = params.body
    line = params.driveline
    viscous += line.bearing.viscous + line.seal.viscous + params.far_side.viscous
    matrix = np.array(
        [
            [0, 1, 0, 0],
            [-buoyancy / inertia, -viscous / inertia, 0, -r1 / inertia],
            [0, 0, 0, 1],
            [0, 1, -d0, -d1],
        ]
    )
    poles = np.linalg.eigvals(matrix)
    return complex(poles[np.argmax(np.where(poles.imag > 0, poles.real, -np.inf))])


def swings(values: dict[str, Any], seed: int) -> tuple[FlapParams, list[Floats]]:
    """Encoder angles of releases of a simulated flap, every tick, rad from its rest."""
    world = flap(name="oswec_flap_free", seed=seed, stepper=CompiledFlapStepper, **values)
    zero = world.sense().shaft_counts
    found = []
    for angle in ANGLES:
        world.actuate(OFF._replace(locked=1))
        world.place(math.radians(angle))
        world.advance(DT)
        world.advance(DT)  # what is read is a tick old
        world.actuate(OFF)
        counts = []
        for _ in range(11000):
            world.advance(DT)
            counts.append(world.sense().shaft_counts - zero)
        found.append(COUNT * np.array(counts))
    return world.params, found


def test_a_linear_flap_swings_with_its_own_root() -> None:
    params, angles = swings(SMOOTH, seed=1)
    found = flap_decay.decay([flap_decay.release(each, DT) for each in angles])
    root = slow_root(params)
    assert found.period.value == pytest.approx(2.0 * math.pi / root.imag, rel=2e-4)
    assert found.rate.value == pytest.approx(-root.real, rel=2e-3)
    assert abs(found.quadratic.value) < 1e-3
    assert abs(found.friction.value) < 1e-4


def test_flaps_drawn_from_a_seed_are_recovered() -> None:
    """Intervals of a jackknife over four releases, widened by 0.1 % of what no scatter shows."""
    random = np.random.default_rng(11)
    held = []
    for seed in range(4):
        draw = {
            "flap__buoyancy": float(random.uniform(60.0, 120.0)),
            "flap__inertia": float(random.uniform(1.0, 6.0)),
            "flap__viscous_linear": float(random.uniform(0.2, 3.0)),
            "flap__viscous_quadratic": float(random.uniform(3.0, 12.0)),
        }
        params, angles = swings(draw, seed)
        found = flap_decay.decay([flap_decay.release(each, DT) for each in angles])
        root, line = slow_root(params), params.driveline
        sides = (line.bearing, line.seal, params.far_side)
        dry = sum(0.5 * (one.clockwise + one.counter) for one in sides)
        truths = (
            (found.period, 2.0 * math.pi / root.imag),
            (found.rate, -root.real),
            (found.quadratic, params.body.quadratic / params.body.buoyancy),
            (found.friction, dry / params.body.buoyancy),
        )
        held += [
            abs(one.value - truth) <= 2.0 * one.uncertainty + 1e-3 * truth for one, truth in truths
        ]
        for one, truth in truths:
            assert one.value == pytest.approx(truth, rel=0.02)
    assert sum(held) >= len(held) - 1


def test_the_fit_swings_as_the_flap_did() -> None:
    _, angles = swings({}, seed=3)
    releases = [flap_decay.release(each, DT) for each in angles]
    found = flap_decay.decay(releases)
    for one in releases:
        fitted = flap_decay.swing(found.fit, float(one.angle[0]), len(one.angle), DT)
        assert np.abs(fitted - one.angle).max() < math.radians(0.1)
        rest = found.rest.value
        mine, theirs = (
            np.array(flap_decay.losses(one._replace(angle=angle), rest))
            for angle in (one.angle, fitted)
        )
        np.testing.assert_allclose(mine, theirs, atol=math.radians(0.1))


def test_few_or_still_releases_are_refused() -> None:
    with pytest.raises(ValueError, match="does not move"):
        flap_decay.release(np.zeros(2000), DT)
    with pytest.raises(ValueError, match="0 releases; a decay needs at least 4"):
        flap_decay.decay([])


def test_spring_and_inertia_of_slow_motion_are_told_apart() -> None:
    """Blind: 95 % intervals over 200 draws of a made-up moment."""
    random = np.random.default_rng(5)
    held = []
    for _ in range(200):
        stiffness, inertia = random.uniform(50.0, 150.0), random.uniform(5.0, 40.0)
        dry, viscous, rest = random.uniform(0.2, 2.0), random.uniform(0.0, 3.0), 0.01
        groups = []
        for amplitude in (0.15, 0.3):
            for period in (20.0, 60.0):
                omega = 2.0 * math.pi / period
                t = 0.05 * np.arange(round(3.0 * period / 0.05))
                angle, speed = amplitude * np.cos(omega * t), -amplitude * omega * np.sin(omega * t)
                rate = -omega * omega * angle
                torque = stiffness * (angle - rest) + dry * np.sign(speed) + viscous * speed
                torque += inertia * rate + random.normal(0.0, 0.02) * angle
                torque += random.normal(0.0, 0.05, len(t))
                turns = np.abs(speed) > 0.1 * amplitude * omega
                columns = (angle, speed, rate, torque, t)
                groups.append(Turned(*(each[turns] for each in columns)))
        found = flap_stiffness.spring(groups, "set points")
        assert found.stiffness.value == pytest.approx(stiffness, rel=0.01)
        held.append(found.stiffness.holds(stiffness))
    # 0.95 less three standard deviations of a share of 200; CELL's 0.1 % makes it wider.
    assert np.mean(held) >= 0.90
    with pytest.raises(ValueError, match="at least 4"):
        flap_stiffness.spring(groups[:3], "set points")


def test_the_response_to_an_irregular_sea_is_that_of_the_closed_form() -> None:
    cycles, repeat = [5, 7, 11, 13, 17], 20.0
    sea = {
        "repeat_s": repeat, "cycles": cycles,
        "amplitude_m": [0.01] * 5, "phase_rad": [0.0, 1.0, 4.0, 2.0, 5.0],
    }  # fmt: skip
    made = waves.components(repeat, cycles, sea["amplitude_m"], sea["phase_rad"])
    damped = {**SMOOTH, "flap__viscous_linear": 25.0}
    world = flap(made, "oswec_flap_free", stepper=CompiledFlapStepper, **damped)
    world.make_waves(1)
    angle = []
    for _ in range(80000):
        world.advance(DT)
        angle.append(world.truth().driveline.shaft_angle)
    last = np.array(angle[40000:])
    of = periods.cut(len(last), repeat, DT)
    found = flap_rao.lines(last, of.edges, sea, 40.0 + DT, DT)
    frequency = np.array(cycles) / repeat
    push = excitation_at(changed("oswec_flap_free", **damped).coefficients(), frequency)
    impedance = hydrodynamics.impedance(world.params.body, frequency)
    # The table of excitation is e^{-i omega t}; the response here e^{+i omega t}.
    wanted = np.conj(push) / (2j * np.pi * frequency * impedance)
    np.testing.assert_allclose([one.response for one in found], wanted, rtol=1.5e-3)
    assert all(one.size.uncertainty < 1e-2 * one.size.value for one in found)


def test_a_resonance_is_found_again() -> None:
    unknowns = np.array([1.8, 0.25, 4.0, 1.5, 0.3])
    omega = np.linspace(1.0, 6.0, 11)
    size = flap_rao.fitted_size(unknowns, omega)
    lines = [
        flap_rao.Line(w / (2.0 * math.pi), 0.05, complex(s), Estimate(float(s), 0.01, "rad/m", ""))
        for w, s in zip(omega, size, strict=True)
    ]
    found = flap_rao.resonance(lines)
    assert found is not None
    np.testing.assert_allclose(flap_rao.fitted_size(found.unknowns, omega), size, rtol=1e-4)
    assert found.off < 1e-4
    fine = np.linspace(1.0, 6.0, 20000)
    top = fine[np.argmax(flap_rao.fitted_size(unknowns, fine))]
    assert found.period.value == pytest.approx(2.0 * math.pi / top, rel=2e-3)
    assert flap_rao.resonance(lines[:6]) is None


@pytest.mark.parametrize("period", [1.0, 1.5, 2.0])
def test_the_best_damping_is_that_of_equation_2_2(period: float) -> None:
    """Powers by the closed form of the shipped flap; eq. 2.2 with omega gives the fit's top."""
    body = changed().build_flap().body
    omega = 2.0 * math.pi / period
    memory = complex(hydrodynamics.radiation(body, 1.0 / period))
    mass, nu = body.inertia + memory.imag / omega, memory.real + body.viscous
    ideal = math.sqrt((body.buoyancy - mass * omega**2) ** 2 / omega**2 + nu**2)
    impedance = complex(hydrodynamics.impedance(body, 1.0 / period))
    moment = 4.0
    points = []
    for damping in (10.0, 25.0, 45.0, 70.0, 100.0, 160.0):
        power = 0.5 * moment**2 * damping / abs(impedance + damping) ** 2
        told = Estimate(power, 1e-3, "W", "")
        points.append(Taken(damping, 0.0, told, told, 0.1))
    found = flap_pto.best(points)
    assert found is not None
    assert found.damping.value == pytest.approx(ideal, rel=1e-4)
    most = 0.25 * moment**2 / (ideal + nu)
    assert found.power.value == pytest.approx(most, rel=1e-4)
    assert flap_pto.best(points[:4]) is None


def test_damping_and_power_of_made_up_motion() -> None:
    """T = -R v + X a / omega: resistance, reactance and power by hand."""
    omega = 2.0 * math.pi
    t = DT * np.arange(8000)
    angle, speed = 0.2 * np.sin(omega * t), 0.2 * omega * np.cos(omega * t)
    resistance, reactance = 60.0, 12.0
    torque = -resistance * speed + reactance * omega * angle
    of = periods.cut(len(t), 1.0, DT)
    found = flap_pto.taken(angle, angle, torque, 0.5 * torque, of, 0.02)
    assert found.damping == pytest.approx(resistance, rel=2e-3)
    assert found.reactance == pytest.approx(reactance, rel=2e-3)
    assert found.power.value == pytest.approx(0.5 * resistance * (0.2 * omega) ** 2, rel=2e-3)
    assert found.motor.value == pytest.approx(0.5 * found.power.value, rel=1e-9)
    assert found.amplitude == pytest.approx(0.2, rel=1e-6)
