"""`rig plant from-bem`: plants of one to four modes, what they state, and what is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import mode_plants
import numpy as np
import pytest
import xarray
from command_here import CompletedCommand, rig
from matplotlib.image import imread
from mode_plants import CYLINDER, HEMISPHERE, WAVEBOT
from ruamel.yaml import YAML

from rig.kinds.modular.bem_picture import _impulse_response
from rig.kinds.modular.from_bem import PlantRequest, fit_plant, natural_period
from rig.kinds.modular.mode_choice import ModeOptions
from rig.kinds.modular.plant_checks import plant_findings
from rig.kinds.modular.rehearsal.devices import build_world
from rig.kinds.modular.rehearsal.job import campaign_settings
from rig.kinds.modular.simulation import plant_data
from rig.kinds.modular.tasks import examine
from sim_plant.modes import stored_radiation
from sim_plant.modes.bem import read_modes
from sim_plant.modes.building import build
from sim_plant.modes.parameters import Mode, Plant

THREE = ("--dof", "Surge", "--dof", "Heave", "--dof", "Pitch", "--stiffness", "Surge=5000")
LUPA = (
    "--dof", "float__Heave", "--dof", "spar__Heave", "--dof", "Surge", "--dof", "Pitch",
    "--mass", "float__Heave=248.7", "--mass", "spar__Heave=175.5", "--mass", "Surge=424.2",
    "--mass", "Pitch=320", "--stiffness", "float__Heave=7628", "--stiffness", "spar__Heave=330",
    "--stiffness", "Surge=3184", "--stiffness", "Pitch=1800", "--axis", "float__Heave",
)  # fmt: skip


def from_bem(folder: Path, bem: Path, *arguments: object) -> CompletedCommand:
    return rig("plant", "from-bem", bem, "--output", folder / "body.yaml", *arguments)


def load(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path)


def test_three_coupled_modes(tmp_path: Path) -> None:
    done = from_bem(tmp_path, CYLINDER, *THREE, "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    names = ["body.yaml", "body.radiation.json", "body.png", "cylinder_bem.nc"]
    assert [Path(name).name for name in report["written"]] == names
    assert report["phase"] == "e^{-i omega t}"
    assert (report["density"], report["gravity"], report["depth"]) == (1000.0, 9.81, None)
    assert [mode["dof"] for mode in report["modes"]] == ["Surge", "Heave", "Pitch"]
    assert max(term["error"] for term in report["terms"]) <= 0.01
    assert report["damping_margin"] >= 0.0
    assert report["fit_seconds"] < 20.0
    heave = report["modes"][1]
    bem = read_modes(CYLINDER)
    assert heave["stiffness_source"] == "hydrostatic, of the BEM file"
    # The period with the added mass there: omega^2 (m + A(omega)) = K.
    omega = 2.0 * np.pi / heave["natural_period_s"]
    added = np.interp(omega / 2.0 / np.pi, bem.frequency, bem.added_mass[:, 1, 1])
    assert omega**2 * (heave["mass"] + added) == pytest.approx(heave["stiffness"], rel=1e-9)
    # Haskind's relation of an axisymmetric body in heave, in deep water: B = omega^3 |X|^2 /
    # (2 rho g^3). The mesh of the file keeps it within 2.4 %.
    force = np.interp(omega / 2.0 / np.pi, bem.frequency, np.abs(bem.excitation[:, 1]))
    assert heave["damping_at_resonance"] == pytest.approx(
        omega**3 * force**2 / (2.0 * 1000.0 * 9.81**3), rel=0.03
    )
    assert heave["added_mass_at_resonance"] == pytest.approx(added, rel=1e-6)
    plant = Plant.model_validate(load(tmp_path / "body.yaml"))
    assert plant.radiation == "body.radiation.json"
    assert list(plant.axes) == ["surge", "heave", "pitch"]
    picture = imread(tmp_path / "body.png")
    assert picture.shape[0] > 800
    assert picture.std() > 0.05  # not empty


def test_the_stored_fit_is_that_of_a_new_one(tmp_path: Path) -> None:
    """To the bit; so a plant with the file moves as one that fits at each load."""
    assert from_bem(tmp_path, CYLINDER, *THREE).returncode == 0
    plant = Plant.model_validate(load(tmp_path / "body.yaml"))
    stored = build(plant, tmp_path / plant.bem, tmp_path / str(plant.radiation))
    fitted = build(plant, tmp_path / plant.bem)
    assert stored.params == fitted.params


def test_four_modes_with_one_pto(tmp_path: Path) -> None:
    lupa = mode_plants.lupa(tmp_path / "lupa.nc")
    done = from_bem(tmp_path, lupa, *LUPA)
    assert done.returncode == 0, done.stderr
    assert "4 modes" not in done.stdout
    assert "spar__Heave, spar__Heave" in done.stdout
    assert "warning: float__Heave: the fit needs an A_inf of 103" in done.stdout
    assert "the file scatters by more than further states would gain" in done.stdout
    plant = load(tmp_path / "body.yaml")
    assert list(plant["modes"]) == ["float_heave", "spar_heave", "surge", "pitch"]
    assert list(plant["axes"]) == ["float_heave"]
    assert {name: sensor["signal"] for name, sensor in plant["sensors"].items()} == {
        "dc_power": "float_heave.electric_power",
        "load_cell": "float_heave.force",
    }
    assert plant["bem"] == "lupa.nc"
    assert sorted(path.name for path in tmp_path.glob("*.nc")) == ["lupa.nc"]


def test_scaling_and_phases_of_a_file_are_stated(tmp_path: Path) -> None:
    water = ("--density", 1000, "--gravity", 9.81, "--depth", "inf", "--length-scale", 2)
    done = from_bem(tmp_path, mode_plants.NUMERIC, "--dof", "Heave", "--mass", 3136,
                    "--stiffness", 8000, *water)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "normalised by density, gravity and a length of 2 m in the file" in done.stdout
    assert "e^{+i omega t} in the file, conjugated to e^{-i omega t} for the plant" in done.stdout
    plant = load(tmp_path / "body.yaml")
    assert (plant["depth_m"], plant["length_scale_m"]) == (20_000, 2)
    assert sorted(path.name for path in tmp_path.glob("cylinder*")) == ["cylinder.1", "cylinder.3"]


def test_a_single_mode_needs_no_name(tmp_path: Path) -> None:
    done = from_bem(tmp_path, WAVEBOT, "--mass", "700", "--stiffness", "24337")
    assert done.returncode == 0, done.stderr
    assert "modes.heave.mass: 700 kg, but the body displaces 0.8" in done.stdout
    assert "irregular frequencies are left out of the fit: 1.669" in done.stdout
    mode = load(tmp_path / "body.yaml")["modes"]["heave"]
    assert (mode["mass"], mode["stiffness"]) == (700, 24337)


def test_the_folder_of_a_nemoh_run_is_copied_with_its_parts(tmp_path: Path) -> None:
    done = from_bem(tmp_path, HEMISPHERE.parent, "--dof", "Heave")
    assert done.returncode == 0, done.stderr
    assert "(Nemoh)" in done.stdout
    assert "held fixed   Surge, Sway, Roll, Pitch, Yaw" in done.stdout
    bem = tmp_path / load(tmp_path / "body.yaml")["bem"]
    assert read_modes(bem, ["Heave"]).modes == ("Heave",)


def test_the_impulse_response_is_that_of_the_state_space() -> None:
    """The picture's closed form against the equations z' = D z + C z' + I v, v a unit impulse."""
    dofs = ("Surge", "Heave", "Pitch")
    options = ModeOptions(CYLINDER, dofs, stiffnesses=("Surge=1",))
    fitted = fit_plant(PlantRequest(options, Path("x.yaml")))
    memory, dt = fitted.model.radiation, 1.0e-4
    times = np.arange(4000) * dt
    kernel = _impulse_response(fitted, times)
    for mode in range(3):
        state = np.where(np.array(memory.source) == mode, memory.input, 0.0)
        for k in range(times.size):
            if k % 1000 == 0:
                expected = memory.output @ state
                np.testing.assert_allclose(kernel[k, :, mode], expected, rtol=2e-3, atol=2.0)
            half = state + 0.5 * dt * (memory.diagonal * state
                                       + memory.cross * state[list(memory.partner)])  # fmt: skip
            state = state + dt * (
                memory.diagonal * half + memory.cross * half[list(memory.partner)]
            )


