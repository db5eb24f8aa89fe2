"""Drive: enable delay, watchdog, saturation, losses; power analyser."""

from __future__ import annotations

import math

import pytest
from plant_files import DT, QUIET, command, plant, world

from sim_plant.cots_drive import loss
from sim_plant.pto import copper_loss


def test_enables_after_its_delay_and_follows_then() -> None:
    rig = world(**QUIET)
    enabled_at = None
    for k in range(300):
        rig.actuate(command(5.0))
        rig.advance(DT)
        if enabled_at is None and rig.readings().heave_enabled == 1:
            enabled_at = k * DT
            assert rig.truth().motor != 0.0
        if enabled_at is None and k * DT < 0.095:
            assert rig.truth().motor == 0.0
    assert enabled_at == pytest.approx(0.1, abs=0.003)
    assert rig.readings().heave_current == pytest.approx(5.0, rel=1e-6)
    assert rig.readings().force_trs == pytest.approx(5.0 * 76.975, rel=1e-4)


def test_missing_commands_fault_the_drive_until_enable_is_off() -> None:
    rig = world()
    for _ in range(300):
        rig.actuate(command(5.0))
        rig.advance(DT)
    silent = 0
    while rig.readings().heave_fault == 0 and silent < 1000:
        rig.advance(DT)
        silent += 1
    assert silent * DT == pytest.approx(plant().drive.watchdog.value, abs=0.005)
    for _ in range(20):
        rig.advance(DT)
    assert abs(rig.truth().motor) < 1e-3
    assert rig.readings().heave_enabled == 0
    for _ in range(300):  # commands alone do not clear the fault
        rig.actuate(command(5.0))
        rig.advance(DT)
    assert rig.readings().heave_fault == 1
    for enable in (0, 1):
        for _ in range(300):
            rig.actuate(command(5.0, heave_enable=enable))
            rig.advance(DT)
    assert rig.readings()[2:4] == (1, 0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_invalid_command_gives_no_torque(bad: float) -> None:
    rig = world()
    for current in [5.0] * 300 + [bad] * 50:
        rig.actuate(command(current))
        rig.advance(DT)
    assert rig.readings().heave_fault == 1
    assert abs(rig.truth().motor) < 1e-6


@pytest.mark.parametrize(("commanded", "limited"), [(100.0, 40.0), (-100.0, -40.0)])
def test_current_saturates(commanded: float, limited: float) -> None:
    rig = world(**QUIET)
    for _ in range(200):
        rig.actuate(command(commanded))
        rig.advance(DT)
    assert rig.readings().heave_current == pytest.approx(limited, rel=1e-6)


def test_losses() -> None:
    params = plant().build()
    assert copper_loss(params.pto, 1000.0) / 2 == pytest.approx(28.1, abs=0.05)
    assert loss(params.electrics.cots, -10.0) == pytest.approx(30.0 + 36.0 + 2.0)
    assert loss(params.electrics.cots, 0.0) == 30.0


def test_standby_power_and_the_analysers_own_clock() -> None:
    rig = world()
    ages = set()
    for _ in range(50):
        rig.actuate(command(heave_enable=0))
        rig.advance(DT)
        ages.add(round(rig.readings().analyser_age / DT))
    assert ages == {0, 1, 2, 3, 4}
    assert rig.readings().power_ac == 0.0
    assert rig.readings().power_dc == pytest.approx(30.0)
    assert rig.readings().bus_voltage == pytest.approx(150.0, abs=0.1)
