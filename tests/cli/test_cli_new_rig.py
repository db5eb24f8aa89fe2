"""`rig new rig`: files derived from a BEM file, against linear theory; and what it refuses."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from command_here import CompletedCommand, rig
from ruamel.yaml import YAML
from typer.testing import CliRunner

from benchmarks.support.free_port import free_port
from rig.cli.app import app
from rig.kinds.modular.config import LimitsFile, RigFile
from rig.kinds.modular.first_values import FirstValues, first_values
from rig.kinds.modular.mode_choice import ChosenModes, ModeOptions, choose_modes
from rig.kinds.modular.tasks import examine, wired_mode
from sim_plant.modes.bem import read_modes
from sim_plant.modes.building import build
from sim_plant.modes.parameters import Plant
from sim_plant.modes.world import Actuation, World
from sim_plant.sea_states import regular

WAVEBOT = Path(__file__).resolve().parents[2] / "configs" / "plants" / "wavebot_bem.nc"
CYLINDER = WAVEBOT.with_name("cylinder_bem.nc")
WAMIT = Path(__file__).resolve().parents[1] / "modes" / "cylinder.1"
STIFFNESS = 24_337.0  # N/m
MODES = ["Surge", "Heave", "Pitch"]
OMEGA = np.linspace(0.5, 12.0, 40)  # rad/s


def write_bem(folder: Path, scale: float = 1.0, **changed: Any) -> Path:
    """Write a file as capytaine's, of three uncoupled modes; `scale` enlarges all forces."""
    bell = np.exp(-(((OMEGA - 4.0) / 2.0) ** 2))[:, None, None]
    diagonal, matrix = np.eye(3) * scale, ("omega", "influenced_dof", "radiating_dof")
    force = np.sqrt(np.exp(-OMEGA)[:, None, None]) * np.ones((1, 1, 3)) * 5000.0 * scale
    fields = {
        "added_mass": (matrix, (300.0 + 100.0 * bell) * diagonal),
        "radiation_damping": (matrix, 200.0 * bell * diagonal),
        "excitation_force": (
            ("complex", "omega", "wave_direction", "influenced_dof"),
            np.stack([force, 0.0 * force]),
        ),
        "hydrostatic_stiffness": (matrix[1:], np.diag([0.0, 9000.0, 4000.0]) * scale),
        "inertia_matrix": (matrix[1:], np.diag([500.0, 500.0, 120.0]) * scale),
    }
    coordinates = {
        "omega": OMEGA, "influenced_dof": MODES, "radiating_dof": MODES, "complex": ["re", "im"],
        "wave_direction": [0.0], "rho": 1000.0, "g": 9.81, "water_depth": np.inf,
    }  # fmt: skip
    fields = {name: value for name, value in (fields | changed).items() if value is not None}
    path = folder / "body.nc"
    xarray.Dataset(fields, coordinates).to_netcdf(path, engine="h5netcdf")
    return path


def new(folder: Path, *arguments: object) -> CompletedCommand:
    return rig("new", "rig", "buoy", "--folder", folder, *arguments)


def load(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path)


def wavebot(folder: Path) -> dict[str, Any]:
    """Return the files of a rig in heave with the WaveBot's hull."""
    done = new(folder, "--bem", WAVEBOT, "--stiffness", STIFFNESS, "--json")
    assert done.returncode == 0, done.stdout
    written = [Path(name) for name in json.loads(done.stdout)["written"]]
    assert {path.parent for path in written} == {folder / "buoy"}
    return {path.stem: load(path) for path in written if path.suffix == ".yaml"}


def chosen() -> ChosenModes:
    return choose_modes(ModeOptions(WAVEBOT, stiffnesses=(str(STIFFNESS),)))


def expected_values(amplitude: float | None = None) -> FirstValues:
    return first_values(chosen(), amplitude=amplitude)


