"""The flap against closed forms: free decay, static spring, response to waves, best PTO damping."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flap_files import DT, SMOOTH, changed, flap, torque
from numpy.typing import NDArray
from plant_files import mapping
from pydantic import ValidationError

from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledFlapStepper
from sim_plant import sea_states
from sim_plant.bem import excitation_at
from sim_plant.flap import hydrodynamics
from sim_plant.flap.body import FlapBodyParams
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.world import FlapWorld


def motion_matrix(params: FlapBodyParams) -> NDArray[np.float64]:
    """Angle, velocity, and the two radiation states in companion form."""
    inertia, buoyancy, viscous, _, r1, d0, d1 = params
    return np.array(
        [
            [0, 1, 0, 0],
            [-buoyancy / inertia, -viscous / inertia, 0, -r1 / inertia],
            [0, 0, 0, 1],
            [0, 1, -d0, -d1],
        ]
    )


def test_free_decay() -> None:
    """Release from 0.2 rad: the modal solution to 2e-5, thus frequency and damping.

    A leapfrog that starts at rest is half a tick late.
    """
    world = flap(name="oswec_flap_free", **SMOOTH)
    world.release(0.2)
    angles = [0.2]
    for _ in range(10000):
        world.advance(DT)
        angles.append(world.truth().driveline.shaft_angle)
    poles, modes = np.linalg.eig(motion_matrix(world.params.body))
    weights = np.linalg.solve(modes, np.array([0.2, 0, 0, 0]))
    time = DT * np.maximum(np.arange(10001) - 0.5, 0.0)
    exact = ((modes[0] * weights) @ np.exp(np.outer(poles, time))).real
    np.testing.assert_allclose(angles, exact, rtol=0.0, atol=0.2 * 2e-5)
    slow = poles[np.argmax(np.where(poles.imag > 0, poles.real, -np.inf))]
    assert 2 * math.pi / slow.imag == pytest.approx(3.5, abs=0.15)  # above the waves of the flume
    tops = [k for k in range(1, 10000) if angles[k - 1] < angles[k] >= angles[k + 1]]
    assert len(tops) >= 2
    assert (tops[1] - tops[0]) * DT == pytest.approx(2 * math.pi / slow.imag, rel=2e-3)
    assert math.log(angles[tops[0]] / angles[tops[1]]) == pytest.approx(
        -slow.real * 2 * math.pi / slow.imag, rel=1e-2
    )


def test_static_spring() -> None:
    """Held by a steady current, the cell reads C theta; the motor's torque is the same."""
    world = flap(**SMOOTH, flap__viscous_linear=60.0, stepper=CompiledFlapStepper)
    buoyancy = world.params.body.buoyancy
    for current in (0.5, 1.0, -0.5):
        for _ in range(9000):
            world.actuate(torque(current))
            world.advance(DT)
        line = world.truth().driveline
        assert line.shaft_torque == pytest.approx(buoyancy * line.shaft_angle, rel=1e-3)
        assert line.motor_torque == pytest.approx(line.shaft_torque, rel=1e-3)
        assert line.motor_torque == pytest.approx(18.0 * current, rel=1e-6)


def response(world: FlapWorld, cycles: list[int], repeat: float) -> NDArray[np.complex128]:
    """Angle per metre of elevation at lines k/repeat, e^{-i omega t}, over one repeat period."""
    world.make_waves(1)
    settle, length = round(25.0 / repeat + 0.5) * round(repeat / DT), round(repeat / DT)
    angle, elevation = [], []
    for k in range(settle + length):
        world.advance(DT)
        if k >= settle:
            truth = world.truth()
            angle.append(truth.driveline.shaft_angle)
            elevation.append(truth.elevation)
    turned, raised = (np.fft.fft(np.array(part))[cycles] for part in (angle, elevation))
    return np.asarray(np.conj(turned / raised))


DAMPED = {**SMOOTH, "flap__viscous_linear": 25.0}  # its initial transient decays quickly


def expected(world: FlapWorld, plant: FlapPlant, frequency: NDArray[np.float64]) -> NDArray:
    impedance = hydrodynamics.impedance(world.params.body, frequency)
    reached = excitation_at(plant.coefficients(), frequency)
    return np.asarray(reached / np.conj(2j * np.pi * frequency * impedance))


@pytest.mark.parametrize("frequency", [0.3, 0.5, 1.0])
def test_response_to_regular_waves(frequency: float) -> None:
    """The free flap's response amplitude operator, complex, to 1e-3."""
    sea = sea_states.regular(0.05, frequency)
    world = flap(sea, "oswec_flap_free", stepper=CompiledFlapStepper, **DAMPED)
    measured = response(world, sea.cycles.tolist(), sea.repeat)
    expected_response = expected(world, changed("oswec_flap_free"), np.array([frequency]))
    np.testing.assert_allclose(measured, expected_response, rtol=1e-3)


