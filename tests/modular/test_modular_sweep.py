"""Sweeps of a rig of standard parts: parameters, stored cases, waves of a run, laws."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from both_ways import open_campaign_plan
from command_here import rig as rig_here
from mode_plants import CYLINDER
from test_modular_simulation import LAW_PAGE, make_campaign

from rig.analysis.rows import row_table
from rig.config.yaml_source import load_mapping
from rig.kinds.modular.match import impedance_match
from rig.kinds.modular.simulation import check_model
from rig.recording.runs import open_run
from tests.docs.blocks import file_of

LATCHING = {"use": "latching", "hold_stiffness_n_per_m": 1e5, "hold_damping_n_s_per_m": 1e3}
GAINS = """\
matrix:
  list:
    - {kp_n_s_per_m: -5000, ki_n_per_m: 0}
    - {kp_n_s_per_m: -3000, ki_n_per_m: 500}
"""
PLANT_MASS = "plant.modes.heave.mass"


def run_rig(*arguments: object) -> Any:
    """Return the JSON of a command that succeeds."""
    done = rig_here(*arguments, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the campaign of a new rig with two rows."""
    folder = tmp_path_factory.mktemp("rig")
    run_rig("new", "rig", "cylinder", "--bem", CYLINDER, "--dof", "Heave", "--folder", folder)
    path = folder / "cylinder" / "campaign.yaml"
    path.write_text(path.read_text().split("matrix:")[0] + GAINS)
    return path


@pytest.fixture(scope="module")
def run(campaign: Path) -> Path:
    """Return the folder of a rehearsal of the campaign."""
    return Path(run_rig("run", campaign, "--runs", campaign.parent / "runs")["folder"])


def test_match_is_that_of_the_bem_file(campaign: Path) -> None:
    """By the coefficients of the file itself, without the fit of the radiation memory."""
    opened, _ = open_campaign_plan(campaign)
    match = impedance_match(opened)
    sea, mode = opened.file.sea, opened.plant["modes"]["heave"]
    omega = 2.0 * np.pi * sea.frequency_hz
    with xarray.open_dataset(CYLINDER) as bem:
        heave = bem.sel(influenced_dof="Heave", radiating_dof="Heave").sortby("omega")
        added, damping = (
            float(np.interp(omega, heave["omega"], heave[name]))
            for name in ("added_mass", "radiation_damping")
        )
    axis = opened.plant["axes"]["heave"]
    reactance = omega * (mode["mass"] + axis["inertia"] + added) - mode["stiffness"] / omega
    resistance = damping + mode["linear_damping"] + axis["viscous_friction"]
    assert match["kp"] == pytest.approx(-resistance, rel=0.01)
    assert match["ki"] == pytest.approx(-omega * reactance, rel=0.01)
    assert match["kp_real"] == pytest.approx(-np.hypot(resistance, reactance), rel=0.01)
    irregular = opened.file.model_copy(update={"sea": None})
    assert impedance_match(opened._replace(file=irregular)) == {}


@pytest.mark.parametrize(("kp", "ki"), [(-1.0, 0.0), (0.0, 5.0), (-0.01, 0.01)])
def test_gains_of_a_wrong_unit_are_a_warning(
    campaign: Path, tmp_path: Path, kp: float, ki: float
) -> None:
    """In kN*s/m; one row at the match is enough for none, and so are rows without gains."""
    shutil.copytree(campaign.parent, tmp_path, dirs_exist_ok=True)
    file = tmp_path / campaign.name
    text = file.read_text()
    assert GAINS in text
    head = text.replace(GAINS, "matrix:\n  list:\n")

    def messages(*rows: tuple[float, float]) -> list[str]:
        lines = (f"    - {{kp_n_s_per_m: {a}, ki_n_per_m: {b}}}\n" for a, b in rows)
        file.write_text(head + "".join(lines))
        report = run_rig("check", file)
        return [w["message"] for w in report["warnings"] if "impedance" in w["message"]]

    (message,) = messages((kp, ki), (0.1 * kp, ki))
    opened, _ = open_campaign_plan(campaign)
    impedance = -impedance_match(opened)["kp_real"]
    assert f"of the plant's impedance, {impedance:.4g} N*s/m" in message
    force = float(re.findall(r"of all rows, (\S+) N", message)[0])
    share = float(re.findall(r"is (\S+) % of", message)[0])
    assert force == pytest.approx(
        np.hypot(kp, ki / (2.0 * np.pi * opened.file.sea.frequency)), rel=0.01
    )
    assert share == pytest.approx(100.0 * force / impedance, rel=0.06)
    assert messages((kp, ki), (-impedance, 0.0)) == []
    assert messages((0.0, 0.0)) == []


