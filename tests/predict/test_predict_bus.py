"""The predicted DC bus against the simulated bus, stepped at 1 ms with the same power."""

from __future__ import annotations

import math

import numpy as np
import pytest
from predicting import CONFIGS

from rig.campaign.set_points import zero_setting
from rig.config.yaml_source import load_mapping
from rig.design.grid import build_grid
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.predictions import drive
from rig.kinds.wavebot.predictions.bus import (
    SUPPLY_RISE_TIME,
    BusInterval,
    block_means,
    simulate,
)
from sim_plant.parameters import Plant
from sim_plant.parts import bus

DT = 0.001


def bus_at(name: str, voltage: float, level: int) -> bus.BusParams:
    """Return the bus of a plant at these settings."""
    plant = Plant.model_validate(load_mapping(CONFIGS / "plants" / f"{name}.yaml")[0])
    setting = zero_setting(CampaignFile)._replace(
        bus_voltage=voltage, switching_period=1e-4, hysteresis_tolerance=0.5,
        discharge_level=float(level),
    )  # fmt: skip
    return drive.electrics_at(plant, setting, 0).bus


@pytest.mark.parametrize("name", ["wavebot_custom", "wavebot_custom_islanded"])
@pytest.mark.parametrize(("mean", "swing"), [(-40.0, 120.0), (6.0, 30.0), (25.0, 60.0)])
def test_voltage_of_a_row(name: str, mean: float, swing: float) -> None:
    """Voltage within 1 V, dump within 2 W."""
    params = bus_at(name, 75.0, 3)
    sampling_grid = build_grid(2.0)
    t = np.arange(sampling_grid.samples) * sampling_grid.step
    power, step = block_means(sampling_grid, mean + swing * np.cos(4.0 * np.pi * t / 2.0))
    assert step == pytest.approx(0.02)
    (predicted,) = simulate([BusInterval(params, power, step, 20.0)])
    state = bus.initial(params)
    voltages = []
    for k in range(20_000):
        state = bus.bus_step(
            params, state, mean + swing * math.cos(4.0 * math.pi * (k + 0.5) * DT / 2.0), DT
        )
        voltages.append(state.voltage)
    settled = voltages[round(SUPPLY_RISE_TIME / DT) :]
    assert predicted.highest == pytest.approx(max(settled), abs=1.0)
    assert predicted.lowest == pytest.approx(min(settled), abs=1.0)
    assert predicted.mean == pytest.approx(float(np.mean(voltages)), abs=0.5)
    assert predicted.dump_power == pytest.approx(state.dumped / 20.0, abs=2.0)


def test_a_row_starts_at_the_voltage_of_the_previous_row() -> None:
    """Without supply, 10 W change the stored energy by 10 J per second."""
    islanded_bus = bus_at("wavebot_custom_islanded", 75.0, 0)
    voltages = simulate(
        [
            BusInterval(islanded_bus, (-10.0,), 0.02, 5.0),
            BusInterval(islanded_bus, (10.0,), 0.02, 5.0),
        ]
    )
    top = math.sqrt(75.0**2 + 2.0 * 50.0 / islanded_bus.capacitance)
    assert voltages[0].highest == pytest.approx(top, rel=1e-3)
    assert voltages[1].lowest == pytest.approx(75.0, rel=1e-3)


def test_a_tripped_bus_restarts_at_its_set_voltage() -> None:
    islanded_bus = bus_at("wavebot_custom_islanded", 75.0, 0)
    drained = BusInterval(islanded_bus, (100.0,), 0.02, 5.0)
    voltages = simulate([drained, BusInterval(islanded_bus, (0.0,), 0.02, 5.0)])
    assert voltages[0].lowest < islanded_bus.undervoltage
    assert voltages[1].lowest == pytest.approx(75.0)


def test_a_raised_set_point_causes_no_undervoltage() -> None:
    """The supply follows within about 10 ms; the trip delay is longer."""
    low = bus_at("wavebot_custom", 40.0, 15)
    high = bus_at("wavebot_custom", 150.0, 15)
    voltages = simulate([BusInterval(low, (5.0,), 0.02, 5.0), BusInterval(high, (5.0,), 0.02, 5.0)])
    assert voltages[0].highest < 46.0
    assert voltages[1].lowest > high.undervoltage


def test_block_means_conserve_energy() -> None:
    sampling_grid = build_grid(7.3)
    power = np.random.default_rng(4).standard_normal(sampling_grid.samples) * 100.0
    values, step = block_means(sampling_grid, power)
    assert step * len(values) == pytest.approx(sampling_grid.period)
    assert np.mean(values) == pytest.approx(float(np.mean(power)), abs=1e-9)
