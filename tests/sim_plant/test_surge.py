"""The surge axis in time: closed form, drive, energy, and its effect on heave.

Most tests run the compiled plant; its results are bitwise equal (tests/rehearsal/
test_compiled_plant).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from plant_files import DT, QUIET, command, plant, surge_bem, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states
from sim_plant.bem import radiation_impedance
from sim_plant.world import Truth, World

PER_AMPERE = 76.9750217  # N/A
WAVE = sea_states.regular(0.127, 0.5)


def impedance(f_hz: float) -> complex:
    """Surge impedance from the plant file's own five states, N s/m, e^{+i omega t}."""
    hull = plant().build().surge.body
    s = 2j * math.pi * f_hz
    memory = np.polyval([hull.b4, hull.b3, hull.b2, hull.b1, 0.0], s) / np.polyval(
        [1.0, hull.a4, hull.a3, hull.a2, hull.a1, hull.a0], s
    )
    return complex(s * hull.inertia + memory + hull.viscous + hull.hydrostatic / s)


@pytest.mark.parametrize("frequency", [0.25, 0.4, 0.5, 0.8])
def test_motor_driven_surge_matches_the_closed_form(frequency: float) -> None:
    """Sinusoidal current in calm water: complex v/F within 0.1 % of 1/Z, as in heave."""
    rig = world(stepper=CompiledStepper, **QUIET)
    periods = 4 / frequency
    begin, end = round(40.0 / DT), round((40.0 + periods) / DT)
    velocity, force = [], []
    for k in range(end):
        current = 6.0 * math.sin(2 * math.pi * frequency * k * DT)
        rig.actuate(command(heave_enable=0, surge_current=current, surge_enable=1))
        rig.advance(DT)
        if k >= begin:
            state = rig._stepper.state.surge
            velocity.append(state.body.velocity)
            force.append(PER_AMPERE * state.drive.current)
    turn = np.exp(-2j * np.pi * frequency * DT * np.arange(end - begin))
    measured = np.dot(velocity, turn) / np.dot(force, turn)
    assert abs(measured * impedance(frequency) - 1) <= 1e-3


def test_surge_resonates_at_half_a_hertz() -> None:
    """1420 kg on 18.2 kN/m, with the BEM's added mass and with the five states of the plant."""
    f = np.linspace(0.4, 0.6, 2001)
    own_reactance = np.array([impedance(x).imag for x in f])
    assert f[np.argmin(np.abs(own_reactance))] == pytest.approx(0.50, abs=0.005)
    hull, file = surge_bem(), plant().surge
    table = np.interp(f, hull.frequency, radiation_impedance(hull).imag)
    omega = 2 * np.pi * f
    mass = file.mass.value + hull.added_mass_infinite
    reactance = omega * mass + table - file.stiffness.value / omega
    assert f[np.argmin(np.abs(reactance))] == pytest.approx(0.50, abs=0.005)
    # WEC-Sim's 24 kN/m would resonate elsewhere
    stiff = omega * mass + table - 24000.0 / omega
    assert abs(f[np.argmin(np.abs(stiff))] - 0.50) > 0.05


def test_wave_driven_surge_matches_the_closed_form() -> None:
    """Regular waves, drives off: surge amplitude |Fe| a / |Z| omega within 0.2 %."""
    rig = world(sea_states.regular(0.05, 0.4), stepper=CompiledStepper, **QUIET)
    positions = []
    for k in range(65000):
        rig.actuate(command(heave_enable=0, wave_trigger=1))
        rig.advance(DT)
        if k >= 60000:
            positions.append(rig._stepper.state.surge.body.position)
    force = abs(np.interp(0.4, surge_bem().frequency, np.abs(surge_bem().excitation)))
    expected = force * 0.05 / abs(impedance(0.4)) / (2 * math.pi * 0.4)
    assert max(positions) == pytest.approx(expected, rel=2e-3)
    scale = 20000 * 12.4666 / (2 * math.pi)
    counts = rig.readings().surge_counts - plant().sensors.surge_encoder_offset.value
    assert counts / scale == pytest.approx(positions[-2], abs=1.0 / scale)


def test_the_surge_drive_has_its_own_enable_and_watchdog() -> None:
    rig = world(**QUIET)
    for _ in range(300):
        rig.actuate(command(heave_enable=0, surge_current=50.0, surge_enable=1))
        rig.advance(DT)
    read = rig.readings()
    assert (read.heave_enabled, read.surge_enabled, read.surge_fault) == (0, 1, 0)
    assert read.surge_current == pytest.approx(40.0, rel=1e-6)
    assert rig.truth().motor == 0.0
    for _ in range(250):
        rig.advance(DT)  # silence
    read = rig.readings()
    assert (read.surge_enabled, read.surge_fault, read.heave_fault) == (0, 1, 0)
    assert abs(read.surge_current) < 1e-6


