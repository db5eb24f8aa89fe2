"""Fits of the flap's sessions against closed forms, and blind tests on random flaps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from flap_files import DT, SMOOTH, changed, flap
from numpy.typing import NDArray

from rig.kinds.oswec_bench.products import (
    flap_decay,
    flap_pto,
    flap_rao,
    flap_stiffness,
    periods,
)
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.flap_pto import PtoPoint
from rig.kinds.oswec_bench.products.flap_stiffness import MovingSamples
from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledFlapStepper
from sim_plant import sea_states
from sim_plant.bem import excitation_at
from sim_plant.flap import hydrodynamics
from sim_plant.flap.oswec import FlapParams
from sim_plant.flap.world import OFF

Floats = NDArray[np.float64]
ANGLES = (6.0, -10.0, 14.0, -20.0)  # deg, release angles
COUNT = 1.0 / 524288.0 * 2.0 * math.pi  # rad


def swinging_root(params: FlapParams) -> complex:
    """Return the slow root of the flap, with radiation and the viscous losses of both seals."""
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


def simulate_releases(values: dict[str, Any], seed: int) -> tuple[FlapParams, list[Floats]]:
    """Return encoder angles of releases of a simulated flap, every tick, rad from rest."""
    world = flap(name="oswec_flap_free", seed=seed, stepper=CompiledFlapStepper, **values)
    zero = world.sense().shaft_counts
    releases = []
    for angle in ANGLES:
        world.actuate(OFF._replace(locked=1))
        world.set_angle(math.radians(angle))
        world.advance(DT)
        world.advance(DT)  # readings are one tick old
        world.actuate(OFF)
        counts = []
        for _ in range(11000):
            world.advance(DT)
            counts.append(world.sense().shaft_counts - zero)
        releases.append(COUNT * np.array(counts))
    return world.params, releases


def test_the_decay_of_a_linear_flap_matches_its_eigenvalue() -> None:
    params, angles = simulate_releases(SMOOTH, seed=1)
    decay = flap_decay.fit_decay([flap_decay.prepare_release(each, DT) for each in angles])
    root = swinging_root(params)
    assert decay.period.value == pytest.approx(2.0 * math.pi / root.imag, rel=2e-4)
    assert decay.decay_rate.value == pytest.approx(-root.real, rel=2e-3)
    assert abs(decay.quadratic.value) < 1e-3
    assert abs(decay.friction.value) < 1e-4


def test_the_constants_of_random_flaps_are_recovered() -> None:
    """Intervals are a jackknife's over four releases, plus 0.1 % for errors without scatter."""
    random = np.random.default_rng(11)
    covered = []
    for seed in range(4):
        draw = {
            "flap__buoyancy": float(random.uniform(60.0, 120.0)),
            "flap__inertia": float(random.uniform(1.0, 6.0)),
            "flap__viscous_linear": float(random.uniform(0.2, 3.0)),
            "flap__viscous_quadratic": float(random.uniform(3.0, 12.0)),
        }
        params, angles = simulate_releases(draw, seed)
        decay = flap_decay.fit_decay([flap_decay.prepare_release(each, DT) for each in angles])
        root, line = swinging_root(params), params.driveline
        sides = (line.bearing, line.seal, params.far_side)
        dry = sum(0.5 * (one.clockwise + one.counterclockwise) for one in sides)
        truths = (
            (decay.period, 2.0 * math.pi / root.imag),
            (decay.decay_rate, -root.real),
            (decay.quadratic, params.body.quadratic / params.body.buoyancy),
            (decay.friction, dry / params.body.buoyancy),
        )
        covered += [
            abs(one.value - truth) <= 2.0 * one.uncertainty + 1e-3 * truth for one, truth in truths
        ]
        for one, truth in truths:
            assert one.value == pytest.approx(truth, rel=0.02)
    assert sum(covered) >= len(covered) - 1


def test_the_simulated_fit_follows_the_measured_release() -> None:
    _, angles = simulate_releases({}, seed=3)
    releases = [flap_decay.prepare_release(each, DT) for each in angles]
    decay = flap_decay.fit_decay(releases)
    for one in releases:
        fitted = flap_decay.simulate_release(decay.fit, float(one.angle[0]), len(one.angle), DT)
        assert np.abs(fitted - one.angle).max() < math.radians(0.1)
        rest = decay.rest_angle.value
        measured, simulated = (
            np.array(flap_decay.half_swing_losses(one._replace(angle=angle), rest))
            for angle in (one.angle, fitted)
        )
        np.testing.assert_allclose(measured, simulated, atol=math.radians(0.1))


def test_too_few_or_motionless_releases_are_refused() -> None:
    with pytest.raises(ValueError, match="does not move"):
        flap_decay.prepare_release(np.zeros(2000), DT)
    with pytest.raises(ValueError, match="0 releases; a decay needs at least 4"):
        flap_decay.fit_decay([])


