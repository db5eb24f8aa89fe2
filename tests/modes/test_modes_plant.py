"""Plants of coupled modes against the frequency domain, the WaveBot's plant, and their parts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mode_plants
import numpy as np
import plant_files
import pytest
from mode_plants import AXIS, BUS, DRIVE, DT, HEAVE, OIL, PITCH, SURGE, WAVEBOT, mapping, world
from numpy.typing import NDArray

from rig.kinds.modular.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states
from sim_plant.bem import excitation_at
from sim_plant.modes import building, radiation
from sim_plant.modes.bem import impedance, mode_bem
from sim_plant.modes.building import PlantModel
from sim_plant.modes.world import Actuation, Stepper, World

Complexes = NDArray[np.complex128]
Control = Callable[[World], Sequence[float]]
AMPLITUDE = 0.05  # m


def motion_in_waves(
    model: PlantModel, frequency: float, control: Control, settle: float, dt: float = DT
) -> tuple[Complexes, float, float]:
    """Return complex positions per metre (e^{+i}), mechanical and electric power of axis 0."""
    simulated = world(model, sea_states.regular(AMPLITUDE, frequency), dt=dt)
    period = round(1.0 / frequency / dt)
    positions, shaft, electric = [], 0.0, 0.0
    factors = building.factor_matrix(model.plant)
    for tick in range(round(settle / dt / period) * period + 4 * period):
        simulated.actuate(Actuation(tuple(control(simulated)), 1))
        before = simulated.truth()
        simulated.advance(dt)
        if tick >= round(settle / dt / period) * period:
            truth = simulated.truth()
            positions.append(truth.position)
            velocity = 0.5 * (np.array(before.velocity) + np.array(truth.velocity))
            shaft += truth.shaft_force[0] * float(factors[0] @ velocity) / (4 * period)
            electric += truth.electric_power[0] / (4 * period)
    at = np.arange(1, len(positions) + 1) * dt  # settling took whole periods
    turn = np.exp(-2j * np.pi * frequency * at)
    return 2.0 * turn @ np.array(positions) / at.size, shaft, electric


def closed_form(
    model: PlantModel, frequency: float, pto: complex = 0.0, *, file: bool = False
) -> tuple[Complexes, float]:
    """Return complex positions for the amplitude and the mean power of axis 0, W.

    `pto` is a further force of axis 0 per velocity; with `file` the BEM file's own K_r acts.
    """
    plant, omega = model.plant, 2.0 * np.pi * frequency
    memory = radiation.response(model.radiation, np.array([omega]))[0]
    if file:
        memory = impedance(model.bem)[int(np.argmin(abs(model.bem.frequency - frequency)))]
    factors = building.factor_matrix(plant)
    friction = np.diag([axis.viscous_friction for axis in plant.axes.values()]).astype(complex)
    friction[0, 0] -= pto
    linear = np.diag([mode.linear_damping for mode in plant.modes.values()])
    system = building.stiffness_at_rest(plant, model.bem)
    system = system + 1j * omega * (memory + linear + factors.T @ friction @ factors)
    system = system - omega**2 * building.inertia_matrix(plant, model.bem)
    count = len(plant.modes)
    force = [excitation_at(mode_bem(model.bem, k), np.array([frequency]))[0] for k in range(count)]
    position = np.linalg.solve(system, np.conj(force) * AMPLITUDE)
    velocity = 1j * omega * (factors @ position)[0]
    return position, -0.5 * float(friction[0, 0].real) * abs(velocity) ** 2


def off(simulated: World) -> list[float]:
    return [0.0, 0.0] * simulated.model.params.axes


def one_mode() -> PlantModel:
    axis = {"moves_with": {"heave": 1.0}, "viscous_friction": 2500.0, "inertia": 200.0}
    return mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis}, delay_s=0.0))


def two_modes() -> PlantModel:
    axis = {"moves_with": {"surge": 1.0, "pitch": 0.8}, "viscous_friction": 3000.0}
    modes = {
        "surge": {**SURGE, "linear_damping": 900.0},
        "pitch": {**PITCH, "linear_damping": 200.0},
    }
    return mode_plants.model(mapping(modes, {"pto": axis}))


@pytest.mark.parametrize("frequency", [0.25, 0.4, 0.625])
@pytest.mark.parametrize("build", [one_mode, two_modes, mode_plants.four_mode_model])
def test_motion_and_power_of_a_linear_plant(
    build: Callable[[], PlantModel], frequency: float
) -> None:
    """The closed form with the plant's own K_r; the midpoint rule and the linear excitation within
    a tick leave some 1e-5, the remains of the start less than 1e-3.
    """
    model = build()
    position, power, _ = motion_in_waves(model, frequency, off, settle=160.0, dt=2.0 * DT)
    expected, expected_power = closed_form(model, frequency)
    assert np.abs(position - expected).max() < 2e-3 * np.abs(expected).max()
    np.testing.assert_allclose(np.abs(position), np.abs(expected), rtol=5e-3)
    assert power == pytest.approx(expected_power, rel=5e-3)


@pytest.mark.parametrize(
    ("build", "allowed"), [(one_mode, 0.02), (two_modes, 0.04), (mode_plants.four_mode_model, 0.06)]
)
def test_the_fit_moves_the_body_as_the_bem_file_does(
    build: Callable[[], PlantModel], allowed: float
) -> None:
    """The error of the motion near resonance is that of the fit, by the peak of the impedance."""
    model = build()
    for frequency in model.bem.frequency[6:24:3]:
        own, _ = closed_form(model, frequency)
        file, _ = closed_form(model, frequency, file=True)
        assert np.abs(own - file).max() < allowed * np.abs(file).max()


def lupa_plant(tmp_path: Path) -> PlantModel:
    """Return float, spar, surge and pitch of LUPA with its PTO between the bodies."""
    numbers = {
        "float__Heave": (248.7, 7628.0, 0.0), "spar__Heave": (175.5, 330.0, 700.0),
        "Surge": (424.2, 3184.0, 50.0), "Pitch": (320.0, 1800.0, 50.0),
    }  # fmt: skip
    modes = {
        dof.lower().replace("__", "_"): {
            "dof": dof, "mass": mass, "stiffness": stiffness, "linear_damping": damping
        }
        for dof, (mass, stiffness, damping) in numbers.items()
    }  # fmt: skip
    between = {"float_heave": 1.0, "spar_heave": -1.0}
    axis = {"moves_with": between, "viscous_friction": 350.0, "inertia": 9.34}
    return mode_plants.model(mapping(modes, {"pto": axis}), mode_plants.lupa(tmp_path / "lupa.nc"))


def one_mode_of_the_hemisphere(_: Path) -> PlantModel:
    axis = {"moves_with": {"heave": 1.0}, "viscous_friction": 2000.0}
    heave = {"dof": "Heave", "mass": 2094.4}
    return mode_plants.model(mapping({"heave": heave}, {"pto": axis}), mode_plants.HEMISPHERE)


def two_bodies(_: Path) -> PlantModel:
    modes = {
        "float": {"dof": "float__Heave", "mass": 3136.0, "linear_damping": 300.0},
        "disc": {"dof": "disc__Heave", "mass": 1480.0, "stiffness": 500.0, "linear_damping": 500.0},
    }
    axis = {"moves_with": {"float": 1.0, "disc": -1.0}, "viscous_friction": 3000.0}
    return mode_plants.model(mapping(modes, {"pto": axis}), mode_plants.TWO_BODY)


@pytest.mark.slow
@pytest.mark.parametrize("build", [one_mode_of_the_hemisphere, two_bodies, lupa_plant])
def test_power_is_that_of_the_bem_file(build: Callable[[Path], PlantModel], tmp_path: Path) -> None:
    """Closed form with added mass and damping of the file itself, at three of its frequencies."""
    model = build(tmp_path)
    frequencies = (0.3, 0.45, 0.6)
    grid = [int(np.argmin(abs(model.bem.frequency - each))) for each in frequencies]
    for index in grid:
        frequency = float(model.bem.frequency[index])
        period = round(1.0 / frequency / DT) * DT  # of whole steps
        _, power, _ = motion_in_waves(model, 1.0 / period, off, settle=80.0)
        _, expected = closed_form(model, frequency, file=True)
        assert power == pytest.approx(expected, rel=5e-3)


def test_the_error_of_a_step_is_of_second_order() -> None:
    model = one_mode()
    expected, _ = closed_form(model, 0.5)
    gaps = []
    for dt in (0.004, 0.002):
        position, _, _ = motion_in_waves(model, 0.5, off, settle=60.0, dt=dt)
        gaps.append(abs(position[0] - expected[0]) / abs(expected[0]))
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.1)
    assert gaps[1] < 4e-5  # a quarter at 1 ms


def test_a_controlled_axis_has_the_delay_of_hold_and_current_loop() -> None:
    """Force -c v at the ticks: C(i w) = -c e^{-i w dt/2} / (1 + i w tau); copper loss is R i²."""
    drive = {**DRIVE, "resistance_ohm": 0.4, "standby_w": 5.0}
    axis = {**AXIS, "moves_with": {"heave": 1.0}, "drive": drive}
    model = mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis}, delay_s=0.0))
    gain, per_current, frequency = 2500.0, 18.0, 0.4

    def control(simulated: World) -> list[float]:
        return [-gain / per_current * simulated.truth().velocity[0], 1.0]

    position, shaft, electric = motion_in_waves(model, frequency, control, settle=60.0)
    omega = 2.0 * np.pi * frequency
    tau = 1.0 / (2.0 * np.pi * 200.0)
    pto = -gain * np.exp(-0.5j * omega * DT) / (1.0 + 1j * omega * tau)
    expected, power = closed_form(model, frequency, pto)
    assert abs(position[0] - expected[0]) < 1e-4 * abs(expected[0])
    assert shaft == pytest.approx(power, rel=1e-3)
    current = abs(pto * omega * expected[0]) / per_current
    assert electric == pytest.approx(power + 0.2 * current**2 + 5.0, rel=2e-3)


def test_one_mode_of_the_wavebot_moves_as_the_wavebot() -> None:
    """Without spring and friction both plants differ by their fits (1 % and 0.3 % of K_r) alone."""
    changes = {
        "spring__spring_effect": 0.0,
        "pto__drivetrain_viscous": 0.0,
        "body__viscous_quadratic": 300.0,
    }
    sea = sea_states.jonswap(0.1, 2.0, 3.3, 20.0, 3)
    other = plant_files.world(sea, "wavebot_linear", waves__onset=1.0, **changes)
    heave = {
        "dof": "Heave",
        "mass": 860.0,
        "stiffness": 24337.0,
        "linear_damping": 475.0,
        "quadratic_damping": 300.0,
    }
    one = world(mode_plants.model(mapping({"heave": heave}, wave_onset_s=1.0), WAVEBOT), sea)
    one.actuate(Actuation((0.0, 0.0), 1))
    other.actuate(plant_files.command(heave_enable=0, wave_trigger=1))
    positions = []
    for _ in range(20_000):
        one.advance(DT)
        other.advance(DT)
        positions.append((one.truth().position[0], other.truth().position))
    motion = np.array(positions)
    assert motion[:, 1].std() > 0.01
    assert np.abs(motion[:, 0] - motion[:, 1]).max() < 0.015 * np.abs(motion[:, 1]).max()


# Parts.
def rough() -> PlantModel:
    """Return a plant of all parts, in motion: stops, play, oil, lines, a bus, noise, saturation."""
    stop = {"position": 0.03, "stiffness": 5e4, "damping": 1e3}
    modes = {
        "heave": {**HEAVE, "quadratic_damping": 500.0, "end_stop": stop},
        "surge": SURGE,
        "pitch": PITCH,
    }
    drive = {
        **DRIVE, "current_limit_a": 4.0, "resistance_ohm": 0.5, "current_noise_a": 0.1,
        "loss_w_per_a": 2.0, "back_emf_v_s_per_rad": 0.5,
    }  # fmt: skip
    friction = {"viscous_friction": 100.0, "coulomb_friction": 20.0, "inertia": 30.0}
    axes = {
        "one": {
            "moves_with": {"heave": 1.0, "pitch": 0.3}, "drive": drive, **friction,
            "gear_efficiency": 0.9, "cogging": {"force_n": 5.0, "pitch_m": 0.02},
        },
        "two": {
            "moves_with": {"surge": 1.0}, **friction, "end_stop": stop,
            "backlash": {"half_gap": 0.001, "stiffness": 5e5, "damping": 500.0},
        },
        "three": {
            "moves_with": {"pitch": 1.0}, "gear_ratio": 250.0, "hydraulic": OIL,
            "drive": {**DRIVE, "current_limit_a": 4.0},
        },
    }  # fmt: skip
    line = {
        "anchor_m": [3.0, 0.5, -3.0], "fairlead_m": [1.0, 0.0, -0.5], "pretension_n": 150.0,
        "stiffness_n_per_m": 4000.0, "damping_n_s_per_m": 30.0,
        "moves_with": {"surge": [1, 0, 0], "heave": [0, 0, 1], "pitch": [-0.5, 0, -1]},
    }  # fmt: skip
    mooring = {"stiffness": {"surge": {"pitch": -400.0}}, "lines": {"bow": line}}
    sensors = {
        "force": {"signal": "one.force", "noise": 1.0, "scale": 0.1, "offset": 2.0},
        "power": {"signal": "one.electric_power"},
        "mechanical": {"signal": "one.mechanical_power"},
        "motor": {"signal": "two.motor_position"},
        "oil": {"signal": "three.pressure"},
        "tilt": {"signal": "pitch.position", "noise": 0.01},
        "line": {"signal": "bow.tension"},
        "volts": {"signal": "bus.voltage"},
        "dump": {"signal": "bus.dump_power"},
        "probe": {"signal": "wave.elevation"},
    }
    given = mapping(modes, axes, sensors=sensors, delay_s=0.002, mooring=mooring, bus=BUS)
    return mode_plants.model(given)


def test_compiled_and_interpreted_plants_are_equal_bit_for_bit() -> None:
    model, sea = rough(), sea_states.jonswap(0.2, 3.0, 3.3, 10.0, 1)
    worlds = [world(model, sea, stepper=stepper) for stepper in (Stepper, CompiledStepper)]
    for tick in range(3000):
        current = 6.0 * math.sin(0.003 * tick)
        drives = (current, 1.0, -5.0 * current, float(tick % 900 > 100), -1.0, 1.0)
        for each in worlds:
            if not 1500 < tick < 1800:  # the watchdog trips
                each.actuate(Actuation(drives, int(tick < 2500)))
            each.advance(DT)
        one, other = (each.truth() for each in worlds)
        assert one == other
        assert worlds[0].readings() == worlds[1].readings()
    assert max(abs(x) for x in one.position) > 0.0


def test_a_seed_repeats_the_noise() -> None:
    def force(seed: int) -> float:
        simulated = World(rough(), sea_states.calm(), dt=DT, seed=seed, stepper=CompiledStepper)
        simulated.advance(DT)
        simulated.advance(DT)
        simulated.advance(DT)
        return simulated.readings()[12]

    assert force(1) == force(1) != force(2)


def test_a_free_decay_loses_energy_and_comes_to_rest() -> None:
    model = mode_plants.four_mode_model()
    simulated = world(model, sea_states.calm())
    simulated.release([0.1, -0.05, 0.1, 0.05])
    largest = [max(abs(x) for x in simulated.truth().position)]
    for _ in range(6):
        for _ in range(10_000):
            simulated.advance(DT)
        largest.append(max(abs(x) for x in simulated.truth().position))
    assert largest[-1] < 0.02 * largest[0]


def test_an_end_stop_holds_the_body() -> None:
    stop = {"position": 0.05, "stiffness": 1e6, "damping": 1e4}
    free, clamped = (
        world(mode_plants.model(mapping({"heave": mode})), sea_states.regular(0.2, 0.4))
        for mode in (HEAVE, {**HEAVE, "end_stop": stop})
    )
    largest = []
    for simulated in (free, clamped):
        simulated.actuate(Actuation((0.0, 0.0), 1))
        largest.append(0.0)
        for _ in range(20_000):
            simulated.advance(DT)
            largest[-1] = max(largest[-1], abs(simulated.truth().position[0]))
    assert largest[0] > 0.2
    assert 0.05 < largest[1] < 0.07


def test_coulomb_friction_holds_a_small_force() -> None:
    """A force below the friction only makes the body creep, at most at the regularised velocity."""
    axis = {**AXIS, "moves_with": {"surge": 1.0}, "coulomb_friction": 500.0}
    surge = {**SURGE, "stiffness": 0.0}
    simulated = world(
        mode_plants.model(mapping({"surge": surge}, {"pto": axis})), sea_states.calm()
    )
    for _ in range(10_000):
        simulated.actuate(Actuation((400.0 / 18.0, 1.0), 0))
        simulated.advance(DT)
    # tanh(v / v_c) = 0.8 at 1.0986 v_c
    assert simulated.truth().velocity[0] == pytest.approx(1.0986 * 0.002, rel=1e-3)


def test_a_two_body_axis_pushes_both_bodies_apart() -> None:
    modes = {"float": {"dof": "a", "mass": 3000.0}, "plate": {"dof": "b", "mass": 3000.0}}
    pair = mode_plants.read_modes(mode_plants.TWO_BODY)._replace(modes=("float", "plate"))
    stiff = {name: {**mode, "stiffness": 20_000.0} for name, mode in modes.items()}
    axes = {"pto": {"moves_with": {"float": 1.0, "plate": -1.0}, "viscous_friction": 9000.0}}
    given = mapping(stiff, axes, sensors={"gap": {"signal": "pto.position"}}, delay_s=0.0)
    plant = building.Plant.model_validate(given)
    simulated = world(building.assemble(plant, pair), sea_states.calm())
    for _ in range(60_000):
        simulated.actuate(Actuation((1000.0 / 18.0, 1.0), 0))
        simulated.advance(DT)
    up, down = simulated.truth().position
    stiffness = building.stiffness_matrix(plant, pair)
    expected = np.linalg.solve(stiffness, [1000.0, -1000.0])
    assert [up, down] == pytest.approx(expected.tolist(), rel=1e-2)
    assert simulated.readings()[4] == pytest.approx(up - down)
    counts = 12.0 / (2.0 * math.pi) * 1_048_576 * (up - down)
    assert simulated.readings()[0] == pytest.approx(counts, abs=1.0)


def drive_readings(simulated: World) -> tuple[float, ...]:
    return simulated.readings()[1:4]  # current, enabled, fault


def test_enable_delay_current_limit_and_watchdog() -> None:
    drive = {**DRIVE, "current_limit_a": 4.0, "enable_delay_s": 0.05, "watchdog_s": 0.1}
    axis = {**AXIS, "moves_with": {"heave": 1.0}, "drive": drive}
    simulated = world(
        mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis}, delay_s=0.0)), sea_states.calm()
    )
    for tick in range(100):
        simulated.actuate(Actuation((10.0, 1.0), 0))
        simulated.advance(DT)
        if abs(tick - 50) > 1:  # within the rounding of 50 times 1 ms
            assert drive_readings(simulated)[1] == float(tick > 50)
    assert drive_readings(simulated) == pytest.approx((4.0, 1.0, 0.0))
    for _ in range(102):
        simulated.advance(DT)  # no command arrives
    assert drive_readings(simulated)[1:] == (0.0, 1.0)
    simulated.actuate(Actuation((0.0, 0.0), 0))
    simulated.advance(DT)
    assert drive_readings(simulated)[2] == 0.0


def test_regeneration_loses_a_share_of_absorbed_power() -> None:
    powers = []
    for efficiency in (1.0, 0.5):
        drive = {**DRIVE, "regeneration_efficiency": efficiency}
        axis = {**AXIS, "moves_with": {"heave": 1.0}, "drive": drive}
        simulated = world(
            mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis})), sea_states.calm()
        )
        simulated.release([0.0], [0.5])
        for _ in range(110):
            simulated.actuate(Actuation((-10.0, 1.0), 0))
            simulated.advance(DT)
        powers.append(simulated.truth().electric_power[0])
    assert powers[0] < 0.0
    assert powers[1] == pytest.approx(0.5 * powers[0], rel=1e-9)


def test_readings_are_as_old_as_the_delay() -> None:
    simulated = world(
        mode_plants.model(mapping({"heave": HEAVE}, delay_s=0.003)), sea_states.regular(0.1, 0.5)
    )
    simulated.actuate(Actuation((0.0, 0.0), 1))
    elevations = []
    for _ in range(50):
        simulated.advance(DT)
        elevations.append(simulated.truth().elevation)
    assert simulated.delay == pytest.approx(0.003)
    assert simulated.readings()[-1] == elevations[-4]


def test_the_wave_clock_starts_with_the_trigger() -> None:
    simulated = world(
        mode_plants.model(mapping({"heave": HEAVE}, wave_onset_s=0.5)), sea_states.regular(0.1, 0.5)
    )
    values: list[Any] = []
    for trigger in (0, 1, 0, 1):
        simulated.actuate(Actuation((0.0, 0.0), trigger))
        for _ in range(700):
            simulated.advance(DT)
        truth = simulated.truth()
        values.append((truth.elevation, truth.wave_clock))
    assert values[0] == values[2] == (0.0, 0.0)
    assert values[1] == values[3]
    assert values[1] == pytest.approx((0.1 * math.cos(2 * math.pi * 0.35), 0.7))