def test_body_is_that_of_the_file() -> None:
    values, (body,) = expected_values(), chosen().modes
    with xarray.open_dataset(WAVEBOT, engine="h5netcdf") as data:
        mass = 1000.0 * float(data["displaced_volume"])
    assert body.mass == pytest.approx(mass, rel=1e-5)  # six digits
    modes, omega, frequency = read_modes(WAVEBOT), values.omega, values.linear.frequency
    added = np.interp(frequency, modes.frequency, modes.added_mass[:, 0, 0])
    damping = np.interp(frequency, modes.frequency, modes.damping[:, 0, 0]) + body.damping
    expected = damping + 1j * (omega * (mass + added) - STIFFNESS / omega)
    assert values.linear.impedance[0, 0] == pytest.approx(expected, rel=1e-5)
    assert values.linear.wave_number == pytest.approx(omega**2 / 9.81, rel=1e-3)
    assert 0.7 < omega / np.sqrt(STIFFNESS / (mass + added)) < 0.8  # below its resonance


def test_gains_are_around_the_greatest_power_of_linear_theory() -> None:
    """P = |Fe|^2 / 8 R at the match, which a brute-force search finds, too."""
    values = expected_values(0.1)
    omega, grid = values.omega, values.axes["heave"]
    impedance, excitation = values.linear.impedance[0, 0], abs(values.linear.excitation[0])
    kp, ki = np.meshgrid(np.linspace(-9000, -200, 441), np.linspace(-20_000, 20_000, 401))
    speed = excitation / np.abs(impedance - (kp - 1j * ki / omega))
    power = -0.5 * kp * speed**2
    best = np.unravel_index(power.argmax(), power.shape)
    assert power.max() == pytest.approx(excitation**2 / (8.0 * impedance.real), rel=1e-3)
    assert 2.0 * grid.ki[-1] == pytest.approx(ki[best], abs=200.0)  # the last goes half-way
    passive = power[200]  # Ki = 0
    assert ki[200, 0] == 0.0
    assert grid.kp[1] == pytest.approx(kp[200, passive.argmax()], rel=0.03)  # two digits
    assert min(grid.kp) < kp[200, passive.argmax()] < max(grid.kp)
    for values in (grid.kp, grid.ki):  # so that surfaces are drawn from an even grid
        np.testing.assert_allclose(np.diff(values), values[1] - values[0])
    motions = [
        0.1 * excitation / abs(impedance - complex(p, -i / omega)) / omega
        for p in grid.kp
        for i in grid.ki
    ]
    assert grid.position == pytest.approx(max(motions), rel=1e-9)


def test_files_fit_each_other(tmp_path: Path) -> None:
    files = wavebot(tmp_path)
    plant = Plant.model_validate(files["plant"])
    rig_file, limits = files["rig"], files["limits"]["axes"]["heave"]
    assert plant.bem == WAVEBOT.name
    assert (tmp_path / "buoy" / plant.bem).read_bytes() == WAVEBOT.read_bytes()
    axis = rig_file["axes"]["heave"]
    RigFile.model_validate(rig_file)
    LimitsFile.model_validate(files["limits"])
    pto = plant.axes["heave"]
    assert axis["torque_constant_n_m_per_a"] == pto.torque_constant_n_m_per_a
    assert axis["gear_ratio_rad_per_m"] == pto.gear_ratio
    assert axis["counts_per_revolution"] == pto.counts_per_revolution
    assert set(rig_file["sensors"]) == set(plant.sensors)
    assert pto.drive.current_limit_a > limits["current_peak_a"] > limits["current_rms_a"]
    (grid,) = files["campaign"]["matrix"]["grid"]
    values = expected_values(files["campaign"]["sea"]["amplitude_m"])
    expected = values.axes["heave"]
    assert tuple(grid["kp_n_s_per_m"]) == expected.kp
    assert tuple(grid["ki_n_per_m"]) == expected.ki
    assert limits["position_stop_m"] == pytest.approx(2.0 * expected.position, rel=5e-3)
    peak = pto.torque_constant_n_m_per_a * pto.gear_ratio * limits["current_peak_a"]
    assert peak == pytest.approx(2.0 * expected.force, rel=1e-2)
    timing = files["campaign"]["timing"]
    periods = (timing["interval_s"] - timing["settle_s"]) * values.linear.frequency
    assert 10.0 <= periods < 10.5


