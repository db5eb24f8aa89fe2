"""Springs of axes in a moving plant: periods, energy, masses out of the water, compiled bits."""

from __future__ import annotations

import math
from typing import Any

import mode_plants
import numpy as np
import plant_files
import pytest
from mode_plants import DT, HEAVE, mapping, world
from scipy.special import ellipk
from test_modes_plant import closed_form, motion_in_waves, off
from test_parts_in_plants import signal

from rig.kinds.modular.rehearsal.compiled_plant import CompiledStepper
from sim_plant import magnetic_spring, sea_states
from sim_plant.building import spring_params
from sim_plant.modes import building
from sim_plant.modes.building import PlantModel
from sim_plant.modes.world import Actuation, Stepper, World

RADIUS = 0.33
TABLE: dict[str, Any] = {
    "pinion_radius": RADIUS,
    "stator_positions": [-0.1, 0.0, 0.1],
    "rates": [5000.0, 500.0, -6000.0],
}
MASS = 50.0


def dry_plant(spring: dict[str, Any], slide: dict[str, Any] | None = None) -> PlantModel:
    """Return a plant of a mass with springs and a slide, both out of the water, beside a hull."""
    modes = {
        "cart": {"mass": MASS},
        "heave": HEAVE,
        "slide": {"mass": 20.0, "stiffness": 4000.0, **(slide or {})},
    }
    axes = {
        "cart": {"moves_with": {"cart": 1.0}, **spring},
        "slide": {"moves_with": {"slide": 1.0}},
    }
    return mode_plants.model(mapping(modes, axes, delay_s=0.0))


def free_motion(model: PlantModel, position: list[float], ticks: int) -> World:
    simulated = world(model, sea_states.calm())
    simulated.release(position)
    for _ in range(ticks):
        simulated.actuate(Actuation((0.0,) * 4, 0))
        simulated.advance(DT)
    return simulated


def period(model: PlantModel, start: float) -> float:
    """Return the period of the cart, released from rest, over four of its swings."""
    simulated = world(model, sea_states.calm())
    simulated.release([start, 0.0, 0.0])
    crossings: list[float] = []
    before = start
    for tick in range(20_000):
        simulated.actuate(Actuation((0.0,) * 4, 0))
        simulated.advance(DT)
        now = simulated.truth().position[0]
        if before > 0.0 >= now:
            crossings.append((tick + before / (before - now)) * DT)
        before = now
        if len(crossings) == 5:
            return (crossings[4] - crossings[0]) / 4.0
    raise AssertionError("no period")


def test_a_spring_gives_a_mass_its_natural_frequency() -> None:
    """2 pi sqrt(m / k) with both springs; one step of 1 ms of 15 rad/s costs 4e-5."""
    both = {"spring": {"rate": 9000.0}, "magnetic_spring": {"pinion_radius": 0.33, "rate": 2000.0}}
    assert period(dry_plant(both), 1.0e-3) == pytest.approx(
        2.0 * math.pi * math.sqrt(MASS / 11_000.0), rel=1e-4
    )


@pytest.mark.parametrize("start", [0.05, 0.2, 0.45])
def test_the_period_of_a_magnetic_spring_is_that_of_a_pendulum(start: float) -> None:
    """2 x / r is the angle of a pendulum: T = 4 / w0 K(sin²(x0 / r)), up to 78 deg of the rotor."""
    rate = 6000.0
    model = dry_plant({"magnetic_spring": {"pinion_radius": RADIUS, "rate": rate}})
    expected = 4.0 * math.sqrt(MASS / rate) * ellipk(math.sin(start / RADIUS) ** 2)
    assert period(model, start) == pytest.approx(expected, rel=1e-4)


SLIDE_STIFFNESS = 25_000.0
SLOW = {**TABLE, "rates": [1800.0, 200.0, -1500.0]}


def energy(simulated: World, place: float, pull: float) -> float:
    """Return the energy of cart, slide and spring: W = -Tp cos 2 theta / 2 + integral pull |Tp|."""
    truth = simulated.truth()
    x, z = truth.position[0], place + truth.position[2]
    grid = np.linspace(place, z, 201)
    peak = 0.5 * RADIUS**2 * np.interp(grid, SLOW["stator_positions"], SLOW["rates"])
    magnetic = -0.5 * peak[-1] * math.cos(2.0 * x / RADIUS) + pull * np.trapezoid(abs(peak), grid)
    kinetic = 0.5 * (MASS * truth.velocity[0] ** 2 + 20.0 * truth.velocity[2] ** 2)
    return float(kinetic + 0.5 * SLIDE_STIFFNESS * truth.position[2] ** 2 + magnetic)


