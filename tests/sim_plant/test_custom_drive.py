"""Custom drive and its bus: losses, modulation limit, gating, dump, trips, energy."""

from __future__ import annotations

import math
from typing import Any

import pytest
from plant_files import DT, QUIET, command, plant, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import custom_drive, sea_states
from sim_plant.custom_drive import DPWM, HYSTERESIS, SINE_TRIANGLE, SVPWM
from sim_plant.world import DriveSettings, World

SET = DriveSettings(SVPWM, 75.0, 1.0e-4, 0.5, 15)
PER_AMPERE = 76.9750217  # N/A


def custom_world(settings: DriveSettings = SET, name: str = "wavebot_custom", **more: Any) -> World:
    """Return a rig with these drive settings, its bus charged to the set point."""
    volts = {"drive__bus_voltage": settings.bus_voltage}
    rig = world(name=name, stepper=CompiledStepper, **QUIET, **volts, **more)
    rig.configure(settings)
    return rig


@pytest.mark.parametrize(
    ("scheme", "s", "h"),
    [(SVPWM, 1.0, 1.0), (SINE_TRIANGLE, 1.0, 1.8), (DPWM, 0.67, 6.0), (HYSTERESIS, 1.0, 4.0)],
)
@pytest.mark.parametrize("volts", [40.0, 75.0, 150.0])
def test_losses_are_the_stated_ones(scheme: int, s: float, h: float, volts: float) -> None:
    """P = 4 + 0.4 f s u + h u² + (1.5 + 0.06 f s u)|i| + 0.015 i² with u = V/75 and f in kHz."""
    settings = SET._replace(scheme=scheme, bus_voltage=75.0, switching_period=5.0e-5)
    params = plant("wavebot_custom").build(settings).electrics.inverter
    u = volts / 75.0
    kilohertz = volts / (4.0 * 0.005 * 0.5) / 1000.0 if scheme == HYSTERESIS else 20.0
    for i in (0.0, -5.0, 12.0):
        stated = 4.0 + 0.4 * kilohertz * s * u + h * u**2
        stated += (1.5 + 0.06 * kilohertz * s * u) * abs(i) + 0.015 * i**2
        assert custom_drive.loss(params, volts, i, 1) == pytest.approx(stated)
        assert custom_drive.loss(params, volts, i, 0) == 4.0


def test_40_volts_saturate_near_0_27_metres_a_second() -> None:
    """|94.27 v| + R |i| = 0.707 V with Kp -2500: 0.263 m/s; without current 0.300 m/s."""
    inverter = plant("wavebot_custom").build(SET._replace(bus_voltage=40.0)).electrics.inverter
    speeds = [0.001 * k for k in range(1, 400)]
    enough = [
        v for v in speeds if custom_drive.max_current(inverter, 40.0, v) >= 2500.0 * v / PER_AMPERE
    ]
    assert max(enough) == pytest.approx(0.2625, abs=0.001)
    assert custom_drive.max_current(inverter, 40.0, -0.31) == 0.0
    sine = plant("wavebot_custom").build(SET._replace(scheme=SINE_TRIANGLE)).electrics.inverter
    assert custom_drive.max_current(sine, 75.0, 0.0) == pytest.approx(
        0.612 * 75.0 / 0.5 * math.sqrt(1.5)
    )


def test_a_saturated_torque_is_flagged() -> None:
    """A hoist moves the hull at up to 0.35 m/s; 40 V cannot hold the current there, 150 V can."""
    for volts, limited in ((40.0, True), (150.0, False)):
        rig = custom_world(SET._replace(bus_voltage=volts))
        rig.prescribe(lambda t: (0.1 * math.sin(3.5 * t), 0.35 * math.cos(3.5 * t)))
        flagged = 0
        for _ in range(5000):
            velocity = rig.truth().velocity
            rig.actuate(command(-2500.0 / PER_AMPERE * velocity))
            rig.advance(DT)
            read, truth = rig.readings(), rig.truth()
            flagged += read.drive_saturated
            if read.drive_saturated == 1 and abs(velocity) > 0.32:
                assert abs(truth.motor) < 100.0
        assert (flagged > 300) is limited


def test_gated_off_drive_has_no_torque_and_only_logic_power() -> None:
    rig = custom_world()
    for _ in range(300):
        rig.actuate(command(5.0))
        rig.advance(DT)
    read = rig.readings()
    assert (read.drive_saturated, read.drive_dump, read.drive_conducting) == (0, 0, 1)
    assert read.power_dc > 15.0
    for _ in range(100):
        rig.actuate(command(5.0, conducting=0))
        rig.advance(DT)
    read = rig.readings()
    assert (read.heave_enabled, read.heave_fault, read.drive_conducting) == (1, 0, 0)
    assert abs(rig.truth().motor) < 1e-6
    assert read.power_dc == pytest.approx(4.0)
    for _ in range(20):
        rig.actuate(command(5.0))
        rig.advance(DT)
    assert rig.readings().heave_current == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize("enabled", [0, 1])
def test_dump_turns_off_with_supply_and_without_waves(enabled: int) -> None:
    rig = custom_world(SET._replace(bus_voltage=150.0))
    rig.configure(SET._replace(discharge_level=1))  # one resistor must bring 150 V down to 70 V
    dumping = []
    for _ in range(20000):
        rig.actuate(command(heave_enable=enabled))
        rig.advance(DT)
        dumping.append(rig.readings().drive_dump)
    assert dumping[10] == 1
    assert not any(dumping[10000:])
    assert rig.readings().heave_fault == 0
    assert 66.0 < rig.readings().bus_voltage < 70.0