def test_response_to_irregular_waves() -> None:
    """The response to every line of an irregular sea equals that to a regular wave."""
    cycles, repeat = [5, 7, 11, 13, 17, 20], 20.0
    sea = sea_states.components(repeat, cycles, [0.01] * 6, [0.0, 1.0, 4.0, 2.0, 5.0, 3.0])
    world = flap(sea, "oswec_flap_free", stepper=CompiledFlapStepper, **DAMPED)
    measured = response(world, cycles, repeat)
    expected_response = expected(world, changed("oswec_flap_free"), np.array(cycles) / repeat)
    np.testing.assert_allclose(measured, expected_response, rtol=1.5e-3)


STIFF = {
    **SMOOTH,
    "transmission__half_gap": 0.0,
    "transmission__soft_deflection": 0.0,
    "transmission__gearbox_stiffness": 1.0e6,
    "transmission__coupling_stiffness": 1.0e7,
}


def absorbed(damping: float, frequency: float, amplitude: float) -> float:
    """Return the mean power that the motor absorbs as a linear damper of its own angle, W."""
    sea = sea_states.regular(amplitude, frequency)
    world = flap(sea, stepper=CompiledFlapStepper, **STIFF)
    world.make_waves(1)
    per_current = world.params.driveline.motor.torque_per_current
    period = round(1 / frequency / DT)
    power = 0.0
    for k in range(14 * period):
        line = world.truth().driveline
        world.actuate(torque(-damping * line.motor_velocity / per_current))
        world.advance(DT)
        if k >= 12 * period:
            after = world.truth().driveline
            power -= after.motor_torque * (after.motor_angle - line.motor_angle) / (2 * period * DT)
    return power


def test_best_pto_damping_in_a_one_second_sea() -> None:
    """Eq. 2.2 with omega: the best damping is |Z|, the motor's inertia in it, to 1 %.

    Power to 0.3 % of F² R / (2 |Z + R'|²), where R' is R seen a tick late through the shaft.
    """
    plant = changed(**STIFF)
    params = plant.build_flap()
    line = params.driveline
    s = 2j * math.pi
    z = complex(hydrodynamics.impedance(params.body, 1.0)) + s * line.motor.inertia
    moment = 0.08 * abs(complex(excitation_at(plant.coefficients(), np.array([1.0]))[0]))
    dampings = [abs(z) * share for share in (0.7, 1.0, 1.4)]
    powers = [absorbed(damping, 1.0, 0.08) for damping in dampings]
    for damping, power in zip(dampings, powers, strict=True):
        load = damping * np.exp(-s * DT)
        seen = load / (1 + s * load / line.transmission.stiffness)
        closed = 0.5 * seen.real * moment * moment / abs(z + seen) ** 2
        assert power == pytest.approx(closed, rel=3e-3)
    bend = np.polyfit(np.log(dampings), powers, 2)
    assert math.exp(-bend[1] / (2 * bend[0])) == pytest.approx(abs(z), rel=0.01)


def test_ideal_dampings_are_those_of_the_thesis() -> None:
    """42-104 N m s/rad for waves of 1, 1.5 and 2 s (thesis, 2.1 and Table 2.1)."""
    params = changed().build_flap().body
    ideal = np.abs(hydrodynamics.impedance(params, [1.0, 1 / 1.5, 0.5]))
    assert 42 < ideal.min() < ideal.max() < 104
    for period, damping in zip((1.0, 1.5, 2.0), ideal, strict=True):
        omega = 2 * math.pi / period
        memory = complex(hydrodynamics.radiation(params, 1 / period))
        mass = params.inertia + memory.imag / omega  # I + mu
        nu = memory.real + params.viscous
        closed = math.sqrt((params.buoyancy - mass * omega**2) ** 2 / omega**2 + nu**2)
        assert damping == pytest.approx(closed, rel=1e-12)


def test_absorbed_power_is_within_the_capture_width() -> None:
    """|X|²/(8 nu) of a cosine radiator is the power over lambda/pi of crest (Falnes)."""
    plant = changed()
    table = plant.coefficients()
    omega = 2 * math.pi * table.frequency
    k = hydrodynamics.wave_number(omega, 0.75)
    np.testing.assert_allclose(omega**2, 9.81 * k * np.tanh(0.75 * k), rtol=1e-12)
    step = 1e-5 * omega
    slope = (
        2
        * step
        / (
            hydrodynamics.wave_number(omega + step, 0.75)
            - hydrodynamics.wave_number(omega - step, 0.75)
        )
    )
    np.testing.assert_allclose(hydrodynamics.group_velocity(omega, 0.75), slope, rtol=1e-7)
    flux = 0.5 * 1000 * 9.81 * slope  # W per metre of crest and metre² of amplitude
    most = np.abs(table.excitation) ** 2 / (8 * table.damping)
    np.testing.assert_allclose(most / flux, 2 * np.pi / k / np.pi, rtol=1e-6)