@pytest.mark.parametrize(("place", "pull"), [(0.05, 0.0), (-0.06, 0.0), (-0.06, 3.0)])
def test_a_moved_stator_takes_the_energy_that_the_axis_gives(place: float, pull: float) -> None:
    """Of what the free slide has at most, 10 s change the sum by 0.3 % at 1 ms, by the midpoint
    rule: an eighth at half the step. Without the stator's force it would change by all of it.
    """
    spring = {**SLOW, "stator": "slide", "stator_position": place, "pull": pull}
    model = dry_plant({"magnetic_spring": spring}, {"stiffness": SLIDE_STIFFNESS})
    shares = []
    for ticks in (1, 2):
        simulated = world(model, sea_states.calm(), dt=DT / ticks)
        simulated.release([0.3, 0.0, 0.0])
        totals, kinetic, reach = [], [], []
        for tick in range(10_000 * ticks):
            simulated.actuate(Actuation((0.0,) * 4, 0))
            simulated.advance(DT / ticks)
            truth = simulated.truth()
            kinetic.append(10.0 * truth.velocity[2] ** 2)
            reach.append(place + truth.position[2])
            if tick % 10 == 0:
                totals.append(energy(simulated, place, pull))
        assert max(kinetic) > 0.4  # J
        assert 0.0 < min(np.sign(place) * np.array(reach)) < max(np.abs(reach)) < 0.1
        shares.append(np.ptp(totals) / max(kinetic))
    assert shares[0] < 3e-3
    assert shares[0] / shares[1] == pytest.approx(8.0, rel=0.2)


def test_beyond_its_table_the_rate_is_constant() -> None:
    spring = {**SLOW, "stator": "slide", "stator_position": 0.1, "pull": 3.0}
    simulated = world(dry_plant({"magnetic_spring": spring}), sea_states.calm())
    for place, slope in ((-0.01, -17_000.0), (0.01, 0.0)):
        simulated.release([0.1, 0.0, place])
        rate = -1500.0 if place > 0.0 else -1500.0 + 170.0
        expected = -0.5 * RADIUS * rate * math.sin(2.0 * 0.1 / RADIUS)
        assert signal(simulated, "cart.spring_force") == pytest.approx(expected)
        gradient, peak = 0.5 * RADIUS**2 * slope, 0.5 * RADIUS**2 * abs(rate)
        reaction = 0.5 * gradient * math.cos(2.0 * 0.1 / RADIUS) - 3.0 * peak
        assert signal(simulated, "cart.stator_force") == pytest.approx(reaction)


def test_the_spring_of_the_wavebot_is_this_part() -> None:
    """Same table, lever and fit: the force of sim_plant/magnetic_spring.py at all its stations."""
    file = plant_files.plant("wavebot").spring
    law = spring_params(file, plant_files.plant("wavebot").stator)
    for z in (-0.93, -0.2, 0.0, 0.335, 0.67):
        spring = {
            "pinion_radius": file.lever.value,
            "fit_half_angle_rad": file.fit_half_angle.value,
            "stator_positions": [0.01 * each for each in file.stator_positions.value],
            "rates": list(file.spring_rates.value),
            "stator": "slide",
            "stator_position": z,
        }
        model = dry_plant({"magnetic_spring": spring})
        simulated = world(model, sea_states.calm())
        simulated.release([0.2, 0.0, 0.0])
        rate = magnetic_spring.table_rate(law, 100.0 * z)
        expected = magnetic_spring.force(law, rate, 0.2)
        assert signal(simulated, "cart.spring_force") == pytest.approx(expected, rel=1e-12)
        stiffness = building.spring_stiffness(model.plant)
        assert stiffness[0, 0] == pytest.approx(1.2129 * rate, rel=1e-3)  # the report's 1.213


def test_springs_count_in_the_linear_model() -> None:
    """A negative spring tunes the hull down; the closed form has stiffness_at_rest alone."""
    plain = mode_plants.model(mapping({"heave": HEAVE}))
    spring = {"spring": {"rate": -9000.0}, "magnetic_spring": {**TABLE, "stator_position": 0.05}}
    axis = {"moves_with": {"heave": 0.5}, "viscous_friction": 9000.0, **spring}
    model = mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis}, delay_s=0.0))
    at_rest = building.stiffness_at_rest(model.plant, model.bem)[0, 0]
    bare = building.stiffness_at_rest(plain.plant, plain.bem)[0, 0]
    assert at_rest == pytest.approx(bare + 0.25 * (-9000.0 - 2750.0))
    for frequency in (0.25, 0.4):
        position, _, _ = motion_in_waves(model, frequency, off, settle=60.0)
        expected, _ = closed_form(model, frequency)
        assert abs(position[0] - expected[0]) < 2e-3 * abs(expected[0])  # its sine costs 1e-3


