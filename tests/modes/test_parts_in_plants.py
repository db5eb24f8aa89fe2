"""Parts in a moving plant: mooring, play, oil and the DC bus, by closed forms and balances."""

from __future__ import annotations

import math
from typing import Any

import mode_plants
import numpy as np
import pytest
from mode_plants import AXIS, BUS, DRIVE, DT, HEAVE, OIL, PITCH, SURGE, mapping, world
from test_modes_plant import closed_form, motion_in_waves, off

from sim_plant import sea_states
from sim_plant.modes import plant as step
from sim_plant.modes.building import PlantModel
from sim_plant.modes.world import Actuation, World
from sim_plant.parts import hydraulic


def heaving(axis: dict[str, Any], **values: Any) -> PlantModel:
    """Return a plant with one PTO on the heave of the cylinder, without delay."""
    whole = {"moves_with": {"heave": 1.0}, **axis}
    return mode_plants.model(mapping({"heave": HEAVE}, {"pto": whole}, delay_s=0.0, **values))


def signal(simulated: World, name: str) -> float:
    """Return the true value of a signal of the plant."""
    conditions = simulated.conditions()
    kind, index = simulated.model.plant.signals()[name]
    elevation = simulated.truth().elevation
    return step.signal(conditions.params, conditions.state, kind, index, elevation)


def test_taut_lines_are_their_stiffness_in_small_waves() -> None:
    """Three lines on surge, heave and pitch; at 5 cm, changes of direction cost up to 1 %."""
    modes = {
        "surge": {**SURGE, "stiffness": 0.0, "linear_damping": 900.0},
        "heave": {**HEAVE, "linear_damping": 900.0},
        "pitch": {**PITCH, "linear_damping": 300.0},
    }
    lines = {
        f"line_{k}": {
            "anchor_m": [6.0 * math.cos(angle), 6.0 * math.sin(angle), -7.0],
            "fairlead_m": [0.8 * math.cos(angle), 0.8 * math.sin(angle), -1.0],
            "pretension_n": 3000.0,
            "stiffness_n_per_m": 6000.0,
            "moves_with": {
                "surge": [1, 0, 0],
                "heave": [0, 0, 1],
                "pitch": [-1.0, 0, -0.8 * math.cos(angle)],
            },
        }
        for k, angle in enumerate((0.0, 2.0943951, 4.1887902))
    }
    axis = {"pto": {"moves_with": {"heave": 1.0}, "viscous_friction": 500.0}}
    model = mode_plants.model(mapping(modes, axis, mooring={"lines": lines}, delay_s=0.0))
    for frequency in (0.2, 0.4):
        position, power, _ = motion_in_waves(model, frequency, off, settle=160.0, dt=2.0 * DT)
        expected, expected_power = closed_form(model, frequency)
        assert np.abs(position - expected).max() < 0.01 * np.abs(expected).max()
        assert power == pytest.approx(expected_power, rel=0.01)


def test_linear_mooring_is_symmetric_and_adds_to_the_hydrostatics() -> None:
    mooring = {"stiffness": {"surge": {"surge": 500.0, "pitch": -800.0}}}
    modes = {"surge": SURGE, "pitch": PITCH}
    plain = mode_plants.model(mapping(modes)).params.stiffness
    moored = mode_plants.model(mapping(modes, mooring=mooring)).params.stiffness
    np.testing.assert_allclose(np.subtract(moored, plain), [500.0, -800.0, -800.0, 0.0])


def test_a_motor_without_play_is_its_reflected_inertia() -> None:
    """Teeth of 1e6 N/m and no gap: the twist of 200 kg at 0.4 Hz is 1.3e-3 of the motion."""
    rigid = {"viscous_friction": 2500.0, "inertia": 200.0}
    teeth = {"half_gap": 1.0e-9, "stiffness": 1.0e6, "damping": 3000.0}
    motions = []
    for axis in (rigid, {**rigid, "backlash": teeth}):
        position, power, _ = motion_in_waves(heaving(axis), 0.4, off, settle=60.0)
        motions.append((abs(position[0]), power))
    assert motions[1] == pytest.approx(motions[0], rel=5e-3)


def test_an_encoder_at_the_motor_does_not_see_the_play() -> None:
    """A slow motor pushes the floating body one way and back: it is ahead by half the gap."""
    teeth = {"half_gap": 0.004, "stiffness": 5.0e6, "damping": 5000.0}
    model = heaving({"inertia": 50.0, "viscous_friction": 4000.0, "backlash": teeth})
    simulated, ahead = world(model, sea_states.calm()), []
    for tick in range(40_000):
        current = 60.0 * math.sin(2.0 * math.pi * tick * DT / 20.0)
        simulated.actuate(Actuation((current, 1.0), 0))
        simulated.advance(DT)
        if tick in (24_999, 34_999):  # the force is greatest
            twist = signal(simulated, "pto.motor_position") - signal(simulated, "pto.position")
            force = signal(simulated, "pto.force")
            ahead.append(twist - force / 5.0e6)
            counts = simulated.readings()[0] / (12.0 / (2.0 * math.pi) * 1_048_576)
            assert counts == pytest.approx(signal(simulated, "pto.motor_position"), abs=1e-5)
    assert ahead == pytest.approx([0.004, -0.004], abs=1e-5)