def several_of_all(folder: Path) -> Path:
    """Write a file with several modes, directions and depths, without mass and stiffness."""
    data = mode_plants.dataset().drop_vars(["inertia_matrix", "hydrostatic_stiffness"])
    other = data.assign_coords(wave_direction=[np.pi / 2.0])
    data = xarray.concat([data, other], "wave_direction", data_vars="minimal", coords="minimal",
                         compat="override", join="outer")  # fmt: skip
    deep = data.drop_vars("water_depth").expand_dims(water_depth=[5.0, np.inf])
    return mode_plants.saved(folder / "several.nc", deep)


def test_all_that_is_open_is_refused_at_once(tmp_path: Path) -> None:
    bem = several_of_all(tmp_path)
    done = from_bem(tmp_path, bem)
    assert done.returncode == 2
    for reason in (
        "has several modes: Surge, Heave, Pitch; choose some with --dof",
        "has several values of water_depth (5.0, inf); choose one with --depth",
        "has several wave directions: 0, 90 degrees; choose one with --direction",
    ):
        assert f"several.nc: {reason}" in done.stderr
    done = from_bem(tmp_path, bem, "--dof", "Heave", "--dof", "Pitch", "--depth", 5)
    for reason in (
        "several wave directions",
        "does not state the mass of Heave: give --mass Heave=... (kg)",
        "does not state the mass of Pitch: give --mass Pitch=... (kg*m2)",
        "states no stiffness of Heave: give --stiffness Heave=... (N/m)",
    ):
        assert reason in done.stderr
    assert "water_depth" not in done.stderr
    assert list(tmp_path.glob("body*")) == []