def test_a_preload_moves_the_rest_position() -> None:
    """F_0 = k x_0; the damped hull comes to rest where hydrostatics and spring are in balance."""
    results = []
    for given in ({"rest_position": 0.05}, {"preload": 500.0}):
        axis = {"moves_with": {"heave": 1.0}, "viscous_friction": 40_000.0,
                "spring": {"rate": 10_000.0, **given}}  # fmt: skip
        model = mode_plants.model(mapping({"heave": HEAVE}, {"pto": axis}, delay_s=0.0))
        simulated = world(model, sea_states.calm())
        for _ in range(20_000):
            simulated.advance(DT)
        total = building.stiffness_at_rest(model.plant, model.bem)[0, 0]
        results.append(simulated.truth().position[0])
        assert results[-1] == pytest.approx(500.0 / total, rel=1e-3)
    assert results[0] == results[1]


def test_a_mass_out_of_the_water_leaves_the_others_as_they_are() -> None:
    modes = {"cart": {"mass": MASS, "stiffness": 100.0}, "heave": HEAVE}
    axes = {"pto": {"moves_with": {"heave": 1.0}, "viscous_friction": 2500.0}}
    sea = sea_states.jonswap(0.1, 2.0, 3.3, 10.0, 3)
    positions = []
    for given in (modes, {"heave": HEAVE}):
        simulated = world(mode_plants.model(mapping(given, axes)), sea)
        for _ in range(5000):
            simulated.actuate(Actuation((0.0, 0.0), 1))
            simulated.advance(DT)
        positions.append(simulated.truth().position)
    assert positions[0][0] == 0.0
    assert abs(positions[1][0]) > 1e-3
    assert positions[0][1] == pytest.approx(positions[1][0], rel=1e-9)


def test_a_spring_too_stiff_for_the_tick_is_refused() -> None:
    """A light slide on a steep table: the coupling alone is too fast for 1 ms."""
    steep = {**TABLE, "rates": [5.0e6, 0.0, -5.0e6], "stator": "slide"}
    for spring in ({"spring": {"rate": 2.0e8}}, {"magnetic_spring": steep}):
        with pytest.raises(ValueError, match="needs a tick of at most"):
            world(dry_plant(spring, {"mass": 0.5}), sea_states.calm())


def test_compiled_and_interpreted_springs_are_equal_bit_for_bit() -> None:
    """Both sorts on one axis, a moved and a fixed stator, a hull, readings with all signals."""
    modes = {"slide": {"mass": 20.0}, "heave": HEAVE, "pitch": mode_plants.PITCH}
    friction = {"viscous_friction": 300.0, "coulomb_friction": 8.0}
    axes = {
        "one": {"moves_with": {"heave": 1.0, "pitch": 0.3}, "spring": {"rate": -800.0},
                "magnetic_spring": {**TABLE, "stator": "slide", "stator_position": 0.03,
                                    "pull": 5.0, "fit_half_angle_rad": 0.685}},
        "slide": {"moves_with": {"slide": 1.0}, **friction,
                  "spring": {"rate": 2000.0, "preload": -20.0}},
        "two": {"moves_with": {"pitch": 1.0},
                "magnetic_spring": {"pinion_radius": 1.0, "rate": 900.0}},
    }  # fmt: skip
    sensors = {name.replace(".", "_"): {"signal": name} for name in (
        "one.spring_force", "one.stator_force", "slide.spring_force", "two.spring_force",
    )}  # fmt: skip
    model = mode_plants.model(mapping(modes, axes, sensors=sensors))
    sea = sea_states.jonswap(0.3, 3.0, 3.3, 10.0, 1)
    worlds = [world(model, sea, stepper=stepper) for stepper in (Stepper, CompiledStepper)]
    reach = []
    for tick in range(3000):
        drives = (6.0, 1.0, 12.0 * math.sin(0.004 * tick), 1.0, 0.0, 0.0)
        for each in worlds:
            each.actuate(Actuation(drives, 1))
            each.advance(DT)
        one, other = (each.truth() for each in worlds)
        assert one == other
        assert worlds[0].readings() == worlds[1].readings()
        reach.append(0.03 + one.position[0])
    assert min(reach) < 0.0 < max(reach)
    assert all(abs(value) > 0.0 for value in worlds[0].readings()[-5:-1])


def test_signals_of_springs() -> None:
    names = dry_plant({"magnetic_spring": TABLE}).plant.signals()
    assert {"cart.spring_force", "cart.stator_force"} <= set(names)
    assert "slide.spring_force" not in names
    fixed = {"pinion_radius": 0.3, "rate": -2000.0}
    names = dry_plant({"magnetic_spring": fixed}).plant.signals()
    assert "cart.spring_force" in names
    assert "cart.stator_force" not in names
