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
from rig.identification.experiments import read_experiments
from rig.identification.identify import identify
from rig.identification.impedances import models
from rig.kinds.modular.config import RigFile
from sim_plant.modes import radiation
from sim_plant.modes.bem import read_modes

BEM = Path(__file__).parents[2] / "configs" / "plants" / "cylinder_bem.nc"
MULTISINE = {"kind": "multisine", "repeat_s": 20, "amplitude_a": 3, "seed": 5}
WEAK = MULTISINE | {"amplitude_a": 0.8}  # pitch moves a few counts
PROFILE = {
    "kind": "profile",
    "repeat_s": 20,
    "amplitude_a": 3,
    "points": [[0, 1], [10, 1], [10, 0]],
}


def change(path: Path, edit: Any) -> dict[str, Any]:
    """Edit a YAML file in place and return it."""
    yaml = YAML()
    mapping: dict[str, Any] = yaml.load(path)
    edit(mapping)
    with path.open("w") as stream:
        yaml.dump(mapping, stream)
    return mapping


def write_rig(
    folder: Path,
    *without: str,
    dof: str = "Heave",
    reference: dict[str, Any] = MULTISINE,
    realisations: int = 1,
) -> dict[str, Any]:
    """Write a cylinder with one axis and its open-loop campaign; return the plant file.

    ``without``: keys that the axis of the rig file does not have. ``realisations``: rows. Pitch has
    a damping in which its free motion decays in 60 s.
    """
    done = rig_here("new", "rig", "cylinder", "--bem", BEM, "--dof", dof, "--folder", folder)
    assert done.returncode == 0, done.stdout

    def open_loop(campaign: dict[str, Any]) -> None:
        (grid,) = campaign["matrix"]["grid"]
        campaign["sea"] = {"kind": "calm"}
        campaign["reference"] = reference | {"axis": dof.lower()}
        rows = range(1, realisations + 1)
        campaign["matrix"] = {"list": [dict.fromkeys(grid, 0) | {"realisation": k} for k in rows]}
        campaign["timing"] = {"settle_s": 60, "periods": 2}
        campaign["start"] = {"lead_in_s": 5}

    def remove_keys(mapping: dict[str, Any]) -> None:
        for key in without:
            del mapping["axes"][dof.lower()][key]

    change(folder / "cylinder" / "campaign.yaml", open_loop)
    change(folder / "cylinder" / "rig.yaml", remove_keys)

    def decay(plant: dict[str, Any]) -> None:
        if dof == "Pitch":
            plant["modes"]["pitch"]["linear_damping"] = 600

    return change(folder / "cylinder" / "plant.yaml", decay)