@pytest.mark.parametrize(
    ("key", "value", "columns"),
    [
        ("law", {"zc": {"numerator": [-4000, 0], "denominator": [1, 1]}}, {}),
        ("law", LATCHING, {"latch_s": 0.2}),
        ("law", ["impedance", "nonlinear damping"], {"law": "impedance"}),
        ("reference", {"kind": "multisine", "repeat_s": 20, "amplitude_n": 900}, {}),
    ],
)
def test_small_gains_beside_other_forces_are_no_warning(
    campaign: Path, tmp_path: Path, key: str, value: Any, columns: dict[str, Any]
) -> None:
    """Of a transfer function, a law without a linear form, another law's rows, or a reference."""
    shutil.copytree(campaign.parent, tmp_path, dirs_exist_ok=True)
    file = tmp_path / campaign.name
    gains = columns if value == LATCHING else {"ki_n_per_m": 0, **columns}
    rows = [{"kp_n_s_per_m": each, **gains} for each in (-10, -5)]
    if isinstance(value, list):
        damped = {"law": "nonlinear damping", "quadratic_n_s2_per_m2": 2e4, "coulomb_n": 0}
        rows.append(rows[0] | damped)
    settings = load_mapping(file)[0] | {"matrix": {"list": rows}, key: value}
    file.write_text(json.dumps(settings))
    report = run_rig("check", file)
    assert report["ok"], report["problems"]
    assert not [w for w in report["warnings"] if "plant's impedance" in w["message"]]
    if key == "reference":
        del settings["reference"]
        file.write_text(json.dumps(settings))
        assert "plant's impedance" in json.dumps(run_rig("check", file)["warnings"])


@pytest.mark.slow
def test_sequential_sweep_has_the_rows_of_a_rehearsal(campaign: Path, run: Path) -> None:
    swept = run_rig("sweep", campaign, "--sequential", "--sweeps", campaign.parent / "sweeps")
    with xarray.load_dataset(swept["result"]) as rows:
        logged = row_table(run)
        for name in ("power_mechanical", "power_dc", "stroke", "velocity_rms", "dc_power_p98"):
            assert rows[name].values.tobytes() == logged[name].values.tobytes(), name
    assert Path(swept["pictures"][0]).stat().st_size > 10_000