@pytest.mark.slow
def test_simulated_plant_moves_as_the_limits_expect(tmp_path: Path) -> None:
    """The law's force by itself, on the plant file, in the row that moves most."""
    files = wavebot(tmp_path)
    plant = Plant.model_validate(files["plant"])
    sea = files["campaign"]["sea"]
    grid = expected_values(sea["amplitude_m"]).axes["heave"]
    dt = 1e-3
    model = build(plant, WAVEBOT)
    world = World(model, regular(sea["amplitude_m"], sea["frequency_hz"]), dt=dt, seed=1)
    per_ampere = plant.axes["heave"].torque_constant_n_m_per_a * plant.axes["heave"].gear_ratio
    current, positions, currents = 0.0, [], []
    for _ in range(round(40.0 / dt)):
        world.actuate(Actuation((current, 1), 1))
        world.advance(dt)
        truth = world.truth()
        (x,), (v,) = truth.position, truth.velocity
        current = (max(grid.kp) * v + max(grid.ki) * x) / per_ampere
        positions.append(x)
        currents.append(current)
    last = slice(-round(10.0 / dt), None)
    assert max(positions[last]) == pytest.approx(grid.position, rel=0.03)  # fit, delay, drive
    limits = files["limits"]["axes"]["heave"]
    assert max(map(abs, positions)) < 0.75 * limits["position_stop_m"]
    assert max(map(abs, currents)) < 0.75 * limits["current_peak_a"]


def test_a_rotating_axis_has_its_own_units(tmp_path: Path) -> None:
    bem = write_bem(tmp_path)
    assert new(tmp_path, "--bem", bem, "--dof", "Pitch", "--axis", "arm=Pitch").returncode == 0
    texts = {path.stem: path.read_text() for path in (tmp_path / "buoy").glob("*.yaml")}
    rig_file, limits = (load(tmp_path / "buoy" / f"{name}.yaml") for name in ("rig", "limits"))
    arm = rig_file["axes"]["arm"]
    assert arm["motion"] == "rotation"
    assert {"gear_ratio", "jerk_density_rad2_per_s5", "stop_damping_n_m_s_per_rad"} <= set(arm)
    keys = {"position_stop_rad", "velocity_stop_rad_per_s", "torque_slew_n_m_per_s"}
    assert keys <= set(limits["axes"]["arm"])
    (grid,) = load(tmp_path / "buoy" / "campaign.yaml")["matrix"]["grid"]
    assert set(grid) == {"kp_n_m_s_per_rad", "ki_n_m_per_rad"}
    assert "formula: arm_force * arm_velocity" in texts["rig"]
    assert "# The moment on the body is M = Kp v + Ki x" in texts["campaign"]
    assert "M/v = -conj(Z)" in texts["campaign"].replace("\n# ", " ")
    assert "# kg*m2; inertia_matrix of the BEM file" in texts["plant"]
    all_texts = "".join(texts.values()).replace("amplitude_m: ", "")
    assert [each for each in ("_per_m:", "N/m", "N*s/m", "_m: ") if each in all_texts] == []
    assert RigFile.model_validate(rig_file).axes["arm"].motion == "rotation"
    LimitsFile.model_validate(limits)


