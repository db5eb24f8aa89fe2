"""The vector forms of the plant's forces and losses against the plant's own functions."""

from __future__ import annotations

import numpy as np
import pytest
from predicting import CONFIGS

from rig.config.yaml_source import load_mapping
from rig.design.predictions import electrics, passive, plant
from rig.planning.campaign.set_points import ZERO_SETTING
from sim_plant import body, custom_drive, magnetic_spring, pto, surge

RNG = np.random.default_rng(1)
X, V, F = 0.2 * RNG.standard_normal(40), RNG.standard_normal(40), 900.0 * RNG.standard_normal(40)


def given(name: str) -> plant.Given:
    return plant.given(load_mapping(CONFIGS / "plants" / f"{name}.yaml")[0])


@pytest.mark.parametrize("name", ["wavebot", "wavebot_as_measured", "wavebot_linear"])
@pytest.mark.parametrize("stator", [-93.0, -20.0, 27.0, 50.0])
def test_passive_forces(name: str, stator: float) -> None:
    told = given(name)
    built = told.built
    rate = magnetic_spring.table_rate(built.spring, stator)
    spring = plant.spring(told, [stator])
    friction = plant.friction(told, F[None, :])
    forces = (
        (passive.spring_force(spring, X[None, :])[0],
         [magnetic_spring.force(built.spring, rate, x) for x in X]),
        (passive.friction_force(friction, V[None, :])[0] - built.pto.viscous * V,
         [pto.friction(built.pto, v, f) for v, f in zip(V, F, strict=True)]),
        (passive.drag_force(built.body.quadratic, V) - built.body.viscous * V,
         [body.drag(built.body, v) for v in V]),
    )  # fmt: skip
    for ours, theirs in forces:
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)
    slope = -magnetic_spring.force(built.spring, rate, 1e-7) / 1e-7
    assert passive.small_rate(spring)[0] == pytest.approx(slope, rel=1e-9)


def test_force_in_the_guide() -> None:
    told = given("wavebot")
    params = told.built.surge
    for x, v, f in zip(X, V, F, strict=True):
        state = body.BodyState(x, v, 0.1, 0.2, 0.3, 0.4, 0.5)
        acceleration = body.acceleration(params.body, state, 2.0 * f)
        theirs = surge.guide_force(params, state, f, f)
        one = [np.array([[value]]) for value in (x, acceleration, f)]
        assert plant.guide_force(told, *one)[0, 0] == pytest.approx(theirs, rel=1e-12)


@pytest.mark.parametrize("scheme", [0, 1, 2, 3])
@pytest.mark.parametrize("voltage", [41.0, 75.0, 152.0])
def test_losses_and_voltage_of_the_custom_drive(scheme: int, voltage: float) -> None:
    told = given("wavebot_custom")
    setting = ZERO_SETTING._replace(
        bus_voltage=75.0, switching_period=5e-5, hysteresis_tolerance=0.7,
        velocity_threshold=0.2, discharge_level=3.0,
    )  # fmt: skip
    drive = plant.drive(told, [setting], scheme, 4.0, np.array([voltage]))
    motor = plant.motor(told)
    own = told.file.build(plant.settings_of(setting, scheme)).electrics
    force, v = F[None, :], 0.2 * V[None, :]
    on = electrics.conducts(drive, motor, force, v)
    assert 0.0 < on.mean() < 1.0
    command = electrics.commanded(drive, motor, 40.0, force, v)
    held = electrics.granted(drive, motor, command, v)
    power = electrics.stations(drive, motor, held, force, v, 0.0 * v, v)
    for i in range(F.size):
        current = force[0, i] / motor.newtons_per_ampere
        works = not (abs(v[0, i]) < 0.2 and abs(current) < 4.0)
        assert on[0, i] == works
        ceiling = min(custom_drive.ceiling(own.inverter, voltage, v[0, i]), 40.0)
        granted = min(max(current, -ceiling), ceiling) * works
        assert held[0, i] == pytest.approx(granted * motor.newtons_per_ampere, rel=1e-9, abs=1e-9)
        ac = held[0, i] * v[0, i] + pto.copper_loss(told.built.pto, held[0, i])
        loss = custom_drive.loss(own.inverter, voltage, granted, int(works))
        assert power.dc_record[0, i] == pytest.approx(ac + loss, rel=1e-9, abs=1e-9)
    assert np.min(held) < 0.0 < np.max(held)


def test_losses_of_the_commercial_drive() -> None:
    from sim_plant import cots_drive

    told = given("wavebot")
    drive = plant.drive(told, [ZERO_SETTING], 0, 0.0, np.zeros(1))
    motor = plant.motor(told)
    one = F[None, :]
    power = electrics.stations(drive, motor, one, one, V[None, :], 0.0 * one, V[None, :])
    cots = told.built.electrics.cots
    for i, force in enumerate(F):
        ac = force * V[i] + pto.copper_loss(told.built.pto, force)
        loss = cots_drive.loss(cots, force / motor.newtons_per_ampere)
        assert power.dc_record[0, i] == pytest.approx(ac + loss, rel=1e-12)
    assert power.mechanical_2[0] == pytest.approx(float(np.mean(F * V)), rel=1e-12)
    volts = plant.stiff_bus(told, power.dc_record)
    assert volts[0, 3] == pytest.approx(cots_drive.bus_voltage(cots, power.dc_record[0, 3]))
