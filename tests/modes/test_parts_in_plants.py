"""Parts in a moving plant: mooring, play, oil and the DC bus, by closed forms and balances."""

from __future__ import annotations

import math
from typing import Any

import mode_plants
import numpy as np
import pytest
from mode_plants import BUS, DRIVE, DT, HEAVE, OIL, PITCH, SURGE, mapping, world
from test_modes_plant import closed_form, motion_in_waves, off

from sim_plant import sea_states
from sim_plant.modes import plant as step
from sim_plant.modes import readings
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
    return readings.signal(conditions.params, conditions.state, kind, index, elevation)


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
    drive = {**DRIVE, "current_limit_a": 4.0}
    return {"gear_ratio": 250.0, "hydraulic": {**OIL, **changes}, "drive": drive}


def test_a_hydraulic_pto_with_a_large_accumulator_is_coulomb_damping() -> None:
    """F = -A (p - p_low) tanh(v / v_c): the power is that force times the velocity."""
    model = heaving(oil_axis(volume_m3=100.0, viscous_n_m_s_per_rad=0.0, leakage_m3_per_s_pa=0.0))
    simulated = world(model, sea_states.regular(0.4, 0.4))
    work = path = 0.0
    for tick in range(30_000):  # the brake holds the motor, or it would empty the accumulator
        simulated.actuate(Actuation((4.0, 1.0), 1))
        before = simulated.truth().velocity[0]
        simulated.advance(DT)
        if tick >= 20_000:
            speed = 0.5 * (before + simulated.truth().velocity[0])
            work += simulated.truth().shaft_force[0] * speed * DT
            path += speed * math.tanh(speed / 0.02) * DT
    assert path > 0.3
    assert work / path == pytest.approx(-0.0005 * (2.5e6 - 5.0e5), rel=2e-3)


def test_the_energy_of_a_hydraulic_pto_is_accounted_for() -> None:
    """Work on the cylinder = gas + motor + generator + leakage + viscous loss."""
    model = heaving(oil_axis())
    simulated = world(model, sea_states.regular(0.15, 0.4))
    conditions = simulated.conditions()
    oil = step.hydraulic_params(model.params.axis, 0)
    pto = step.pto_place(model.params, 0, 0)

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


def test_a_brake_beyond_the_torque_of_the_oil_makes_no_energy() -> None:
    """The oil gives 4 N m at the most, the brake could take 6: the shaft creeps at its balance."""
    model = heaving(oil_axis(volume_m3=100.0, leakage_m3_per_s_pa=0.0))
    simulated = world(model, sea_states.calm())
    electric = turned = speed = 0.0
    for _ in range(5000):
        simulated.actuate(Actuation((4.0, 1.0), 0))
        simulated.advance(DT)
        electric -= simulated.truth().electric_power[0] * DT
        turned += 0.5 * (speed + signal(simulated, "pto.motor_velocity")) * DT
        speed = signal(simulated, "pto.motor_velocity")
    torque = 2.0e-6 * (2.5e6 - 5.0e5)
    brake = 1.5 * 4.0 * math.tanh(speed / hydraulic.STANDSTILL)
    assert brake + 0.001 * speed == pytest.approx(torque, rel=1e-3)
    # What the oil gave is in the generator, in the viscous loss and in the motion.
    assert 0.9 * torque * turned < electric < torque * turned


def test_an_end_stop_returns_no_more_energy_than_it_took() -> None:
    """A stop at the limit of the tick returns at most 2 % too much; a stiffer one is refused."""
    for stiffness, accepted in ((2.0e7, True), (1.0e9, False)):
        stop = {"position": 0.02, "stiffness": stiffness}
        given = mapping({"heave": {**HEAVE, "end_stop": stop}}, delay_s=0.0)
        if not accepted:
            with pytest.raises(ValueError, match="needs a tick of at most"):
                world(mode_plants.model(given), sea_states.calm())
            continue
        simulated = world(mode_plants.model(given), sea_states.calm())
        simulated.release([0.0199], [0.5])
        speeds = []
        for _ in range(120):
            simulated.actuate(Actuation((0.0, 0.0), 0))
            simulated.advance(DT)
            speeds.append(simulated.truth().velocity[0])
        assert 0.45 < -min(speeds) <= 0.5 * 1.01


def test_a_drive_without_voltage_draws_nothing() -> None:
    bus = {**BUS, "capacitance_f": 0.002, "supply_v": None}
    model = heaving({"drive": {**DRIVE, "standby_w": 20.0}}, bus=bus)
    simulated = world(model, sea_states.calm())
    for _ in range(2000):
        simulated.actuate(Actuation((0.0, 0.0), 0))
        simulated.advance(DT)
    assert simulated.truth().electric_power[0] == 0.0
    assert signal(simulated, "bus.voltage") == pytest.approx(BUS["brownout_v"], rel=0.02)


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


@pytest.mark.parametrize(("current", "sign"), [(1000.0, -1.0), (-1000.0, 1.0)])
def test_back_emf_limits_the_current(current: float, sign: float) -> None:
    """(m V -+ k w) / R: less for a motor, more for a generator."""
    drive = {**DRIVE, "resistance_ohm": 0.5, "back_emf_v_s_per_rad": 1.5, "modulation": 0.6,
             "current_bandwidth_hz": 2000.0}  # fmt: skip
    bus = {**BUS, "capacitance_f": 100.0, "supply_v": None}
    simulated = world(heaving({"drive": drive}, bus=bus), sea_states.calm())
    for tick in range(220):
        if tick == 200:
            simulated.release([0.0], [1.0])
        simulated.actuate(Actuation((current if tick >= 200 else 0.0, 1.0), 0))
        velocity = simulated.truth().velocity[0]
        simulated.advance(DT)
    expected = (0.6 * 60.0 + sign * 1.5 * 12.0 * velocity) / 0.5
    assert velocity > 0.5
    assert signal(simulated, "pto.current") == pytest.approx(
        math.copysign(expected, current), rel=2e-3
    )