@pytest.mark.slow
def test_check_simulates_the_rows_where_the_loop_is_compiled(
    campaign: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The simulated rows have the bits of the run; a trip is a warning; else a reason is given."""
    run_rig("sweep", campaign, "--sequential", "--sweeps", campaign.parent / "sweeps")
    report = run_rig("check", campaign)
    logged = row_table(run)["power_dc"].values.tolist()
    assert [row["power_dc"] for row in report["simulated"]] == logged
    assert report["warnings"] == []
    text = rig_here("check", campaign).stdout
    (line,) = [each for each in text.splitlines() if each.startswith("  1 -3000")]
    assert f" {report['simulated'][1]['power_mechanical']:.4g} " in line
    tight = shutil.copytree(campaign.parent, tmp_path / "tight")
    first, second = (row["position_peak"] for row in report["simulated"])
    assert first < 0.9 * second
    limits = (tight / "limits.yaml").read_text()
    for name, stop in (("warn", first), ("stop", 0.5 * (first + second))):
        limits = re.sub(rf"position_{name}_m: \S+", f"position_{name}_m: {stop}", limits)
    (tight / "limits.yaml").write_text(limits)
    report = run_rig("check", tight / "campaign.yaml")
    assert report["ok"]
    states = [row["state"] for row in report["simulated"]]
    lacking = states.index("not run")
    assert 0 < lacking < len(states)
    message = (
        f"POSITION in row {lacking} or before it; {len(states) - lacking} of {len(states)} rows"
    )
    assert f"simulated, the run stops with {message}" in report["warnings"][0]["message"]
    assert rig_here("check", tight / "campaign.yaml").stdout.endswith("the campaign can be run\n")
    limits = re.sub(r"velocity_stop_m_per_s: \S+", "velocity_stop_m_per_s: 0.01", limits)
    (tight / "limits.yaml").write_text(limits)
    done = rig_here("check", tight / "campaign.yaml")
    assert done.returncode == 2
    assert f"VELOCITY in row 0 or before it; {len(states)} of {len(states)} rows" in done.stdout
    assert done.stdout.endswith("the campaign cannot be run\n")
    # Of a wired rig `rig run` refuses what the check does; a rehearsal shows how it trips.
    wired = ("run", tight / "campaign.yaml", "--rig", tight / "rig_hil.yaml")
    hil = (tight / "limits_hil.yaml").read_text()
    hil = re.sub(r"velocity_stop_m_per_s: \S+", "velocity_stop_m_per_s: 0.01", hil)
    (tight / "limits_hil.yaml").write_text(hil)
    for mode in ((), ("--sim",)):
        done = rig_here(*wired, *mode, "--runs", tight / "refused")
        assert done.returncode == 2, done.stdout + done.stderr
        assert f"VELOCITY in row 0 or before it; {len(states)} of {len(states)}" in done.stdout
    assert not (tight / "refused").exists()
    refused = json.loads(rig_here("check", tight / "campaign.yaml", "--json").stdout)
    assert not refused["ok"]
    assert [each["message"] for each in refused["problems"]] == [
        each["message"] for each in refused["warnings"]
    ]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    report = run_rig("check", campaign)
    assert "not compiled on this host yet" in report["not_simulated"]


@pytest.mark.slow
def test_parameters_of_plant_rig_and_campaign(campaign: Path) -> None:
    """A plant value takes the rig's own with it; a second start runs nothing."""
    factor = float(re.search(r"gear_ratio: (\S+)", (campaign.parent / "plant.yaml").read_text())[1])  # type: ignore[index]
    gears = [factor, 1.1 * factor]
    options = [
        *("--over", f"plant.axes.heave.gear_ratio={gears[0]!r},{gears[1]!r}"),
        *("--over", f"{PLANT_MASS}=3000,3100"),
        *("--over", "rig.sensors.dc_power.scale=1,0.5"),
        *("--sweeps", campaign.parent / "sweeps"),
    ]
    swept = run_rig("sweep", campaign, *options)
    assert swept["rows"] == {"complete": 16}
    assert {Path(name).name for name in swept["pictures"]} >= {"surfaces.png", "parameters.png"}
    with xarray.load_dataset(swept["result"]) as table:
        dims = ("plant.axes.heave.gear_ratio", PLANT_MASS, "rig.sensors.dc_power.scale", "row")
        assert table["power_mechanical"].dims == dims
        power = table["power_mechanical"].values
        dc = table["power_dc"].values
        force = table["force_rms"].values
    assert np.array_equal(power[:, :, 0], power[:, :, 1])  # the scale of a sensor moves nothing
    assert dc[:, :, 1] == pytest.approx(0.5 * dc[:, :, 0], rel=1e-9)
    assert force[1] == pytest.approx(force[0], rel=1e-3)  # the rig knows the gear
    assert np.all(np.abs(power[:, 1] - power[:, 0]) > 1e-3 * np.abs(power[:, 0]))
    repeated = run_rig("sweep", campaign, *options)
    assert (repeated["run_now"], repeated["result"]) == (0, swept["result"])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["elevation", "forces"])