def test_two_periods_separate_spring_and_inertia() -> None:
    """Blind test: 95 % intervals over 200 draws of a synthetic moment."""
    random = np.random.default_rng(5)
    covered = []
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
                is_moving = np.abs(speed) > 0.1 * amplitude * omega
                columns = (angle, speed, rate, torque, t)
                groups.append(MovingSamples(*(each[is_moving] for each in columns)))
        spring = flap_stiffness.fit_spring(groups)
        assert spring.stiffness.value == pytest.approx(stiffness, rel=0.01)
        covered.append(spring.stiffness.covers(stiffness))
    # 0.95 minus three standard deviations of a share of 200; CELL_UNCERTAINTY widens the intervals.
    assert np.mean(covered) >= 0.90
    with pytest.raises(ValueError, match="at least 4"):
        flap_stiffness.fit_spring(groups[:3])


def test_the_response_to_an_irregular_sea_matches_the_closed_form() -> None:
    cycles, repeat = [5, 7, 11, 13, 17], 20.0
    sea = {
        "repeat_s": repeat, "cycles": cycles,
        "amplitude_m": [0.01] * 5, "phase_rad": [0.0, 1.0, 4.0, 2.0, 5.0],
    }  # fmt: skip
    components = sea_states.components(repeat, cycles, sea["amplitude_m"], sea["phase_rad"])
    damped = {**SMOOTH, "flap__viscous_linear": 25.0}
    world = flap(components, "oswec_flap_free", stepper=CompiledFlapStepper, **damped)
    world.make_waves(1)
    angle = []
    for _ in range(80000):
        world.advance(DT)
        angle.append(world.truth().driveline.shaft_angle)
    last = np.array(angle[40000:])
    cut = periods.cut_periods(len(last), repeat, DT)
    lines = flap_rao.response_lines(last, cut.edges, sea, 40.0 + DT, DT)
    frequency = np.array(cycles) / repeat
    excitation = excitation_at(changed("oswec_flap_free", **damped).coefficients(), frequency)
    impedance = hydrodynamics.impedance(world.params.body, frequency)
    # The table of excitation is e^{-i omega t}; the response here e^{+i omega t}.
    expected = np.conj(excitation) / (2j * np.pi * frequency * impedance)
    np.testing.assert_allclose([one.response for one in lines], expected, rtol=1.5e-3)
    assert all(one.magnitude.uncertainty < 1e-2 * one.magnitude.value for one in lines)


def test_a_known_resonance_is_recovered() -> None:
    unknowns = np.array([1.8, 0.25, 4.0, 1.5, 0.3])
    omega = np.linspace(1.0, 6.0, 11)
    size = flap_rao.fitted_magnitude(unknowns, omega)
    lines = [
        flap_rao.ResponseLine(
            w / (2.0 * math.pi), 0.05, complex(s), Estimate(float(s), 0.01, "rad/m", "")
        )
        for w, s in zip(omega, size, strict=True)
    ]
    resonance = flap_rao.fit_resonance(lines)
    assert resonance is not None
    np.testing.assert_allclose(
        flap_rao.fitted_magnitude(resonance.unknowns, omega), size, rtol=1e-4
    )
    assert resonance.relative_rms < 1e-4
    fine = np.linspace(1.0, 6.0, 20000)
    top = fine[np.argmax(flap_rao.fitted_magnitude(unknowns, fine))]
    assert resonance.period.value == pytest.approx(2.0 * math.pi / top, rel=2e-3)
    assert flap_rao.fit_resonance(lines[:6]) is None


@pytest.mark.parametrize("period", [1.0, 1.5, 2.0])
def test_the_optimal_damping_matches_equation_2_2(period: float) -> None:
    """Powers follow the closed form of the shipped flap; eq. 2.2 with omega gives the fit's
    optimum.
    """
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
        power_estimate = Estimate(power, 1e-3, "W", "")
        points.append(PtoPoint(damping, 0.0, power_estimate, power_estimate, 0.1))
    optimum = flap_pto.optimal_damping(points)
    assert optimum is not None
    assert optimum.damping.value == pytest.approx(ideal, rel=1e-4)
    max_power = 0.25 * moment**2 / (ideal + nu)
    assert optimum.power.value == pytest.approx(max_power, rel=1e-4)
    assert flap_pto.optimal_damping(points[:4]) is None


def test_damping_and_power_of_a_synthetic_motion() -> None:
    """T = -R v + X a / omega: resistance, reactance and power computed by hand."""
    omega = 2.0 * math.pi
    t = DT * np.arange(8000)
    angle, speed = 0.2 * np.sin(omega * t), 0.2 * omega * np.cos(omega * t)
    resistance, reactance = 60.0, 12.0
    torque = -resistance * speed + reactance * omega * angle
    cut = periods.cut_periods(len(t), 1.0, DT)
    point = flap_pto.pto_point(angle, angle, torque, 0.5 * torque, cut)
    assert point.damping == pytest.approx(resistance, rel=2e-3)
    assert point.reactance == pytest.approx(reactance, rel=2e-3)
    assert point.power.value == pytest.approx(0.5 * resistance * (0.2 * omega) ** 2, rel=2e-3)
    assert point.motor_power.value == pytest.approx(0.5 * point.power.value, rel=1e-9)
    assert point.amplitude == pytest.approx(0.2, rel=1e-6)
