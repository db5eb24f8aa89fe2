"""Vectorised forces and losses of the plant against the functions of `sim_plant`."""

from __future__ import annotations

import numpy as np
import pytest
from predicting import CONFIGS

from rig.campaign.set_points import zero_setting
from rig.config.yaml_source import load_mapping
from rig.design.axis import drag_force
from rig.kinds.wavebot import heave_loop
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.predictions import drive as drives
from rig.kinds.wavebot.predictions import motion
from sim_plant import body, custom_drive, magnetic_spring, pto, surge
from sim_plant.parameters import Plant

RNG = np.random.default_rng(1)
X, V, F = 0.2 * RNG.standard_normal(40), RNG.standard_normal(40), 900.0 * RNG.standard_normal(40)


def load_plant(name: str) -> Plant:
    return Plant.model_validate(load_mapping(CONFIGS / "plants" / f"{name}.yaml")[0])


@pytest.mark.parametrize("name", ["wavebot", "wavebot_as_measured", "wavebot_linear"])
@pytest.mark.parametrize("stator", [-93.0, -20.0, 27.0, 50.0])
def test_passive_forces(name: str, stator: float) -> None:
    sim_params = load_plant(name).build()
    rate = magnetic_spring.table_rate(sim_params.spring, stator)
    rates = heave_loop.spring_rates(sim_params.spring, [stator])
    friction = motion.friction_size(sim_params.pto, F[None, :])
    forces = (
        (motion.spring_force(sim_params.spring, rates, X[None, :])[0],
         [magnetic_spring.force(sim_params.spring, rate, x) for x in X]),
        (motion.friction_force(sim_params.pto, friction, V[None, :])[0]
         - sim_params.pto.viscous * V,
         [pto.friction(sim_params.pto, v, f) for v, f in zip(V, F, strict=True)]),
        (drag_force(sim_params.body.quadratic, V) - sim_params.body.viscous * V,
         [body.drag(sim_params.body, v) for v in V]),
    )  # fmt: skip
    for vectorised, simulated in forces:
        np.testing.assert_allclose(vectorised, simulated, rtol=1e-12, atol=1e-12)
    slope = -magnetic_spring.force(sim_params.spring, rate, 1e-7) / 1e-7
    assert heave_loop.spring_stiffness(sim_params.spring, rates)[0] == pytest.approx(
        slope, rel=1e-9
    )


def test_force_in_the_guide() -> None:
    params = load_plant("wavebot").build().surge
    for x, v, f in zip(X, V, F, strict=True):
        state = body.BodyState(x, v, 0.1, 0.2, 0.3, 0.4, 0.5)
        acceleration = body.acceleration(params.body, state, 2.0 * f)
        simulated = surge.guide_force(params, state, f, f)
        arguments = [np.array([[value]]) for value in (x, acceleration, f)]
        assert motion.guide_force(params, *arguments)[0, 0] == pytest.approx(simulated, rel=1e-12)


@pytest.mark.parametrize("scheme", [0, 1, 2, 3])
@pytest.mark.parametrize("voltage", [41.0, 75.0, 152.0])
def test_losses_and_voltage_of_the_custom_drive(scheme: int, voltage: float) -> None:
    plant = load_plant("wavebot_custom")
    setting = zero_setting(CampaignFile)._replace(
        bus_voltage=75.0, switching_period=5e-5, hysteresis_tolerance=0.7,
        velocity_threshold=0.2, discharge_level=3.0,
    )  # fmt: skip
    drive = drives.build_drive(plant, [setting], scheme, 40.0, 4.0, np.array([voltage]))
    sim_electrics, sim_pto = drives.electrics_at(plant, setting, scheme), plant.build().pto
    force, v = F[None, :], 0.2 * V[None, :]
    conducting = drives.is_conducting(drive, force, v)
    assert 0.0 < conducting.mean() < 1.0
    command = drives.current_limited_force(drive, force, v)
    limited = drives.voltage_limited_force(drive, command, v)
    _, dc_record = drives.station_powers(drive, limited, force, v, 0.0 * v, v)
    for i in range(F.size):
        current = force[0, i] / drive.motor.newtons_per_ampere
        is_on = not (abs(v[0, i]) < 0.2 and abs(current) < 4.0)
        assert conducting[0, i] == is_on
        ceiling = min(custom_drive.max_current(sim_electrics.inverter, voltage, v[0, i]), 40.0)
        granted = min(max(current, -ceiling), ceiling) * is_on
        assert limited[0, i] == pytest.approx(
            granted * drive.motor.newtons_per_ampere, rel=1e-9, abs=1e-9
        )
        ac = limited[0, i] * v[0, i] + pto.copper_loss(sim_pto, limited[0, i])
        loss = custom_drive.loss(sim_electrics.inverter, voltage, granted, int(is_on))
        assert dc_record[0, i] == pytest.approx(ac + loss, rel=1e-9, abs=1e-9)
    assert np.min(limited) < 0.0 < np.max(limited)


def test_losses_of_the_commercial_drive() -> None:
    from sim_plant import cots_drive

    plant = load_plant("wavebot")
    drive = drives.build_drive(plant, [zero_setting(CampaignFile)], 0, 40.0, 0.0, np.zeros(1))
    force_record = F[None, :]
    powers, dc_record = drives.station_powers(
        drive, force_record, force_record, V[None, :], 0.0 * force_record, V[None, :]
    )
    params = plant.build()
    cots = params.electrics.cots
    for i, force in enumerate(F):
        ac = force * V[i] + pto.copper_loss(params.pto, force)
        loss = cots_drive.loss(cots, force / drive.motor.newtons_per_ampere)
        assert dc_record[0, i] == pytest.approx(ac + loss, rel=1e-12)
    assert powers["mechanical_2"][0] == pytest.approx(float(np.mean(F * V)), rel=1e-12)
    volts = drives.commercial_bus_voltage(cots, dc_record)
    assert volts[0, 3] == pytest.approx(cots_drive.bus_voltage(cots, dc_record[0, 3]))
