"""A modular rig's axis identified from an open-loop reference, against its plant in closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig as rig_here
from ruamel.yaml import YAML

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load as load_model
from rig.identification.identify import identify
from rig.kinds.modular.config import RigFile
from sim_plant.modes import radiation
from sim_plant.modes.bem import read_modes

BEM = Path(__file__).parents[2] / "configs" / "plants" / "cylinder_bem.nc"
FORCE_SENSOR = {
    "label": "load cell",
    "unit": "N",
    "range": [-8000, 8000],
    "tare": True,
    "age_limit_s": 0.1,
}


def change(path: Path, edit: Any) -> dict[str, Any]:
    """Edit a YAML file in place and return it."""
    yaml = YAML()
    mapping: dict[str, Any] = yaml.load(path)
    edit(mapping)
    with path.open("w") as stream:
        yaml.dump(mapping, stream)
    return mapping


def write_rig(folder: Path, *, sensor: bool) -> dict[str, Any]:
    """Write a heaving cylinder and its open-loop campaign; return the plant file."""
    done = rig_here("new", "rig", "cylinder", "--bem", BEM, "--dof", "Heave", "--folder", folder)
    assert done.returncode == 0, done.stdout

    def open_loop(campaign: dict[str, Any]) -> None:
        campaign["sea"] = {"kind": "calm"}
        campaign["reference"] = {
            "kind": "multisine", "repeat_s": 20, "amplitude_a": 3, "seed": 5, "axis": "heave",
        }  # fmt: skip
        campaign["matrix"] = {"list": [{"kp_n_s_per_m": 0, "ki_n_per_m": 0}]}
        campaign["timing"] = {"settle_s": 60, "periods": 2}
        campaign["start"] = {"lead_in_s": 5}

    def with_sensor(mapping: dict[str, Any]) -> None:
        mapping["sensors"]["pto_force"] = FORCE_SENSOR
        mapping["axes"]["heave"]["force_sensor"] = "pto_force"

    def with_signal(plant: dict[str, Any]) -> None:
        plant["sensors"]["pto_force"] = {"signal": "heave.motor_force", "noise": 1.0}

    change(folder / "cylinder" / "campaign.yaml", open_loop)
    if sensor:
        change(folder / "cylinder" / "rig.yaml", with_sensor)
    edit = with_signal if sensor else lambda plant: None
    return change(folder / "cylinder" / "plant.yaml", edit)


def impedance(plant: dict[str, Any], frequency: Any) -> Any:
    """Return Z_i (N*s/m) of the simulated body at frequencies (Hz), from its files."""
    body, bem = plant["modes"]["heave"], read_modes(BEM, ["Heave"])
    s = 2j * np.pi * frequency
    waves = radiation.total_response(radiation.fit(bem), s.imag)[:, 0, 0]
    mass = body["mass"] + bem.added_mass_infinite[0, 0]
    return mass * s + waves + body["linear_damping"] + body["stiffness"] / s


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("sensor", [False, True])
def test_the_impedance_is_that_of_the_plant(tmp_path: Path, *, sensor: bool) -> None:
    plant = write_rig(tmp_path, sensor=sensor)
    done = rig_here("run", tmp_path / "cylinder" / "campaign.yaml", "--runs", tmp_path, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    run = Path(json.loads(done.stdout)["folder"])
    (model,) = identify([run]).models
    assert (model.axis, model.frequency.size, model.periods) == ("heave", 17, 2)
    quotient = model.responses["Z_i"].value / impedance(plant, model.frequency)
    if sensor:
        assert set(model.responses) == {
            "Z_i", "Z_id", "Z_d", "Y_i", "Y_id_command", "Y_id_current"
        }  # fmt: skip
        assert np.abs(quotient - 1.0).max() < 0.002
    else:
        assert set(model.responses) == {"Z_i", "Y_i"}
        assert np.abs(quotient - 1.0).max() < 0.01
        # The motor's force is later than the command: 1 ms to the next tick, 1 / (2 pi 200 Hz) of
        # the current loop; half a tick less, because the force is constant over a tick.
        delay = np.angle(quotient) / (2.0 * np.pi * model.frequency)
        assert delay == pytest.approx(np.full(17, 1.3e-3), abs=1e-4)
    done = rig_here("identify", run, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    written = {path.name for path in run.iterdir()}
    assert written >= {"identification.json", "identification.pdf", "admittance_heave.png"}


def test_a_force_sensor_needs_the_unit_of_a_force(tmp_path: Path) -> None:
    write_rig(tmp_path, sensor=True)
    path = tmp_path / "cylinder" / "rig.yaml"
    load_model(path, RigFile)
    change(path, lambda rig: rig["axes"]["heave"].update(force_sensor="dc_power"))
    with pytest.raises(ConfigError) as caught:
        load_model(path, RigFile)
    (problem,) = caught.value.problems
    assert problem.key == "axes.heave.force_sensor"
    assert problem.message == "no sensor with the unit N; allowed pto_force"