@pytest.mark.parametrize(
    ("arguments", "reasons"),
    [
        (("--dof", "heave"), ["has no mode 'heave'; it has Surge, Heave, Pitch"]),
        (("--dof", "Heave", "--dof", "Heave"), ["--dof Heave is given twice"]),
        (("--dof", "Surge"), ["states no stiffness of Surge: give --stiffness Surge=..."]),
        (
            ("--dof", "Heave", "--axis", "Pitch", "--mass", "Pitch=3", "--stiffness", "Heave=soft"),
            [
                "--axis Pitch: expected NAME=MODES, a sum or difference of Heave, such as",
                "--mass Pitch=3: expected MODE=NUMBER with a mode of Heave",
                "--stiffness Heave=soft: expected MODE=NUMBER",
            ],
        ),
        (("--dof", "Heave", "--dof", "Pitch", "--mass", "3"), ["--mass 3: expected MODE=NUMBER"]),
        (("--dof", "Heave", "--mass", "-3"), ["--mass Heave=-3: allowed above 0"]),
        (
            ("--dof", "Heave", "--mass", "Heave=1", "--mass", "Heave=2"),
            ["--mass of Heave is given twice"],
        ),
        (("--dof", "Heave", "--density", "1025"), ["states density_kg_per_m3 1000 kg/m3"]),
        (("--dof", "Heave", "--direction", "45"), ["no wave direction of 45 degrees; it has 0"]),
    ],
)
def test_wrong_options_are_refused(
    arguments: tuple[str, ...], reasons: list[str], tmp_path: Path
) -> None:
    done = from_bem(tmp_path, CYLINDER, *arguments)
    assert done.returncode == 2
    assert [reason for reason in reasons if reason not in done.stderr] == []
    assert list(tmp_path.iterdir()) == []


def test_a_coupled_inertia_is_refused(tmp_path: Path) -> None:
    data = mode_plants.dataset()
    data["inertia_matrix"] = data.inertia_matrix.copy(deep=True)
    data.inertia_matrix.loc[{"influenced_dof": "Surge", "radiating_dof": "Pitch"}] = 900.0
    bem = mode_plants.saved(tmp_path / "coupled.nc", data)
    done = from_bem(tmp_path, bem, *THREE)
    assert done.returncode == 2
    assert "couples Surge and Pitch by a mass of 900, which a plant has not" in done.stderr
    given = ("--mass", "Surge=3136", "--mass", "Pitch=1079")
    assert from_bem(tmp_path, bem, *THREE, *given).returncode == 0


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    assert from_bem(tmp_path, CYLINDER, *THREE).returncode == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    done = from_bem(tmp_path, CYLINDER, *THREE)
    assert done.returncode == 2
    assert done.stderr.count("exists; nothing is overwritten") == 3
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    bem = tmp_path / CYLINDER.name
    bem.write_bytes(b"another file")
    done = rig("plant", "from-bem", CYLINDER, *THREE, "--output", tmp_path / "second.yaml")
    assert done.returncode == 2
    assert f"{bem}: exists; nothing is overwritten" in done.stderr