def test_radiation_is_passive() -> None:
    frequency = np.logspace(-3, 3, 400)
    assert np.all(hydrodynamics.radiation(changed().build_flap().body, frequency).real >= 0)


def test_energy() -> None:
    """In waves with the motor braking: wave work equals the work of water, seals and driveline."""
    world = flap(sea_states.regular(0.05, 0.5))
    body, per_current = world.params.body, 18.0
    gave = taken = 0.0
    world.make_waves(1)
    before = world.truth()
    for k in range(20000):
        world.actuate(torque(-40.0 * before.driveline.motor_velocity / per_current))
        world.advance(DT)
        after = world.truth()
        if k >= 12000:
            line = after.driveline
            turned = line.shaft_angle - before.driveline.shaft_angle
            speed = turned / DT
            gave += after.excitation * turned
            taken -= before.radiation * turned
            taken += (body.viscous + body.quadratic * abs(speed)) * speed * turned
            taken -= line.shaft_torque * turned
            taken += (0.8 + 0.1 * abs(speed)) * abs(turned)  # far side
        before = after
    assert gave == pytest.approx(taken, rel=0.01)
    assert gave > 1.0


def test_seal_friction_acts_before_the_load_cell() -> None:
    """In motion, gearbox torque exceeds the cell's reading by bearing and seal friction."""
    plant = changed(gearbox__dry=0.0, gearbox__breakaway=0.0, motor__viscous=0.0)
    drag = plant.build_flap().driveline
    world = FlapWorld(plant, sea_states.calm(), dt=DT, seed=1)
    for _ in range(600):
        world.actuate(torque(1.2))
        world.advance(DT)
    truth, through = world.truth().driveline, world._stepper.state.coupling_torque
    speed = truth.shaft_velocity
    lost = drag.bearing.clockwise + drag.seal.clockwise
    lost += (drag.bearing.viscous + drag.seal.viscous) * speed
    assert speed > 0.1
    assert through - truth.shaft_torque == pytest.approx(lost, rel=1e-2)


def test_friction_holds_a_flap_that_is_nearly_upright() -> None:
    world = flap(name="oswec_flap_free")
    world.release(0.01)  # 0.9 N m against 1.8
    for _ in range(500):
        world.advance(DT)
    assert world.truth().driveline.shaft_angle == 0.01


def test_clamped_flap_does_not_move() -> None:
    world = flap(sea_states.regular(0.05, 0.5))
    world.make_waves(1)
    for _ in range(4000):
        world.actuate(torque(2.0, locked=1))
        world.advance(DT)
    line = world.truth().driveline
    assert line.shaft_angle == 0.0
    assert line.shaft_torque > 25.0


def test_e_stop_and_limit_switch_remove_power() -> None:
    world = flap(sensors__travel=8.0)
    for _ in range(2000):
        world.actuate(torque(3.0))
        world.advance(DT)
    assert (world.sense().limit_switch, world.sense().enabled) in {(1, 0), (0, 1), (0, 0)}
    assert math.degrees(world.truth().driveline.shaft_angle) < 14.0
    world.press_e_stop()
    world.advance(DT)
    world.advance(DT)
    assert (world.sense().e_stop, world.sense().enabled) == (1, 0)


def test_equal_seeds_give_equal_readings() -> None:
    def measured(seed: int) -> list[float]:
        world = flap(sea_states.jonswap(0.1, 1.5, 3.3, 20.0, seed=2), seed=seed)
        world.make_waves(1)
        read = []
        for _ in range(500):
            world.advance(DT)
            read.append(world.sense().tz)
        return read

    assert measured(1) == measured(1)
    assert measured(1) != measured(2)


def test_waves_stop_at_once_and_restart() -> None:
    world = flap(sea_states.regular(0.05, 0.5))
    world.make_waves(1)
    for _ in range(3100):
        world.advance(DT)
    assert world.elevation() == pytest.approx(0.05 * math.cos(math.pi * 3.1), abs=1e-9)
    assert world.truth().wave_clock == pytest.approx(3.1)
    world.make_waves(0)
    world.advance(DT)
    assert (world.elevation(), world.truth().excitation) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("section", "field", "value", "message"),
    [
        ("brake", "fitted", 1, "brake.fitted must be 0"),
        ("flap", "inertia", 0.0, "inertia"),
        ("flap", "coupled", 2, "coupled"),
        ("flap", "radiation_peak", -1.0, "radiation_peak"),
        ("water", "depth", 0.0, "depth"),
    ],
)
def test_bad_values_are_refused_by_name(
    section: str, field: str, value: float, message: str
) -> None:
    text = mapping("oswec_flap.yaml")
    text[section][field] = {**text[section][field], "value": value}
    with pytest.raises(ValidationError, match=message) as refusal:
        FlapPlant.model_validate(text)
    assert len(refusal.value.errors()) == 1
