"""Basin probes: incident wave, radiated wave against closed form, energy and BEM; empty basin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plant_files import CAPYTAINE, DT, QUIET, bem, command, plant, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states
from sim_plant.basin import Basin, Probe, radiated_wave, radiation_filter
from sim_plant.bem import excitation_at
from sim_plant.sensors import Channel
from sim_plant.world import Readings

PLACES = [(-4.0, 0.0), (0.0, 5.0), (3.0, -3.5)]
G, RHO = 9.81, 1000.0


def probes(reading: Readings) -> tuple[float, float, float]:
    return reading.probe_1, reading.probe_2, reading.probe_3


def test_empty_basin_is_the_undisturbed_wave_at_each_place() -> None:
    """a cos(k x - omega t) with k = omega²/g, sampled every 20 ms and held."""
    rig = world(sea_states.regular(0.1, 0.5), device=False, **QUIET)
    omega = math.pi
    k = omega**2 / G
    for tick in range(9000):
        rig.actuate(command(wave_trigger=1))
        rig.advance(DT)
        reading = rig.readings()
        if tick < 6000 or tick % 7:
            continue
        # readings are those of the previous tick; the sample is probe_age older
        sampled = tick * DT - reading.probe_age
        assert sampled / 0.02 == pytest.approx(round(sampled / 0.02), abs=1e-6)
        for (x, _), measured in zip(PLACES, probes(reading), strict=True):
            assert measured == pytest.approx(0.1 * math.cos(k * x - omega * sampled), abs=1e-9)


def test_an_irregular_sea_arrives_component_by_component() -> None:
    sea = sea_states.jonswap(0.127, 2.0, 3.3, 60.0, seed=5)
    elevations = sea_states.elevation_at(sea, -4.0, DT)[::977]
    t = DT * np.arange(0, 60000, 977)
    expected = np.zeros(t.size)
    for f, a in zip(sea_states.frequencies(sea), sea.amplitude, strict=True):
        omega = 2 * np.pi * f
        expected += (a * np.exp(1j * (omega**2 / G * -4.0 - omega * t))).real
    np.testing.assert_allclose(elevations, expected, atol=1e-12)


def test_probe_at_the_device_reads_the_undisturbed_elevation() -> None:
    place = {"basin__probe_2__x": 0.0, "basin__probe_2__y": 0.0}
    sea = sea_states.jonswap(0.127, 2.0, 3.3, 20.0, seed=5)
    rig = world(sea, device=False, sensors__delay_ticks=0, **place, **QUIET)
    last_elevation = 0.0
    for tick in range(1, 12000):
        rig.actuate(command(wave_trigger=1))
        rig.advance(DT)
        reading = rig.readings()
        assert reading.probe_2 == last_elevation  # the sample of tick k is on the wire at k + 1
        if tick % 20 == 0:
            last_elevation = reading.elevation
    with pytest.raises(ValueError, match=r"3\.0 m or more"):
        world(sea, **place)


def test_other_readings_are_constant_in_the_empty_basin() -> None:
    rig = world(sea_states.regular(0.127, 0.5), device=False)
    rows = []
    for k in range(3000):
        rig.actuate(command(10.0, wave_trigger=1, stator_target=40.0, stator_enable=1))
        rig.advance(DT)
        if k > 1:
            rows.append(rig.readings())
    fixed = [f for f in Readings._fields if len({getattr(r, f) for r in rows}) == 1]
    moving = {"elevation", "probe_1", "probe_2", "probe_3", "probe_age"}
    assert set(Readings._fields) - set(fixed) == moving
    reading = rows[0]
    assert (reading.heave_enabled, reading.heave_fault, reading.surge_fault) == (0, 0, 0)
    assert (reading.stator_arrived, reading.stator_position, reading.power_ac) == (1, -13.0, 0.0)
    assert reading.heave_counts == plant().sensors.encoder_offset.value
    assert (reading.power_dc, reading.bus_voltage) == (30.0, pytest.approx(150.0, abs=0.1))
    assert all(math.isfinite(number) for row in rows[::100] for number in row)


def test_sampled_at_50_hz_and_held_with_its_age() -> None:
    rig = world(sea_states.regular(0.1, 0.5), **QUIET)
    samples, ages = set(), set()
    for _ in range(1000):
        rig.actuate(command(wave_trigger=1))
        rig.advance(DT)
        reading = rig.readings()
        samples.add(probes(reading))
        ages.add(round(reading.probe_age / DT))
    assert len(samples) in (50, 51)
    assert ages <= set(range(21))
    assert set(range(1, 21)) <= ages


@pytest.mark.parametrize("dt", [0.0007, 0.003, 0.005])
def test_50_hz_at_any_tick(dt: float) -> None:
    sea = sea_states.recorded(np.sin(np.linspace(0, 2 * np.pi, 100)), 100 / (3000 * dt))
    rig = world(sea, device=False, dt=dt, **QUIET)
    measured = 0
    last = None
    for _ in range(round(3.0 / dt)):
        rig.actuate(command(wave_trigger=1))
        rig.advance(dt)
        now = probes(rig.readings())
        measured += now != last
        last = now
    assert measured == pytest.approx(150, abs=2)


def test_noise_and_resolution_match_the_file() -> None:
    rig = world(device=False)
    rows = []
    for _ in range(40000):
        rig.advance(DT)
        if rig._tick % 20 == 5:
            rows.append(probes(rig.readings()))
    table = np.array(rows)
    np.testing.assert_allclose(table.std(axis=0), 0.0005, rtol=0.06)
    np.testing.assert_allclose(table.mean(axis=0), 0.0, atol=5e-5)
    assert np.all(np.abs(np.corrcoef(table.T)[np.triu_indices(3, 1)]) < 0.08)
    np.testing.assert_allclose(table / 0.0001, np.round(table / 0.0001), atol=1e-6)


def closed_form(frequency: float, radius: float) -> complex:
    """Return the far-field elevation per velocity, e^{-i omega t}, derived from energy flux."""
    omega = 2 * math.pi * frequency
    damping = float(np.interp(frequency, bem().frequency, bem().damping))
    group = G / (2 * omega)
    size = math.sqrt(damping / (2 * math.pi * radius * RHO * G * group))
    lead = float(np.angle(excitation_at(bem(), np.array([frequency]))[0]))
    turns = omega**2 / G * radius
    return size * np.exp(1j * (turns - 1 / (8 * turns + 4 / math.pi) + lead + 0.75 * math.pi))


def heaving(frequency: float, seconds: float) -> tuple[list[complex], float]:
    """A hoist heaves the hull in calm water: complex probe amplitudes per velocity amplitude."""
    omega, stroke = 2 * math.pi * frequency, 0.05
    rig = world(stepper=CompiledStepper, **QUIET)
    rig.prescribe(lambda t: (stroke * math.sin(omega * t), stroke * omega * math.cos(omega * t)))
    periods = math.floor(seconds / 2 * frequency)
    window = round(periods / frequency / DT)
    turned = np.zeros(3, dtype=complex)
    velocity = 0.0j
    for tick in range(round(seconds / DT) + window):
        rig.actuate(command(heave_enable=0))
        rig.advance(DT)
        if tick >= round(seconds / DT):
            reading = rig._delay_line[-1]
            sampled = (tick + 1) * DT - reading.probe_age
            turned += np.array(probes(reading)) * np.exp(1j * omega * sampled)
            velocity += rig.motion()[1] * np.exp(1j * omega * (tick + 1) * DT)
    return list(turned / velocity), abs(velocity) * 2 / window


@pytest.mark.parametrize("frequency", [0.25, 0.4, 0.5, 0.65, 0.8, 1.0])
def test_the_radiated_wave_is_the_closed_form(frequency: float) -> None:
    """Magnitude and phase at all three probes within 2 %: 1 % by filter, 1 % by sampling."""
    measured, velocity = heaving(frequency, 40.0)
    assert velocity == pytest.approx(0.05 * 2 * math.pi * frequency, rel=1e-3)
    for (x, y), ratio in zip(PLACES, measured, strict=True):
        reference = closed_form(frequency, math.hypot(x, y))
        # a sample is held up to 20 ms: its age is compensated above
        assert abs(ratio / reference - 1.0) <= 0.02


@pytest.mark.parametrize("frequency", [0.4, 0.65, 1.0])
def test_the_radiated_wave_carries_the_damping_power(frequency: float) -> None:
    """2 pi r (1/2 rho g |a|²) c_g = 1/2 B |v|² within 4 % (twice that of the amplitude)."""
    measured, _ = heaving(frequency, 40.0)
    group = G / (4 * math.pi * frequency)
    damping = float(np.interp(frequency, bem().frequency, bem().damping))
    for (x, y), ratio in zip(PLACES, measured, strict=True):
        flux = 2 * math.pi * math.hypot(x, y) * 0.5 * RHO * G * abs(ratio) ** 2 * group
        assert flux == pytest.approx(0.5 * damping, rel=0.04)


def test_the_far_field_is_that_of_the_bem() -> None:
    """capytaine's free surface around the heaving hull, 2-8 m, complex.

    5 % where the probe is some waves away (beyond k r of 8 capytaine's tabulated Green function
    itself varies by 10 %), 20 % in the near field of the hull.
    """
    with np.load(CAPYTAINE) as file:
        frequency, radius = file["radiated_f_hz"], file["radius"]
        table = file["elevation_per_velocity"]
    for j, r in enumerate(radius):
        wrong = np.abs(radiated_wave(bem(), float(r), frequency) / table[:, j] - 1.0)
        waves_away = (2 * np.pi * frequency) ** 2 / G * r
        assert wrong[(waves_away > 1.9) & (waves_away < 8.0)].max() <= 0.05
        assert wrong[waves_away <= 1.9].max(initial=0.0) <= 0.20


def test_filter_has_no_response_outside_the_band_of_motion() -> None:
    for radius in (3.0, 4.0, 8.0):
        gains = radiation_filter(bem(), radius)
        f = np.linspace(0.0, 5.0, 501)
        response = np.abs(np.exp(-2j * np.pi * 0.1 * np.outer(f, np.arange(gains.size))) @ gains)
        most = np.abs(radiated_wave(bem(), radius, f)).max()
        assert response[f > 1.5].max() <= 0.7 * most


def test_filter_is_causal_and_of_finite_length() -> None:
    """The response to a velocity pulse starts after it, is largest seconds later, and ends."""
    basin = Basin(
        sea_states.calm(), bem(), [Probe(8.0, 0.0)], Channel(0.0, 0.0, 0.0, 1, 0), [0.0] * 131072,
        dt=DT, device=True,
    )  # fmt: skip
    measured = np.array([basin.sample(-1, 1.0, 1.0 if k == 100 else 0.0)[0] for k in range(2000)])
    assert not measured[:100].any()
    assert not measured[1300:].any()
    assert np.sum(measured[100:150] ** 2) < 0.01 * np.sum(measured**2)