@pytest.mark.parametrize(
    ("arguments", "reasons"),
    [
        ((), ["has several modes: Surge, Heave, Pitch; choose some with --dof"]),
        (("--dof", "heave"), ["has no mode 'heave'; it has Surge, Heave, Pitch"]),
        (
            ("--dof", "Surge"),
            ["states no stiffness of Surge: give --stiffness Surge=... (N/m)"],
        ),
        (
            ("--dof", "Heave", "--frequency", "2.5"),
            ["--frequency 2.5 Hz is outside", "allowed 0.07958 .. 1.91 Hz"],
        ),
        (("--dof", "Heave", "--amplitude", "50"), ["--amplitude 50 m moves", "allowed up to"]),
        (("--dof", "Heave", "--amplitude", "1e-4"), ["0.0001 m is out of range", "0.001 .. 0.5"]),
        (
            ("--dof", "Heave", "--mass", "-3", "--axis", "My Axis=Heave", "--gear-ratio", "0"),
            ["--mass Heave=-3: allowed above 0", "'My Axis' is no name of a", "--gear-ratio 0"],
        ),
    ],
)
def test_what_cannot_be_derived_is_refused(
    arguments: tuple[str, ...], reasons: list[str], tmp_path: Path
) -> None:
    done = new(tmp_path, "--bem", write_bem(tmp_path), *arguments)
    assert done.returncode == 2
    assert [reason for reason in reasons if reason not in done.stderr] == []
    assert not (tmp_path / "buoy").exists()


def test_file_without_mass_needs_one(tmp_path: Path) -> None:
    bem = write_bem(tmp_path, inertia_matrix=None, hydrostatic_stiffness=None)
    done = new(tmp_path, "--bem", bem, "--dof", "Heave")
    assert done.returncode == 2
    mass, stiffness = done.stderr.splitlines()
    assert "does not state the mass of Heave: give --mass Heave=... (kg)" in mass
    assert "states no stiffness of Heave: give --stiffness Heave=... (N/m), with" in stiffness
    given = ("--mass", "500", "--stiffness", "9000")
    assert new(tmp_path, "--bem", bem, "--dof", "Heave", *given).returncode == 0


def test_body_of_full_scale_is_refused(tmp_path: Path) -> None:
    done = new(tmp_path, "--bem", write_bem(tmp_path, scale=1000.0), "--dof", "Heave")
    assert done.returncode == 2
    assert "the impedance match of heave needs Kp = " in done.stderr
    assert "scale the BEM data to the size of the model" in done.stderr


@pytest.mark.parametrize("name", ["none.nc", "other.npz"])
def test_wrong_file_is_refused_by_name(name: str, tmp_path: Path) -> None:
    (tmp_path / "other.npz").write_bytes(b"x")
    done = new(tmp_path, "--bem", tmp_path / name, "--json")
    assert done.returncode == 2
    assert name in json.loads(done.stdout)["message"]


def test_new_folder_can_be_moved(tmp_path: Path) -> None:
    """It has copies of the BEM files, of which WAMIT's numeric output is several."""
    arguments = ("--dof", "Heave", "--mass", 300, "--stiffness", 8000)
    water = ("--density", 1000, "--gravity", 9.81, "--depth", 100, "--length-scale", 1)
    done = new(tmp_path, "--bem", WAMIT, *arguments, *water, "--json")
    assert done.returncode == 0, done.stderr
    written = {Path(name).name for name in json.loads(done.stdout)["written"]}
    assert {"cylinder.1", "cylinder.3"} <= written
    moved = (tmp_path / "buoy").rename(tmp_path / "moved")
    report = examine(moved / "campaign.yaml", moved / "rig_hil.yaml")
    assert report.ok, report.text()
    assert load(moved / "plant.yaml")["bem"] == WAMIT.name


def test_infinite_depth_is_the_largest_that_a_plant_may_have(tmp_path: Path) -> None:
    arguments = ("--dof", "Heave", "--mass", 300, "--stiffness", 8000)
    water = ("--density", 1000, "--gravity", 9.81, "--depth", "inf", "--length-scale", 1)
    assert new(tmp_path, "--bem", WAMIT, *arguments, *water).returncode == 0
    assert load(tmp_path / "buoy" / "plant.yaml")["depth_m"] == 20_000
    report = examine(tmp_path / "buoy" / "campaign.yaml")
    assert report.ok, report.text()


