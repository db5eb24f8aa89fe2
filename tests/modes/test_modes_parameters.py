"""Plant files of coupled modes: units, allowed values, names of modes, axes and signals."""

from __future__ import annotations

import math
from copy import deepcopy
from typing import Any

import mode_plants
import pytest
from mode_plants import AXIS, BUS, CYLINDER, HEAVE, OIL, PITCH, SURGE, mapping
from pydantic import ValidationError

from sim_plant import sea_states
from sim_plant.modes import building
from sim_plant.modes.parameters import Plant, plain_unit
from sim_plant.modes.world import World

LINE: dict[str, Any] = {
    "anchor_m": [0, 0, -3],
    "fairlead_m": [0, 0, -1],
    "pretension_n": 100.0,
    "stiffness_n_per_m": 1000.0,
    "moves_with": {"heave": [0, 0, 1]},
}


MAGNETIC: dict[str, Any] = {
    "pinion_radius": 0.33,
    "stator_positions": [-0.1, 0.0, 0.1],
    "rates": [5000, 400, -6000],
}

PLANT = Plant.model_validate(mapping({"heave": HEAVE, "pitch": PITCH}))


def test_a_number_may_have_unit_and_source() -> None:
    mass = {"value": 3136.0, "unit": "kg", "source": "weighed"}
    plant = Plant.model_validate(mapping({"heave": {**HEAVE, "mass": mass}}))
    assert plant.modes["heave"].mass == 3136.0


