"""The walk of the DC bus against the simulated bus, ticked at 1 ms with the same power."""

from __future__ import annotations

import math

import numpy as np
import pytest
from predicting import CONFIGS

from rig.config.yaml_source import load_mapping
from rig.design.predictions import plant
from rig.design.predictions.bus import FOLLOWS, Bus, Stretch, stepped, walk
from rig.design.predictions.grid import grid
from rig.planning.campaign.set_points import ZERO_SETTING
from sim_plant import bus

DT = 0.001


def told(name: str) -> plant.Given:
    return plant.given(load_mapping(CONFIGS / "plants" / f"{name}.yaml")[0])


def buses(name: str, voltage: float, level: int) -> tuple[Bus, bus.BusParams]:
    """Ours and theirs at the same settings."""
    given = told(name)
    setting = ZERO_SETTING._replace(
        bus_voltage=voltage, switching_period=1e-4, hysteresis_tolerance=0.5,
        discharge_level=float(level),
    )  # fmt: skip
    theirs = given.file.build(plant.settings_of(setting, 0)).electrics.bus
    return plant.bus(given, setting, 0), theirs


@pytest.mark.parametrize("name", ["wavebot_custom", "wavebot_custom_islanded"])
@pytest.mark.parametrize(("mean", "swing"), [(-40.0, 120.0), (6.0, 30.0), (25.0, 60.0)])
def test_a_row_of_power(name: str, mean: float, swing: float) -> None:
    """Voltage within 1 V, dump within 2 W."""
    ours, theirs = buses(name, 75.0, 3)
    on = grid(2.0)
    t = np.arange(on.samples) * on.step
    power, step = stepped(on, mean + swing * np.cos(4.0 * np.pi * t / 2.0))
    assert step == pytest.approx(0.02)
    (found,) = walk([Stretch(ours, power, step, 20.0)])
    state = bus.charged(theirs)
    voltages = []
    for k in range(20_000):
        state = bus.bus_step(
            theirs, state, mean + swing * math.cos(4.0 * math.pi * (k + 0.5) * DT / 2.0), DT
        )
        voltages.append(state.voltage)
    late = voltages[round(FOLLOWS / DT) :]
    assert found.highest == pytest.approx(max(late), abs=1.0)
    assert found.lowest == pytest.approx(min(late), abs=1.0)
    assert found.mean == pytest.approx(float(np.mean(voltages)), abs=0.5)
    assert found.dumped == pytest.approx(state.dumped / 20.0, abs=2.0)


def test_what_one_row_leaves_the_next_has() -> None:
    """Without supply 10 W more or less move the stored energy by 10 J a second."""
    ours, _ = buses("wavebot_custom_islanded", 75.0, 0)
    found = walk([Stretch(ours, (-10.0,), 0.02, 5.0), Stretch(ours, (10.0,), 0.02, 5.0)])
    top = math.sqrt(75.0**2 + 2.0 * 50.0 / ours.capacitance)
    assert found[0].highest == pytest.approx(top, rel=1e-3)
    assert found[1].lowest == pytest.approx(75.0, rel=1e-3)


def test_a_bus_that_tripped_is_charged_anew() -> None:
    ours, _ = buses("wavebot_custom_islanded", 75.0, 0)
    drained = Stretch(ours, (100.0,), 0.02, 5.0)
    found = walk([drained, Stretch(ours, (0.0,), 0.02, 5.0)])
    assert found[0].lowest < ours.undervoltage
    assert found[1].lowest == pytest.approx(75.0)


def test_a_raised_set_point_is_no_undervoltage() -> None:
    """The supply follows within some 10 ms; the trip waits longer."""
    low, _ = buses("wavebot_custom", 40.0, 15)
    high, _ = buses("wavebot_custom", 150.0, 15)
    found = walk([Stretch(low, (5.0,), 0.02, 5.0), Stretch(high, (5.0,), 0.02, 5.0)])
    assert found[0].highest < 46.0
    assert found[1].lowest > high.undervoltage


def test_means_keep_the_energy() -> None:
    on = grid(7.3)
    power = np.random.default_rng(4).standard_normal(on.samples) * 100.0
    values, step = stepped(on, power)
    assert step * len(values) == pytest.approx(on.period)
    assert np.mean(values) == pytest.approx(float(np.mean(power)), abs=1e-9)