# The plant in a rig.
def rig_folder(folder: Path) -> Path:
    """Write a rig in heave with the plant of the command, and return its folder."""
    written = rig("new", "rig", "buoy", "--bem", CYLINDER, "--dof", "Heave", "--folder", folder)
    assert written.returncode == 0, written.stderr
    buoy = folder / "buoy"
    (buoy / "plant.yaml").unlink()
    done = rig("plant", "from-bem", buoy / CYLINDER.name, "--dof", "Heave", "--output",
               buoy / "plant.yaml")  # fmt: skip
    assert done.returncode == 0, done.stderr
    return buoy


def change(path: Path, edit: Any) -> None:
    content = load(path)
    edit(content)
    with path.open("w") as file:
        YAML(typ="safe", pure=True).dump(content, file)


def test_both_commands_write_one_plant(tmp_path: Path) -> None:
    """But for the stored fit: modes, PTOs and sensors have the same first numbers."""
    buoy = rig_folder(tmp_path)
    written = rig("new", "rig", "other", "--bem", CYLINDER, "--dof", "Heave", "--folder", tmp_path)
    assert written.returncode == 0
    other, own = load(tmp_path / "other" / "plant.yaml"), load(buoy / "plant.yaml")
    assert own.pop("radiation") == "plant.radiation.json"
    assert {**own, "name": "other"} == other


def test_scales_of_plant_and_rig_must_agree(tmp_path: Path) -> None:
    buoy = rig_folder(tmp_path)
    done = rig("check", buoy / "campaign.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stdout
    change(buoy / "plant.yaml", lambda plant: plant["axes"]["heave"].update(gear_ratio=12.0))
    done = rig("check", buoy / "campaign.yaml")
    assert done.returncode == 2
    assert "axes.heave.gear_ratio_rad_per_m" in done.stdout + done.stderr
    assert "is not the plant's" in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("section", "name", "edit", "message"),
    [
        ("modes", "dof", {"dof": "heave"},
         "modes.heave.dof: 'heave' is no mode of cylinder_bem.nc; it has Surge, Heave, Pitch"),
        ("axes", "sway", {"moves_with": {"sway": 1.0}},
         "axes.heave.moves_with.sway: 'sway' is no mode; allowed: heave"),
    ],
)  # fmt: skip
def test_a_wrong_name_is_reported_at_its_line(
    section: str, name: str, edit: dict[str, Any], message: str, tmp_path: Path
) -> None:
    buoy = rig_folder(tmp_path)
    change(buoy / "plant.yaml", lambda plant: plant[section]["heave"].update(edit))
    lines = (buoy / "plant.yaml").read_text().splitlines()
    place = next(k for k, line in enumerate(lines, 1) if re.search(rf"\b{name}:", line))
    done = rig("check", buoy / "campaign.yaml")
    assert done.returncode == 2
    assert f"plant.yaml:{place}: {message}" in done.stdout + done.stderr


def test_contradictions_are_warnings_of_the_check(tmp_path: Path) -> None:
    buoy = rig_folder(tmp_path)
    data = mode_plants.dataset().assign(displaced_volume=3.1359)
    mode_plants.saved(buoy / CYLINDER.name, data)
    wrong = {"mass": 2000.0, "stiffness": 25_000.0}
    change(buoy / "plant.yaml", lambda plant: plant["modes"]["heave"].update(wrong))
    done = rig("check", buoy / "campaign.yaml", "--json")
    warnings = {each["key"]: each for each in json.loads(done.stdout)["warnings"]}
    mass, stiffness = warnings["modes.heave.mass"], warnings["modes.heave.stiffness"]
    assert (mass["value"], stiffness["value"]) == (2000.0, 25_000.0)
    assert Path(mass["file"]).name == "plant.yaml"
    assert "the body displaces 3.136 m3 = 3136 kg" in mass["message"]
    assert "without another force 2979 .. 3293 kg" in mass["message"]
    assert "but the BEM file states 30763 N/m" in stiffness["message"]


