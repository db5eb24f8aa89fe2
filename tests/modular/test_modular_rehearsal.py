"""The rehearsal room of a modular rig: its devices, and the checks of its simulated plant."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from mode_plants import CYLINDER, HEAVE, PITCH
from modular_rigs import DT, plant_mapping, rig_mapping, two_axes
from modular_rigs import PLANT_SENSORS as SENSORS
from ruamel.yaml import YAML

from controllers.signals import AxisCommand, AxisSense
from rig.config.law_settings import IMPEDANCE
from rig.config.yaml_source import load_mapping
from rig.kinds.modular.build import composition
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.rehearsal.devices import connect
from rig.kinds.modular.rehearsal.job import plant_problems, plant_settings
from rig.kinds.modular.tick import Composition, compose
from rig.planning.input_files import ConfigSource

SEA = {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5}


def plant_source(folder: Path, given: dict[str, Any]) -> ConfigSource:
    shutil.copy(CYLINDER, folder)
    path = folder / "plant.yaml"
    with path.open("w") as stream:
        YAML().dump(given, stream)
    return ConfigSource(*load_mapping(path))


def composed_rig(rig: RigFile) -> Composition:
    return composition(rig, dict.fromkeys(rig.axes, IMPEDANCE))


@pytest.mark.parametrize("compiled", [False, True])
def test_axes_and_sensors_are_matched_by_name(tmp_path: Path, *, compiled: bool) -> None:
    rig, _ = two_axes()
    force = rig.sensors["pto_force"].model_copy(update={"scale": 2.0, "offset": 5.0})
    rig = rig.model_copy(update={"sensors": {**rig.sensors, "pto_force": force}})
    parts = composed_rig(rig)
    settings = plant_settings(plant_source(tmp_path, plant_mapping()), rig, parts, SEA, 1)
    devices = connect({**settings, "compiled": compiled}, DT)
    tick = compose(parts)
    on = AxisCommand(90.0, 5.0, 1, 0)
    off = AxisCommand(0.0, 0.0, 0, 0)
    for k in range(60):
        sense = devices.read(k * DT)
        assert type(sense) is tick.Sense
        devices.write(tick.Command(on, off, 1))
    heave, pitch = sense.heave, sense.pitch
    assert isinstance(heave, AxisSense)
    assert (heave.enabled, pitch.enabled) == (1, 0)
    assert heave.current == pytest.approx(5.0, rel=1e-6)
    assert heave.encoder_age == pytest.approx(0.001)
    assert sense.pto_force.value == pytest.approx(2.0 * 5.0 * 18.0 + 5.0, rel=1e-6)
    assert sense.dc_power == (0.0, pytest.approx(0.001))
    assert abs(heave.counts) > 0
    assert sense.wave.elevation == pytest.approx(0.1, rel=0.02)
    devices.stop(0)
    assert devices.read(0.08).heave.enabled == 0
    devices.close()


def test_settings_are_json_values(tmp_path: Path) -> None:
    rig, _ = two_axes()
    settings = plant_settings(
        plant_source(tmp_path, plant_mapping()), rig, composed_rig(rig), SEA, 1
    )
    assert settings["bem"] == str(tmp_path / CYLINDER.name)
    assert settings["sensors"] == [["pto_force", 1.0, 0.0], ["dc_power", 1.0, 0.0]]


def problems(folder: Path, given: dict[str, Any]) -> str:
    rig, _ = two_axes()
    rig_path = folder / "rig.yaml"
    with rig_path.open("w") as stream:
        axes = {name: axis.model_dump(mode="json") for name, axis in rig.axes.items()}
        YAML().dump(rig_mapping(axes=axes), stream)
    locate = load_mapping(rig_path)[1]
    model, found = plant_problems(plant_source(folder, given), rig, locate, 1000)
    assert (model is None) == bool(found)
    return "\n".join(f"{each.key}: {each.message}" for each in found)


def test_a_valid_plant_has_no_problems(tmp_path: Path) -> None:
    given = plant_mapping()
    assert problems(tmp_path, given) == ""


def test_a_rule_of_the_plant_has_the_line_of_its_key(tmp_path: Path) -> None:
    given = plant_mapping()
    given["axes"]["heave"]["magnetic_spring"] = {
        "pinion_radius": 0.3, "stator": "slide", "stator_positions": [0, 1], "rates": [0, 900]
    }  # fmt: skip
    source = plant_source(tmp_path, given)
    _, (problem,) = plant_problems(source, None, None, 1000)
    lines = (tmp_path / "plant.yaml").read_text().splitlines()
    assert lines[problem.line - 1].strip() == "stator: slide"
    assert problem.key == "axes.heave.magnetic_spring.stator"
    assert problem.message == "'slide' is no other axis; allowed: pitch"


def test_differences_between_rig_and_plant_are_named(tmp_path: Path) -> None:
    given = plant_mapping()
    given["axes"]["heave"]["gear_ratio"] = 13.0
    assert "12 is not the plant's 13" in problems(tmp_path, given)

    given = plant_mapping()
    del given["axes"]["pitch"], given["sensors"]
    text = problems(tmp_path, given)
    assert "axes.pitch: is not in the simulated plant's axes; it has heave" in text
    assert "sensors.dc_power: is not in the simulated plant's sensors; it has none" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bem": "missing.nc"}, "bem: cannot read .*missing.nc: No such file"),
        ({"density_kg_per_m3": 900.0}, "states density_kg_per_m3 1000"),
        ({"delay_s": -1.0}, "delay_s: .*out of range"),
        ({"modes": {"heave": {**HEAVE, "dof": "Roll"}, "pitch": PITCH}}, "'Roll' is no mode of"),
    ],
)
def test_problems_of_the_plant_alone(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    assert re.search(message, problems(tmp_path, plant_mapping(**change)))


def test_a_part_that_the_plant_lacks_is_refused(tmp_path: Path) -> None:
    rig, _ = two_axes()
    given = plant_mapping()
    del given["axes"]["pitch"]
    given["sensors"] = {"pto_force": SENSORS["pto_force"], "dc_power": {"signal": "heave.current"}}
    settings = plant_settings(plant_source(tmp_path, given), rig, composed_rig(rig), SEA, 1)
    with pytest.raises(ValueError, match="the plant has no axis 'pitch' of the rig; it has heave"):
        connect({**settings, "compiled": False}, DT)