def test_bem_file_inside_the_new_folder_stays_where_it_is(tmp_path: Path) -> None:
    inside = tmp_path / "buoy" / "bem"
    inside.mkdir(parents=True)
    bem = write_bem(inside)
    assert new(tmp_path, "--bem", bem, "--dof", "Heave").returncode == 0
    assert load(tmp_path / "buoy" / "plant.yaml")["bem"] == "bem/body.nc"
    assert list((tmp_path / "buoy").rglob("*.nc")) == [bem]


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    wavebot(tmp_path)
    before = {path: path.read_bytes() for path in (tmp_path / "buoy").iterdir()}
    done = new(tmp_path, "--bem", WAVEBOT, "--stiffness", STIFFNESS)
    assert done.returncode == 2
    assert done.stderr.count("exists; nothing is overwritten") == 6
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.parametrize("dof", ["Heave", "Pitch"])
def test_rig_on_wires_is_valid_with_its_campaign(dof: str, tmp_path: Path) -> None:
    waves = ("--amplitude", "0.1")
    assert new(tmp_path, "--bem", CYLINDER, "--dof", dof, *waves).returncode == 0
    folder = tmp_path / "buoy"
    report = examine(folder / "campaign.yaml", folder / "rig_hil.yaml")
    assert report.campaign is not None, report.text()
    wired, axis = report.campaign.rig, dof.lower()
    cell = "load_cell" if dof == "Heave" else "torque_sensor"
    sources = {name: each.source for name, each in wired.sensors.items()}
    assert sources == {"dc_power": "meter.dc", cell: f"meter.{cell}"}
    assert wired.axes[axis].force_sensor == cell
    assert (
        wired.wiring.axes[axis].current_limit_a > report.campaign.limits.axes[axis].current_peak_a
    )
    mode = wired_mode(report.campaign, emulated=True)
    assert [process.name for process in mode.io_processes] == [
        "emulated devices", "can", "line meter", "line io",
    ]  # fmt: skip