def test_other_gains_in_the_waves_of_a_run(method: str, campaign: Path, run: Path) -> None:
    """The model of the run is the plant of the run, so the error is that of the waves alone.

    The period of 0.3 Hz ends on a tick of 1 ms only after three periods.
    """
    data = run_rig("replay", run, "--with", campaign, "--waves", method)
    assert data["waves"]["by"] == method
    text = campaign.read_text()
    (amplitude,) = re.findall(r"kind: regular, amplitude_m: ([^,]+), frequency_hz: 0.3}", text)
    tolerance = 1e-3 if method == "elevation" else 0.02  # end of the transient, Coulomb and noise
    assert data["waves"]["amplitude_m"] == pytest.approx([float(amplitude)], rel=tolerance)
    for row in data["checked"]:
        modelled, logged = (row[key]["mechanical"] for key in ("modelled", "logged"))
        assert modelled == pytest.approx(logged, rel=2.5 * tolerance)


@pytest.mark.slow
def test_waves_of_several_modes_are_not_recovered_from_forces(tmp_path: Path) -> None:
    path = make_campaign(tmp_path, "regular")
    folder = run_rig("run", path, "--runs", tmp_path)["folder"]
    assert np.isfinite(open_run(folder, fields=["wave.elevation"])["wave.elevation"].values).all()
    done = rig_here("replay", folder, "--with", path, "--waves", "forces")
    assert done.returncode == 2
    message = " ".join(done.stderr.split())
    assert (
        "only for a plant with one mode and one axis; this one has the modes heave, pitch"
        in message
    )
    found = run_rig("replay", folder, "--with", path)
    assert found["waves"]["by"] == "elevation"


def test_a_run_with_another_device_than_the_model_is_refused(tmp_path: Path) -> None:
    """A plant without the rig's sensor cannot stand for the device of the run."""
    logged, _ = open_campaign_plan(make_campaign(tmp_path, "regular"))
    check_model("RUN", logged, logged)
    model = logged._replace(plant=logged.plant | {"sensors": {"pto_force": {}}})
    with pytest.raises(ValueError, match="RUN: its rig has the sensors dc_power, which the plant"):
        check_model("RUN", logged, model)


# --- laws


def with_law(folder: Path, old: str, new: str, extra: str = "") -> Path:
    """Write the campaign with a law of a file, of which a part is replaced."""
    path = make_campaign(folder, "law of a file, nonlinear damping")
    text = file_of(LAW_PAGE, "growing_damping.py")
    assert old in text
    law = text.replace(old, new, 1).replace("class SetPoint", f"{extra}class SetPoint", 1)
    (folder / "growing.py").write_text(law)
    return path


def test_law_that_cannot_be_compiled_is_not_swept(tmp_path: Path) -> None:
    path = with_law(tmp_path, "    distance =", '    one = float(f"{1.0}")\n    distance = one *')
    checked = rig_here("check", path)
    assert checked.returncode == 0, checked.stdout
    assert "law.heave: the law cannot be compiled, so it runs interpreted" in checked.stdout
    swept = rig_here("sweep", path, "--sweeps", tmp_path)
    assert swept.returncode == 2
    assert "law.heave" in swept.stderr
    assert "a sweep runs compiled code, but the law cannot be compiled: " in swept.stderr


def test_law_with_hidden_memory_is_refused(tmp_path: Path) -> None:
    """Two equal trials differ: the law counts its calls in a global of its module."""
    counting = "    CALLS[0] += 1\n    distance ="
    path = with_law(tmp_path, "    distance =", counting, "CALLS = [0]\n\n\n")
    text = (tmp_path / "growing.py").read_text()
    (tmp_path / "growing.py").write_text(
        text.replace("force + reference", "force + 0.001 * CALLS[0]", 1)
    )
    message = "keeps memory outside its State: two equal trials differ first in tick 0"
    for command in (("check", path), ("sweep", path, "--sweeps", tmp_path)):
        done = rig_here(*command)
        assert done.returncode == 2
        assert message in done.stdout + done.stderr


def test_edited_law_is_another_sweep(tmp_path: Path) -> None:
    """The folder of a sweep, and so its stored cases, depends on the file of each law."""
    from rig.sweeps.sweep import open_sweep

    path = make_campaign(tmp_path, "law of a file, nonlinear damping")
    first = open_sweep(path, [], tmp_path, sequential=False, lead_in=5.0).folder
    law = tmp_path / "growing.py"
    law.write_text(law.read_text().replace("c1.value * distance", "0.5 * c1.value * distance"))
    assert open_sweep(path, [], tmp_path, sequential=False, lead_in=5.0).folder != first