def oil_axis(**changes: float) -> dict[str, Any]:
    return {"gear_ratio": 250.0, "hydraulic": {**OIL, **changes}}


def test_a_hydraulic_pto_with_a_large_accumulator_is_coulomb_damping() -> None:
    """F = -A (p - p_low) sign(v): the mean power is that force times the mean of |v|."""
    model = heaving(oil_axis(volume_m3=100.0, viscous_n_m_s_per_rad=0.0, leakage_m3_per_s_pa=0.0))
    simulated = world(model, sea_states.regular(0.4, 0.4))
    work = path = 0.0
    for tick in range(30_000):
        simulated.actuate(Actuation((0.0, 0.0), 1))
        simulated.advance(DT)
        if tick >= 20_000:
            speed = simulated.truth().velocity[0]
            work += simulated.truth().shaft_force[0] * speed * DT
            path += abs(speed) * DT
    assert path > 0.3
    # Between -v_c and v_c the valves change over, a share of v_c / v of the path.
    assert work / path == pytest.approx(-0.0005 * (2.5e6 - 5.0e5), rel=0.06)


def test_the_energy_of_a_hydraulic_pto_is_accounted_for() -> None:
    """Work on the cylinder = gas + motor + generator + leakage + viscous loss."""
    model = heaving(oil_axis())
    simulated = world(model, sea_states.regular(0.15, 0.4))
    conditions = simulated.conditions()
    oil = step.hydraulic_params(model.params.axis, 0)
    pto = 2 * model.params.modes + model.params.states

    def numbers() -> tuple[float, float]:
        state = simulated.conditions().state
        return state[pto], state[pto + 1]

    def gas(volume: float) -> float:
        """Return what the gas gives up against the low pressure until it fills its volume."""
        ratio = oil.volume / volume
        work = oil.precharge * oil.volume * (ratio**0.4 - 1.0) / 0.4
        return float(work - oil.low_pressure * (oil.volume - volume))

    start = gas(conditions.state[pto])
    cylinder = generator = losses = 0.0
    volume, speed = numbers()
    velocity = simulated.truth().velocity[0]
    for _ in range(12_000):
        simulated.actuate(Actuation((1.5, 1.0), 1))
        simulated.advance(DT)
        (new_volume, new_speed), new_velocity = numbers(), simulated.truth().velocity[0]
        middle, turning = 0.5 * (volume + new_volume), 0.5 * (speed + new_speed)
        difference = hydraulic.pressure(oil, middle) - oil.low_pressure
        cylinder -= simulated.truth().shaft_force[0] * 0.5 * (velocity + new_velocity) * DT
        generator -= simulated.truth().electric_power[0] * DT
        losses += (oil.viscous * turning**2 + oil.leakage * difference**2) * DT
        volume, speed, velocity = new_volume, new_speed, new_velocity
    stored = gas(volume) - start + 0.5 * oil.inertia * speed**2
    assert generator > 100.0
    assert volume < oil.volume
    assert cylinder == pytest.approx(stored + generator + losses, rel=2e-3)


def test_a_bus_stores_dumps_and_trips() -> None:
    drive = {**DRIVE, "resistance_ohm": 0.2, "standby_w": 2.0}
    model = heaving({"drive": drive}, bus={**BUS, "supply_v": None})
    simulated = world(model, sea_states.regular(0.1, 0.4))
    first = 0.5 * 0.02 * 60.0**2
    consumed = dumped = 0.0
    for _ in range(20_000):
        current = -1500.0 / 18.0 * simulated.truth().velocity[0]
        simulated.actuate(Actuation((current, 1.0), 1))
        simulated.advance(DT)
        consumed += simulated.truth().electric_power[0] * DT
        dumped += signal(simulated, "bus.dump_power") * DT
    energy = 0.5 * 0.02 * signal(simulated, "bus.voltage") ** 2
    assert dumped > 50.0
    assert energy - first == pytest.approx(-consumed - dumped, rel=1e-6, abs=1e-6)
    for _ in range(20_000):  # the waves stop, the drive's own power empties the capacitor
        simulated.actuate(Actuation((0.0, 1.0), 0))
        simulated.advance(DT)
    assert simulated.readings()[3] == 2.0  # undervoltage
    assert signal(simulated, "bus.voltage") < BUS["undervoltage_v"]


def test_back_emf_limits_the_current() -> None:
    drive = {**DRIVE, "resistance_ohm": 0.5, "back_emf_v_s_per_rad": 1.5, "modulation": 0.6}
    bus = {**BUS, "capacitance_f": 100.0, "supply_resistance_ohm": 0.01}
    simulated = world(heaving({"drive": drive}, bus=bus), sea_states.calm())
    simulated.release([0.0], [1.0])
    for _ in range(101):
        simulated.actuate(Actuation((1000.0, 1.0), 0))
        before = simulated.truth().velocity[0]
        simulated.advance(DT)
    assert abs(before) > 0.3
    most = (0.6 * 60.0 - 1.5 * 12.0 * abs(before)) / 0.5
    assert AXIS["gear_ratio"] == 12.0
    for _ in range(5):  # five time constants of the current loop
        simulated.actuate(Actuation((1000.0, 1.0), 0))
        simulated.advance(DT)
    assert 0.0 < signal(simulated, "pto.current") <= 1.1 * most