@pytest.mark.realtime
def test_new_rig_runs_on_emulated_devices(tmp_path: Path) -> None:
    """A run of one row is complete, with waves and with power; test_modular_hil.py compares."""
    assert new(tmp_path, "--bem", CYLINDER, "--dof", "Heave").returncode == 0
    folder = tmp_path / "buoy"
    wired = load(folder / "rig_hil.yaml")
    wired["wiring"]["can"]["options"]["port"] = free_port()  # the tests share the host
    for line in wired["wiring"]["lines"].values():
        line["port"] = free_port()
    campaign = load(folder / "campaign.yaml")
    (grid,) = campaign["matrix"]["grid"]
    campaign["matrix"] = {"list": [{key: values[0] for key, values in grid.items()}]}
    campaign["start"]["lead_in_s"] = 8
    campaign["timing"] = {"settle_s": 2, "interval_s": 11}
    for name, content in (("rig_hil", wired), ("campaign", campaign)):
        with (folder / f"{name}.yaml").open("w") as file:
            YAML(typ="safe", pure=True).dump(content, file)
    ran = rig("run", folder / "campaign.yaml", "--rig", folder / "rig_hil.yaml", "--sim",
              "--runs", tmp_path / "runs", "--json")  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    report = json.loads(ran.stdout)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    with (Path(report["folder"]) / "rows.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["power_mechanical [W]"]) < 0.0
    assert float(row["dc_power_mean [W]"]) == pytest.approx(float(row["power_dc [W]"]), rel=0.01)


@pytest.mark.slow
@pytest.mark.long  # a whole campaign: 1.8 million ticks
@pytest.mark.parametrize("dof", ["Heave", "Pitch"])
def test_files_pass_the_check_and_run_and_sweep_at_once(dof: str, tmp_path: Path) -> None:
    """The coefficients are those of a real body: `write_bem` has none that can be simulated."""
    assert new(tmp_path, "--bem", CYLINDER, "--dof", dof).returncode == 0
    campaign = tmp_path / "buoy" / "campaign.yaml"
    checked = rig("check", campaign)
    assert checked.returncode == 0, checked.stdout
    assert "warning" not in checked.stdout
    assert rig("compile", campaign).returncode == 0  # the replay is compiled, too
    ran = rig("run", campaign, "--runs", tmp_path / "runs", "--json")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    report = json.loads(ran.stdout)
    assert report["status"] == "complete"
    replayed = rig("replay", report["folder"], "--json")
    assert json.loads(replayed.stdout)["same"] is True
    swept = rig("sweep", campaign, "--sweeps", tmp_path / "sweeps", "--json")
    assert swept.returncode == 0, swept.stdout + swept.stderr
    assert json.loads(swept.stdout)["rows"] == {"complete": 12}


def test_the_first_waves_of_a_deep_resonance_are_radiated_ones(tmp_path: Path) -> None:
    """The cylinder in pitch resonates at 0.17 Hz, where it neither radiates nor is excited."""
    done = new(tmp_path, "--bem", CYLINDER, "--dof", "Pitch")
    assert done.returncode == 0, done.stderr
    campaign = tmp_path / "buoy" / "campaign.yaml"
    frequency = load(campaign)["sea"]["frequency_hz"]
    bem, plant = read_modes(CYLINDER, ["Pitch"]), load(tmp_path / "buoy" / "plant.yaml")
    body = plant["modes"]["pitch"]
    # The largest power of one mode, |F|^2 / 8 Re Z, on the file's own frequencies.
    hertz, damping = bem.frequency, bem.damping[:, 0, 0]
    power = np.abs(bem.excitation[:, 0]) ** 2 / (8.0 * (damping + body["linear_damping"]))
    power[damping < 0.05 * damping.max()] = 0.0
    assert frequency == pytest.approx(hertz[power.argmax()], abs=0.025)
    header = " ".join(campaign.read_text().replace("#", " ").split())
    assert "At 0.13 Hz, below the resonance at 0.169 Hz, the axis radiates hardly any" in header
    assert "warning" not in rig("check", campaign).stdout
    campaign.write_text(campaign.read_text().replace(f"_hz: {frequency}", "_hz: 0.13"))
    checked = rig("check", campaign)
    warned = " ".join((checked.stdout + checked.stderr).split())
    assert "sea: at 0.13 Hz the radiation damping of pitch is 3e-07 of its largest" in warned


def answered(folder: Path, *answers: str, options: Sequence[str] = ()) -> Any:
    """Return the result of `rig new rig asked --ask` with these answers at the terminal."""
    return CliRunner().invoke(
        app,
        ["new", "rig", "asked", "--ask", "--folder", str(folder), *options],
        input="\n".join(answers) + "\n",
    )


def test_a_terminal_is_asked_for_what_is_missing(tmp_path: Path) -> None:
    """A wrong file, mode or number is asked again; what the file states is the default."""
    result = answered(
        tmp_path, "no.nc", str(CYLINDER), "Yaw", "2", "-5", "", "", "1.5", "y", "12",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "no.nc" in result.output
    assert "'Yaw' is none of them" in result.output
    assert "-5: allowed above 0" in result.output
    rig_file = YAML(typ="safe").load(tmp_path / "asked" / "rig.yaml")
    (axis,) = rig_file["axes"].values()
    assert axis["torque_constant_n_m_per_a"] == 1.5
    assert 12 in axis.values()


def test_the_water_of_a_numeric_wamit_file_is_asked_for(tmp_path: Path) -> None:
    result = answered(
        tmp_path, str(WAMIT), "1025", "9.81", "1000", "3", "3000", "30000", "", "n",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    plant = YAML(typ="safe").load(tmp_path / "asked" / "plant.yaml")
    assert plant["density_kg_per_m3"] == 1025
    (mode,) = plant["modes"].values()
    assert mode["mass"] == 3000


def test_without_a_terminal_the_file_is_needed(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["new", "rig", "asked", "--folder", str(tmp_path)])
    assert result.exit_code == 2
    assert "give the file of the BEM coefficients" in result.output
    assert not list(tmp_path.iterdir())