def test_energy_balance() -> None:
    """Work of all surge forces = change of kinetic and stored energy, to 1e-5 of the turnover."""
    rig = world(WAVE, stepper=CompiledStepper)
    hull = rig.params.surge.body
    work, turned = 0.0, 0.0
    before = rig.truth()

    def forces(truth: Truth) -> tuple[float, ...]:
        b = truth.surge.body
        memory = hull.b1 * b.z2 + hull.b2 * b.z3 + hull.b3 * b.z4 + hull.b4 * b.z5
        drag = hull.viscous * b.velocity
        return truth.surge_excitation, PER_AMPERE * truth.surge.drive.current, -memory, -drag

    for _ in range(20000):
        current = -2500.0 / PER_AMPERE * before.surge.body.velocity
        rig.actuate(command(surge_current=current, surge_enable=1, wave_trigger=1))
        rig.advance(DT)
        after = rig.truth()
        moved = after.surge.body.position - before.surge.body.position
        pairs = zip(forces(before), forces(after), strict=True)
        done = [0.5 * (a + b) * moved for a, b in pairs]
        work += sum(done)
        turned += sum(map(abs, done))
        before = after
    b = before.surge.body
    gained = 0.5 * hull.inertia * b.velocity**2 + 0.5 * hull.hydrostatic * b.position**2
    assert abs(work - gained) <= 1e-5 * turned


def test_guide_force_accelerates_the_hull() -> None:
    """Motor + mooring - carriage inertia is also hull inertia - water forces."""
    rig = world(WAVE, stepper=CompiledStepper, **QUIET)
    params = rig.params.surge
    hull = params.body
    for _ in range(8000):
        rig.actuate(command(wave_trigger=1))
        rig.advance(DT)
    truth = rig.truth()
    b = truth.surge.body
    memory = hull.b1 * b.z2 + hull.b2 * b.z3 + hull.b3 * b.z4 + hull.b4 * b.z5
    water = truth.surge_excitation - memory - hull.viscous * b.velocity
    acceleration = (water - hull.hydrostatic * b.position) / hull.inertia
    needed = (hull.inertia - params.carriage_mass) * acceleration - water
    assert truth.surge.guide_force == pytest.approx(needed, abs=1e-9 * abs(water) + 1e-6)
    assert abs(needed) > 100.0


def run(rig: World, surge_kp: float, ticks: int) -> list[Truth]:
    """Run with heave Kp -2000 and a surge gain (0: drive off); return the truth of every tick."""
    history = [rig.truth()]
    for _ in range(ticks):
        last = history[-1]
        rig.actuate(
            command(
                -2000.0 / PER_AMPERE * last.velocity,
                wave_trigger=1,
                surge_current=surge_kp / PER_AMPERE * last.surge.body.velocity,
                surge_enable=1 if surge_kp else 0,
            )
        )
        rig.advance(DT)
        history.append(rig.truth())
    return history


def heave(history: list[Truth]) -> list[Any]:
    return [(t.position, t.velocity, t.motor, t.friction) for t in history]


def test_surge_reaches_heave_by_guide_friction_alone() -> None:
    """Without guide friction heave is the same to the bit, whatever surge does; with it, not."""
    for guide, same in ((0.0, True), (0.02, False)):
        one, other = (
            run(world(WAVE, stepper=CompiledStepper, pto__guide_friction=guide), kp, 6000)
            for kp in (0.0, -2500.0)
        )
        assert (heave(one) == heave(other)) is same


def test_surge_damping_increases_heave_power() -> None:
    """At surge resonance, damping surge reduces lateral force, thus dry friction and lost power.

    The power lost to friction is 0.02 |F_lateral| |tanh| |v| more than without a guide, as logged.
    """
    taken, gained, force = {}, {}, {}
    for kp in (0.0, -2500.0):
        history = run(world(WAVE, stepper=CompiledStepper), kp, 40000)[20000:]
        dry = [t.velocity * math.tanh(t.velocity / 0.002) for t in history]
        pairs = zip(history, dry, strict=True)
        taken[kp] = -np.mean([0.02 * abs(t.surge.guide_force) * d for t, d in pairs])
        gained[kp] = np.mean([t.motor * t.velocity for t in history])
        force[kp] = max(abs(t.surge.guide_force) for t in history)
        total = np.mean([t.friction * t.velocity for t in history])
        plain = -np.mean([400.0 * t.velocity**2 for t in history]) - 50.0 * np.mean(dry)
        assert total - plain == pytest.approx(taken[kp], rel=1e-6)
    assert force[-2500.0] < 0.7 * force[0.0]
    assert gained[-2500.0] < gained[0.0] - 1.0  # W; absorbed is negative