def change(path: str, value: Any) -> dict[str, Any]:
    given: Any = deepcopy(
        mapping({"heave": HEAVE, "pitch": PITCH}, sensors={"force": {"signal": "heave.force"}})
    )
    inner = given
    *keys, last = path.split("/")
    for key in keys:
        inner = inner[key]
    inner[last] = value
    return given  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("modes/heave/mass", -1.0, "greater than 0"),
        ("modes/heave/mass", {"value": 3.0, "unit": "t"}, "unit 't' is not allowed; allowed: kg"),
        ("modes/heave/mass", {"amount": 3.0}, "neither a number nor a mapping of value"),
        ("modes/heave/mass", "heavy", "valid number"),
        ("modes/heave/colour", "red", "Extra inputs"),
        ("modes/heave/dof", "Pitch", r"modes.pitch.dof\n +'Pitch' is already that of heave"),
        ("modes/heave/end_stop", {"position": 0.0, "stiffness": 1e5}, "greater than 0"),
        ("axes/heave/moves_with", {"sway": 1.0}, "'sway' is no mode; allowed: heave, pitch"),
        ("axes/heave/moves_with", {"heave": 0.0}, "all factors are 0"),
        ("axes/heave/moves_with", {}, "at least 1 item"),
        ("axes/heave/drive", {"current_limit_a": 3.0}, "Field required"),
        ("axes/heave/gear_ratio", 0.0, "greater than 0"),
        ("axes/heave/drive/regeneration_efficiency", 1.5, "less than or equal to 1"),
        ("sensors/force/signal", "heave.power", "is no signal; allowed: heave.position"),
        ("sensors/force/noise", -1.0, "greater than or equal to 0"),
        ("delay_s", -0.1, "greater than or equal to 0"),
        ("modes", {}, "at least 1 item"),
        ("axes/heave/backlash", {"half_gap": 0.01, "stiffness": 1e5}, "needs an inertia above 0"),
        ("axes/heave/gear_efficiency", 1.1, "less than or equal to 1"),
        ("axes/heave/hydraulic", {}, "area_m2"),
        ("axes/heave/hydraulic", OIL, r"gear_ratio: 12 rad/m is not .* = 250 rad/m"),
        ("axes/heave/drive/back_emf_v_s_per_rad", 1.0, "needs drive.voltage_drop_v_per_a, or"),
        ("axes/heave/counts_per_revolution", 2**40, "counts per unit of the axis; allowed up to"),
        ("bus", {**BUS, "supply_v": 63.0}, "supply_v: 63 is out of range; allowed above 0"),
        ("bus", {**BUS, "supply_v": 0.0}, "supply_v: 0 is out of range"),
        ("bus", {**BUS, "dump_on_v": 50.0}, "voltages must ascend; .* dump_on_v 50"),
        ("bus", {**BUS, "dump_ohm": None}, "dump_ohm, dump_on_v and dump_off_v belong together"),
        ("bus", {**BUS, "voltage_v": 20.0}, "voltage_v: 20 is not between undervoltage_v and"),
        ("bus", {**BUS, "capacitance_f": math.nan}, "finite number"),
        ("mooring", {"stiffness": {"heave": {"sway": 1.0}}},
         r"mooring.stiffness.heave.sway\n +.sway. is no mode"),
        ("mooring", {"stiffness": {"heave": {"pitch": 1.0}, "pitch": {"heave": 2.0}}},
         "give it once"),
        ("mooring", {"lines": {"bow": {**LINE, "fairlead_m": [0, 0, -3]}}}, "needs a length"),
        ("mooring", {"lines": {"bow": {**LINE, "anchor_m": [0, 0]}}}, "at least 3 items"),
        ("mooring", {"lines": {"bow": {**LINE, "moves_with": {"sway": [1, 0, 0]}}}},
         r"mooring.lines.bow.moves_with.sway\n +'sway' is no mode"),
        ("mooring", {"lines": {"heave": LINE}}, r"mooring.lines.heave\n +.heave. is taken"),
        ("sensors/force/signal", "bus.voltage", "is no signal"),
        ("sensors/force/signal", "heave.spring_force", "is no signal"),
        ("modes", {"heave": {"mass": 20.0}}, "none has a dof of the BEM file"),
        ("axes/heave/spring", {"rate": 2e12}, "less than or equal to 1000000000000"),
        ("axes/heave/spring", {}, "rate"),
        ("axes/heave/spring", {"rate": 1.0, "preload": 1.0, "rest_position": 1.0},
         "preload: is rate times rest_position; give one of them"),
        ("axes/heave/spring", {"rate": {"value": 1.0, "unit": "kN/m"}}, "allowed: N/m, N.m/rad"),
        ("axes/heave/magnetic_spring", {"pinion_radius": 0.0, "rate": 1.0}, "greater than 0"),
        ("axes/heave/magnetic_spring", {"pinion_radius": 0.3}, "rate: needs either rate, or"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "rate": 1.0}, "rate: needs either rate, or"),
        ("axes/heave/magnetic_spring", {"pinion_radius": 0.3, "rate": 1.0, "stator": "heave"},
         "stator: a fixed rate has no stator"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "rates": [1.0, 2.0]},
         "rates: 2 for 3 stator_positions"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "stator_positions": [0, 0.1, 0.1]},
         "must ascend"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "stator_position": 0.2},
         "stator_position: 0.2 is beyond the table; allowed -0.1 .. 0.1"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "fit_half_angle_rad": 1.6}, "less than 1.5"),
        ("axes/heave/magnetic_spring", {**MAGNETIC, "stator": "heave"},
         "'heave' is no other axis; allowed: none"),
        ("sensors/force/signal", "heave.pressure", "is no signal"),
    ],
)  # fmt: skip
def test_an_invalid_file_is_refused(path: str, value: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Plant.model_validate(change(path, value))


def test_signals_of_modes_axes_and_waves() -> None:
    plant = Plant.model_validate(
        mapping({"float": HEAVE, "spar": PITCH}, {"pto": {"moves_with": {"float": 1, "spar": -1}}})
    )
    assert set(plant.signals()) == {
        "float.position", "float.velocity", "spar.position", "spar.velocity", "wave.elevation",
        "pto.position", "pto.velocity", "pto.force", "pto.motor_force", "pto.current",
        "pto.mechanical_power", "pto.electric_power", "pto.motor_position", "pto.motor_velocity",
    }  # fmt: skip


def test_a_missing_stiffness_is_asked_for_by_name() -> None:
    plant = Plant.model_validate(mapping({"heave": HEAVE}))
    path = mode_plants.WAVEBOT
    with pytest.raises(ValueError, match=r"no hydrostatic stiffness; set modes.heave.stiffness"):
        building.build(plant, path)


def test_the_stated_stiffness_replaces_that_of_the_file() -> None:
    model = mode_plants.model(mapping({"surge": SURGE, "heave": HEAVE}))
    stiffness = building.stiffness_matrix(model.plant, model.bem)
    assert stiffness[0, 0] == 9000.0
    assert model.bem.stiffness is not None
    assert stiffness[1, 1] == model.bem.stiffness[1, 1]


def test_a_plant_too_fast_for_the_tick_is_refused() -> None:
    stop = {"position": 0.5, "stiffness": 1e10}
    model = mode_plants.model(mapping({"heave": {**HEAVE, "end_stop": stop}}))
    with pytest.raises(ValueError, match=r"fastest motion of the plant, \d+ rad/s, needs a tick"):
        World(model, sea_states.calm(), dt=0.001, seed=1)


@pytest.mark.parametrize(
    ("delay", "dt", "age"),
    [
        (0.0, 0.001, 0.0), (0.001, 0.001, 0.001), (0.0015, 0.001, 0.002), (0.001, 0.005, 0.005),
        (0.001, 0.0002, 0.001), (0.003, 0.001, 0.003),
    ],
)  # fmt: skip
def test_the_delay_is_rounded_up_to_whole_ticks(delay: float, dt: float, age: float) -> None:
    model = mode_plants.model(mapping({"heave": HEAVE}, delay_s=delay))
    assert World(model, sea_states.calm(), dt=dt, seed=1).delay == pytest.approx(age)


def test_factors_couple_inertia() -> None:
    axis = {**AXIS, "moves_with": {"surge": 1.0, "pitch": 0.5}, "inertia": 40.0}
    plant = Plant.model_validate(mapping({"surge": SURGE, "pitch": PITCH}, {"pto": axis}))
    model = building.build(plant, CYLINDER)
    total = building.inertia_matrix(plant, model.bem)
    own = total - model.bem.added_mass_infinite
    assert own.ravel().tolist() == pytest.approx([3176.0, 20.0, 20.0, 1010.0])


@pytest.mark.parametrize(
    ("path", "turning", "unit"),
    [
        ("modes.heave.linear_damping", (), "N*s/m"),
        ("modes.heave.quadratic_damping", (), "N*s2/m2"),
        ("modes.heave.stiffness", (), "N/m"),
        ("modes.heave.mass", (), "kg"),
        ("axes.pto.viscous_friction", (), "N*s/m"),
        ("axes.pto.viscous_friction", ("pto",), "N*m*s/rad"),
        ("axes.pto.inertia", ("pto",), "kg*m2"),
        ("axes.pto.coulomb_friction", ("pto",), "N*m"),
        ("axes.pto.spring.rate", ("pto",), "N*m/rad"),
        ("axes.pto.drive.resistance_ohm", ("pto",), "ohm"),
        ("delay_s", (), "s"),
        ("name", (), ""),
        ("modes.heave.unknown", (), ""),
    ],
)
def test_unit_of_a_plain_number(path: str, turning: tuple[str, ...], unit: str) -> None:
    axis = next(iter(PLANT.axes))
    parts = [axis if part == "pto" else part for part in path.split(".")]
    assert plain_unit(PLANT, parts, [axis] * len(turning)) == unit


def test_plain_numbers_of_a_mode_that_turns() -> None:
    units = {"mass": "kg*m2", "linear_damping": "N*m*s/rad", "stiffness": "N*m/rad"}
    for name, unit in units.items():
        assert plain_unit(PLANT, ("modes", "pitch", name), ()) == unit