def test_raised_set_point_does_not_trip() -> None:
    rig = custom_world(SET._replace(bus_voltage=40.0))
    for _ in range(500):
        rig.actuate(command())
        rig.advance(DT)
    rig.configure(SET._replace(bus_voltage=150.0))
    for _ in range(200):
        rig.actuate(command())
        rig.advance(DT)
    assert rig.readings().heave_fault == 0
    assert rig.readings().bus_voltage == pytest.approx(142.0, abs=0.5)


def test_dump_resistors_follow_the_mask() -> None:
    for level, resistors in ((1, 1), (6, 2), (15, 4), (0, 0)):
        rig = custom_world(SET._replace(bus_voltage=150.0, discharge_level=level))
        rig.configure(SET._replace(discharge_level=level))
        rig.actuate(command(heave_enable=0))
        rig.advance(DT)
        before = rig.truth().bus
        rig.advance(DT)
        dumped = rig.truth().bus.dumped - before.dumped
        assert dumped == pytest.approx(resistors * before.voltage**2 / 20.0 * DT)
        assert rig.readings().drive_dump == level


def damped(rig: World, seconds: float, trigger: int = 1) -> list[Any]:
    """Run with Kp -2500; return the true state of every tick."""
    history = [rig.truth()]
    for _ in range(round(seconds / DT)):
        rig.actuate(command(-2500.0 / PER_AMPERE * history[-1].velocity, wave_trigger=trigger))
        rig.advance(DT)
        history.append(rig.truth())
    return history


def test_bus_is_sustained_by_waves_and_trips_without_them() -> None:
    """Supply off: an energetic sea keeps the bus up; calm water ends in undervoltage, code 2."""
    rig = custom_world(name="wavebot_custom_islanded", sea=sea_states.regular(0.1, 0.4))
    history = damped(rig, 60.0)
    assert rig.readings().heave_fault == 0
    assert min(truth.bus.voltage for truth in history[10000:]) > 69.0
    assert history[-1].bus.supplied == 0.0
    assert history[-1].bus.dumped > 500.0
    at_rest = damped(rig, 60.0, trigger=0)
    read = rig.readings()
    assert (read.heave_fault, read.heave_enabled, read.drive_conducting) == (2, 0, 0)
    assert abs(at_rest[-1].motor) < 1e-9
    assert read.bus_voltage > 17.9  # the logic switches off too and stops discharging the bus
    for enable in (0, 1):
        for _ in range(200):
            rig.actuate(command(heave_enable=enable))
            rig.advance(DT)
    assert rig.readings().heave_fault == 2  # the bus is still low


def test_without_dump_resistors_it_trips_on_overvoltage() -> None:
    settings = SET._replace(bus_voltage=180.0, discharge_level=0)
    rig = custom_world(settings, name="wavebot_custom_islanded", sea=sea_states.regular(0.127, 0.4))
    history = damped(rig, 60.0)
    read = rig.readings()
    assert (read.heave_fault, read.heave_enabled) == (3, 0)
    assert max(truth.bus.voltage for truth in history) == pytest.approx(200.0, abs=0.1)
    assert abs(history[-1].motor) < 1e-9


@pytest.mark.parametrize("name", ["wavebot_custom", "wavebot_custom_islanded"])
def test_the_bus_loses_no_energy(name: str) -> None:
    """Stored = supplied - consumed - dumped, and consumed is exactly the analyser's DC power."""
    rig = custom_world(name=name, sea=sea_states.regular(0.127, 0.4), drive__analyser_window=DT)
    start = rig.truth().bus
    consumed = 0.0
    for k in range(30000):
        rig.actuate(command(-30.0 * rig.truth().velocity, wave_trigger=1, conducting=k % 3000 > 99))
        rig.advance(DT)
        consumed += DT * rig._delay_line[-1].power_dc
    end = rig.truth().bus
    turnover = abs(end.consumed) + end.supplied + end.dumped
    gained = end.supplied - end.consumed - end.dumped
    assert end.energy - start.energy == pytest.approx(gained, abs=1e-12 * turnover)
    assert end.energy == pytest.approx(0.05 * end.voltage**2)
    assert end.consumed == pytest.approx(consumed, abs=1e-12 * turnover)
    assert end.dumped > 100.0


def test_settings_out_of_range_are_refused_by_name() -> None:
    rig = custom_world()
    with pytest.raises(ValueError, match=r"scheme 4 .* 0 to 3; bus_voltage 1\.0 .* 30 to 180"):
        rig.configure(DriveSettings(4, 1.0, 1.0e-4, 0.5, 15))
    for bad in ({"switching_period": 0.0}, {"hysteresis_tolerance": math.nan}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            rig.configure(SET._replace(**bad))
    with pytest.raises(ValueError, match="discharge_level 16"):
        rig.configure(SET._replace(discharge_level=16))


def test_the_commercial_drive_has_no_settings() -> None:
    rig = world(**QUIET)
    before = rig.params
    for settings in (DriveSettings(HYSTERESIS, 40.0, 1.0e-3, 1.0, 0), DriveSettings(*[0] * 5)):
        rig.configure(settings)
    assert rig.params == before
    for _ in range(300):
        rig.actuate(command(5.0, conducting=0))
        rig.advance(DT)
    assert rig.readings().heave_current == pytest.approx(
        5.0, rel=1e-6
    )  # the commercial drive has no gate input
    assert rig.readings().drive_conducting == 1