@pytest.mark.parametrize(
    ("dof", "mass", "text"),
    [
        ("Heave", 3.135, "3.135 kg, but the BEM file states 3135.9 kg"),  # tonnes
        ("Heave", 2800.0, "2800 kg, but the BEM file states 3135.9 kg"),
        ("Heave", 3100.0, ""),
        ("Pitch", 1000.0, "1000 kg*m2, but the BEM file states 1079"),
    ],
)
def test_a_mass_unlike_the_inertia_of_the_file_is_a_finding(
    dof: str, mass: float, text: str
) -> None:
    """The file of the cylinder states the inertia, but no volume."""
    bem = read_modes(CYLINDER, [dof])
    assert bem.volume == (None,)
    mode = {"dof": dof, "mass": mass}
    weight = {"mass": 100.0, "stiffness": 0.0}  # out of the water, before the body
    modes = {"weight": Mode.model_validate(weight), "body": Mode.model_validate(mode)}
    plant = Plant.model_construct(modes=modes)
    found = [(key, message) for key, _, message in plant_findings(plant, bem)]
    if not text:
        assert found == []
        return
    ((key, message),) = found
    assert key == ("modes", "body", "mass")
    assert message.startswith(text)
    assert message.endswith("(inertia_matrix of the BEM file)")


def test_a_mass_in_tonnes_is_a_warning_of_the_check(tmp_path: Path) -> None:
    written = rig("new", "rig", "buoy", "--bem", CYLINDER, "--dof", "Heave", "--folder", tmp_path)
    assert written.returncode == 0, written.stderr
    change(
        tmp_path / "buoy" / "plant.yaml",
        lambda plant: plant["modes"]["heave"].update(mass=3.135),
    )
    done = rig("check", tmp_path / "buoy" / "campaign.yaml")
    assert "3.135 kg, but the BEM file states 3135.9 kg" in done.stdout + done.stderr


def test_the_period_has_the_added_mass_there() -> None:
    """A line between two frequencies: K = omega^2 (m + a + b omega), solved as a cubic."""
    bem = read_modes(CYLINDER, ["Pitch"])
    assert bem.stiffness is not None
    assert bem.inertia is not None
    mass, stiffness = float(bem.inertia[0, 0]), float(bem.stiffness[0, 0])
    period = natural_period(bem, 0, mass, stiffness)
    assert period is not None
    k = int(np.searchsorted(bem.frequency, 1.0 / period)) - 1
    omega, added = 2.0 * np.pi * bem.frequency[k : k + 2], bem.added_mass[k : k + 2, 0, 0]
    slope = float(np.diff(added)[0] / np.diff(omega)[0])
    roots = np.roots([slope, mass + added[0] - slope * omega[0], 0.0, -stiffness])
    (inside,) = [r.real for r in roots if abs(r.imag) < 1e-12 and omega[0] <= r.real <= omega[1]]
    assert period == pytest.approx(2.0 * np.pi / inside, rel=1e-9)


def test_waves_beyond_the_bem_file_are_refused_or_a_warning(tmp_path: Path) -> None:
    """The file ends at 1.5 Hz: a regular wave of 1.6 Hz would excite nothing."""
    buoy = rig_folder(tmp_path)
    campaign = buoy / "campaign.yaml"
    change(campaign, lambda given: given["sea"].update(frequency_hz=1.6))
    done = rig("check", campaign)
    assert done.returncode == 2
    reason = "sea: 100.0% of the variance of the waves is beyond the BEM file: allowed 0.025 .. 1.5"
    assert reason in done.stdout + done.stderr
    sea = {"kind": "jonswap", "hs_m": 0.05, "tp_s": 1.0, "gamma": 1, "repeat_s": 50}
    timing = {"settle_s": 20, "interval_s": 80}
    change(campaign, lambda given: given.update(sea=sea, timing=timing))
    done = rig("check", campaign, "--json")
    assert done.returncode == 0, done.stdout
    (warning,) = json.loads(done.stdout)["warnings"]
    assert warning["key"] == "sea"
    # Of a Pierson-Moskowitz sea, exp(-1.25 (f_p / f)^4) of the variance is below f.
    below_two, below_end = (np.exp(-1.25 / f**4) for f in (2.0, 1.5))
    expected = (below_two - below_end) / below_two
    assert warning["value"] == pytest.approx(expected, rel=0.2)  # components to 2 Hz