def measure(folder: Path) -> Path:
    """Run the campaign of `write_rig`, and return the run."""
    done = rig_here("run", folder / "cylinder" / "campaign.yaml", "--runs", folder, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    return Path(json.loads(done.stdout)["folder"])


def impedance(plant: dict[str, Any], frequency: Any, dof: str = "Heave") -> Any:
    """Return Z_i (N*s/m) of the simulated body at frequencies (Hz), from its files."""
    body, bem = plant["modes"][dof.lower()], read_modes(BEM, [dof])
    s = 2j * np.pi * frequency
    fitted = radiation.fit(bem)
    waves = radiation.total_response(fitted, s.imag)[:, 0, 0]
    mass = body["mass"] + bem.added_mass_infinite[0, 0]
    return mass * s + waves + body["linear_damping"] + body["stiffness"] / s


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(
    "without", [(), ("force_sensor",), ("force_sensor", "current_bandwidth_hz")]
)
def test_the_impedance_is_that_of_the_plant(tmp_path: Path, without: tuple[str, ...]) -> None:
    """Also its real part, of which a delay of 1.3 ms would change several percent."""
    plant = write_rig(tmp_path, *without)
    run = measure(tmp_path)
    (model,) = (found := identify([run])).models
    assert (model.axis, model.frequency.size, model.periods) == ("heave", 17, 2)
    response, expected = model.responses["Z_i"], impedance(plant, model.frequency)
    error = response.value - expected
    delay = np.angle(response.value / expected)[6:] / model.omega[6:]  # less noise up there
    if without:
        assert set(model.responses) == {"Z_i", "Y_i"}
        assert "is the command" in found.notes[0]
        assert (
            np.abs(error) <= response.band
        ).all()  # that contain the difference from the current
    else:
        assert set(model.responses) == {
            "Z_i", "Z_id", "Z_d", "Y_i", "Y_id_command", "Y_id_current"
        }  # fmt: skip
        assert found.notes == ()
    if "current_bandwidth_hz" in without:
        # 1 / (2 pi 200 Hz) is not known, and the band has to contain it.
        assert delay == pytest.approx(np.full(11, 0.8e-3), abs=5e-5)
    else:
        assert delay == pytest.approx(np.zeros(11), abs=5e-5)
        assert np.abs(error / expected).max() < 0.002
        assert np.abs(error.real / expected.real).max() < 0.02
        assert np.abs(response.noise / expected).max() < 0.005


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(("dof", "reference"), [("Heave", MULTISINE), ("Pitch", WEAK)])
def test_bands_contain_the_impedance(tmp_path: Path, dof: str, reference: dict[str, Any]) -> None:
    """In 90 .. 99 % of 204 lines of 12 rows, each a model: 95 % of them scatter by 1.5 %.

    Pitch moves a few counts a line, and each period is rounded to the same ones.
    """
    plant = write_rig(tmp_path, dof=dof, reference=reference, realisations=12)
    within, by_periods = [], []
    for experiment in read_experiments(measure(tmp_path)).experiments:
        (model,) = models([experiment])
        found = model.responses["Z_i"]
        error = np.abs(found.value - impedance(plant, model.frequency, dof))
        within.append(error <= found.band)
        by_periods.append(error <= found.noise)
    assert np.size(within) == 204
    assert 0.9 <= np.mean(within) <= 0.99
    if dof == "Pitch":
        # The scatter of periods has little of it: 30 % of the lines, with the gear of a new rig.
        assert np.mean(by_periods) < 0.4


@pytest.mark.slow
@pytest.mark.sampled
def test_a_bem_file_is_compared_with_the_impedance(tmp_path: Path) -> None:
    """The simulated body has a viscous damping, which a BEM file lacks."""
    plant = write_rig(tmp_path)
    run = measure(tmp_path)
    done = rig_here("identify", run, "--bem", BEM, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    written = {path.name for path in run.iterdir()}
    assert written >= {"identification.json", "identification.pdf", "admittance_heave.png"}
    (model,) = json.loads(done.stdout)["models"]
    found, damping = model["bem"], plant["modes"]["heave"]["linear_damping"]
    assert (found["file"], found["mode"], found["response"]) == ("cylinder_bem.nc", "Heave", "Z_i")
    assert found["median_re_difference"] == pytest.approx(damping, rel=0.05)
    reactance = np.array(model["responses"]["Z_i"]["im"])
    assert np.abs(reactance - found["im"]).max() < 0.01 * np.abs(reactance).max()
    (fitted,) = model["fits"]["Z_i"]
    assert fitted["intervals_95"]["mass_kg"] > 0.0
    done = rig_here("identify", run, "--order", 4, "--no-pictures")
    assert "Z_i: M and B of orders 2 and 4 differ by more than their intervals" in done.stdout
    done = rig_here("identify", run, "--bem", BEM.with_name("wavebot_bem.nc"))
    assert done.returncode == 2
    assert "states no hydrostatic stiffness of Heave, so it gives no impedance" in done.stderr


@pytest.mark.slow
@pytest.mark.sampled
def test_an_axis_that_rotates_has_its_units(tmp_path: Path) -> None:
    plant = write_rig(tmp_path, dof="Pitch", reference=WEAK)
    run = measure(tmp_path)
    (model,) = identify([run]).models
    response, expected = model.responses["Z_i"], impedance(plant, model.frequency, "Pitch")
    error = np.abs(response.value - expected)
    assert (error / np.abs(expected)).max() < 0.01
    done = rig_here("identify", run, "--no-pictures")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "M kg·m²  B N·m·s/rad  K N·m/rad" in done.stdout
    (entry,) = json.loads((run / "identification.json").read_text())["models"]
    assert entry["responses"]["Z_i"]["unit"] == "N*m*s/rad"
    assert {"spring_n_m_per_rad", "peak_n_m"} <= entry.keys()
    assert "mass_kg_m2" in entry["fits"]["Z_i"][0]
    assert (
        f"mass {entry['fits']['Z_i'][0]['mass_kg_m2']:.0f}±"
        in rig_here("identify", "--compare", run, run, "--no-pictures").stdout
    )
    done = rig_here("identify", "--compare", run, run, "--json")
    assert json.loads(done.stdout)["differences"][0]["worst"] < 1e-12


@pytest.mark.slow
@pytest.mark.sampled
def test_a_profile_gives_no_model(tmp_path: Path) -> None:
    """As the force of a decay test: 90 % of its energy is in its first line."""
    write_rig(tmp_path, reference=PROFILE)
    run = measure(tmp_path)
    assert "excites too few lines for an impedance" in (run / "summary.txt").read_text()
    found = identify([run])
    assert found.fits == ({},)
    assert any("lines carry the energy of the reference" in note for note in found.notes)


def test_a_force_sensor_needs_the_unit_of_a_force(tmp_path: Path) -> None:
    write_rig(tmp_path)
    path = tmp_path / "cylinder" / "rig.yaml"
    load_model(path, RigFile)
    change(path, lambda rig: rig["axes"]["heave"].update(force_sensor="dc_power"))
    with pytest.raises(ConfigError) as caught:
        load_model(path, RigFile)
    (problem,) = caught.value.problems
    assert problem.key == "axes.heave.force_sensor"
    assert problem.message == "no sensor with the unit N; allowed load_cell"


def test_a_station_by_command_says_so(tmp_path: Path) -> None:
    """The rig that the program writes has one by sensor; a label of one's own is completed."""
    write_rig(tmp_path)
    path = tmp_path / "cylinder" / "rig.yaml"
    found = [station.label for station in load_model(path, RigFile)[0].power_stations]
    assert found == ["absorbed by load cell", "mechanical by command", "electrical DC"]
    change(path, lambda rig: rig["stations"]["mechanical"].update(label="mechanical"))
    station = load_model(path, RigFile)[0].power_stations[1]
    assert station.label == "mechanical (by command)"