def test_a_stale_fit_is_refused(tmp_path: Path) -> None:
    buoy = rig_folder(tmp_path)
    data = mode_plants.dataset()
    mode_plants.saved(buoy / CYLINDER.name, data.assign(added_mass=1.01 * data.added_mass))
    done = rig("check", buoy / "campaign.yaml")
    assert done.returncode == 2
    assert "radiation: cannot be used" in done.stdout + done.stderr
    assert "is stale: it was fitted to other coefficients" in done.stdout + done.stderr
    change(buoy / "plant.yaml", lambda plant: plant.pop("radiation"))
    assert rig("check", buoy / "campaign.yaml").returncode == 0


def test_a_rehearsal_loads_the_stored_fit(tmp_path: Path) -> None:
    """The world of the devices has its very numbers, in a folder that was moved, too."""
    buoy = rig_folder(tmp_path)
    moved = buoy.rename(tmp_path / "moved")
    report = examine(moved / "campaign.yaml")
    assert report.campaign is not None, report.text()
    settings = campaign_settings(report.campaign) | {"compiled": False}
    assert settings["radiation"] == str(moved / "plant.radiation.json")
    world = build_world(settings, 1e-3)
    stored = json.loads((moved / "plant.radiation.json").read_text())
    assert world.model.params.diagonal == stored["diagonal"]
    roles = [file.role for file in plant_data(report.campaign)]
    assert roles == ["bem", "radiation"]  # what the result cache of sweeps depends on


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda given: given.update(format="x"), "is no file of a fitted radiation"),
        (lambda given: given.pop("output"), "is damaged: 'output'"),
        (lambda given: given["cross"].pop(), r"cross has the shape \(\d+,\), expected"),
        (lambda given: given.update(diagonal=[1.0] * len(given["source"])), "not stable"),
        (lambda given: given.update(output=[[-x for x in row] for row in given["output"]]),
         "not stable and passive"),
        (lambda given: given.update(source=[3] * len(given["source"])), "source must be"),
    ],
)  # fmt: skip
def test_a_damaged_fit_is_refused(tmp_path: Path, edit: Any, message: str) -> None:
    request = PlantRequest(ModeOptions(CYLINDER, ("Heave",)), tmp_path / "x.yaml")
    fitted = fit_plant(request)
    given = json.loads(stored_radiation.to_text(fitted.bem, fitted.model.radiation))
    edit(given)
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(given))
    with pytest.raises(ValueError, match=f"fit.json: .*{message}"):
        stored_radiation.read(path, fitted.bem)


def off_centre(folder: Path) -> Path:
    """Return the cylinder with its centre of mass 0.15 m below the axis of its pitch."""
    changed = mode_plants.dataset().assign(center_of_mass=("space_coordinate", [0.0, 0.0, -0.45]))
    return mode_plants.saved(folder / "off_centre.nc", changed)


CENTRES = "Pitch turns about (0, 0, -0.3) m, but the centre of mass is (0, 0, -0.45) m"


def test_a_rotation_off_the_centre_of_mass_with_the_translation_it_couples_is_refused(
    tmp_path: Path,
) -> None:
    bem = off_centre(tmp_path)
    done = from_bem(tmp_path, bem, *THREE)
    assert done.returncode == 2
    assert (
        f"{CENTRES}: that couples Surge and Pitch by a mass, which a plant has not" in done.stderr
    )
    assert "couples Heave" not in done.stderr  # the centre of mass is below the axis
    given = ("--mass", "Surge=3135", "--mass", "Pitch=1500")
    assert from_bem(tmp_path, bem, *THREE, *given).returncode == 0


def test_a_rotation_alone_off_the_centre_of_mass_is_a_warning(tmp_path: Path) -> None:
    done = from_bem(tmp_path, off_centre(tmp_path), "--dof", "Pitch", "--stiffness", 20000)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"warning: modes.pitch.mass: .* kg.m2: {re.escape(CENTRES)}", done.stdout)
