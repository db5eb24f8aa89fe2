"""LUPA in runs: check, rehearsal, sweep; powers against the frequency domain with the filters."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controllers import biquads
from rig.config.yaml_source import load_mapping
from sim_plant.modes import building
from test_lupa_feedback import DT, SETTINGS
from test_lupa_numbers import LUPA, dynamic_stiffness, excitation, plant

from wec_lupa import feedback

PERIOD, AMPLITUDE = 2.5, 0.02  # s, m: so small that the drag of the hull takes 1 % of the power
ROWS = {  # stiffness and damping
    "one_body": ((0.0, 600.0), (-2000.0, 600.0)),
    "two_body": ((0.0, 600.0), (0.0, 1800.0)),
}


def write_campaign(folder: Path, rig: str, **keys: Any) -> Path:
    path = folder / "campaign.yaml"
    rows = ROWS.get(rig, ROWS["one_body"])
    listed = [{"stiffness_n_per_m": k, "damping_n_s_per_m": c} for k, c in rows]
    content = {
        "name": "lupa",
        "rig": str(LUPA / "rigs" / f"{rig}.yaml"),
        "sea": {"kind": "regular", "amplitude_m": AMPLITUDE, "period_s": PERIOD},
        "tare": {"duration_s": 1},
        "start": {"lead_in_s": 40},
        "timing": {"settle_s": 20, "interval_s": 32.5},
        "matrix": {"list": listed},
        **keys,
    }
    path.write_text(json.dumps(content))  # YAML reads JSON
    return path


def shaft_power(name: str, stiffness: float, damping: float) -> float:
    """Return the power of the motor on the axis, with the lag of filters, hold and readings, W."""
    model, omega = plant(name), 2.0 * math.pi / PERIOD
    factors = building.factor_matrix(model.plant)
    constants = feedback.params(SETTINGS, 0.0, DT)
    lag = biquads.response((constants.notch, constants.low_pass), omega * DT)
    lag *= np.exp(-1j * omega * 2.5 * DT) / (1.0 + 1j * omega / (2.0 * math.pi * 200.0))
    control = (stiffness + 1j * omega * damping) * lag * factors.T @ factors
    force = excitation(model, omega) * AMPLITUDE / 0.05
    motion = factors @ np.linalg.solve(dynamic_stiffness(model, omega) + control, force)
    pressed = -(stiffness + 1j * omega * damping) * lag * motion[0]
    return float(0.5 * (pressed * np.conj(1j * omega * motion[0])).real)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["one_body", "two_body"])
def test_powers_of_a_rehearsal(name: str, rig: Any, tmp_path: Path) -> None:
    """Drag takes about 1 %; the lag of the filters adds 4 % of stiffness."""
    path = write_campaign(tmp_path, name)
    assert rig("check", path).returncode == 0
    done = rig("run", path, "--runs", tmp_path / "runs")
    assert done.returncode == 0, done.stderr + done.stdout
    (run,) = (tmp_path / "runs").iterdir()
    with (run / "rows.csv").open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for row, (stiffness, damping) in zip(rows, ROWS[name], strict=True):
        expected = shaft_power(name, stiffness, damping)
        assert float(row["power_shaft [W]"]) == pytest.approx(expected, rel=0.03)


@pytest.mark.slow
def test_identification_finds_the_plant(rig: Any, tmp_path: Path) -> None:
    """Z_i of the float from the belt's load cells; drivetrain 350 N s/m within 2 %, 9.34 kg in 5 %.

    The drag of the hull is in the measured Z_i, sqrt(8 / pi) c sigma: 12 to 25 N s/m here.
    """
    runs = tmp_path / "runs"
    done = rig("run", LUPA / "campaigns" / "identification.yaml", "--runs", runs)
    assert done.returncode == 0, done.stderr + done.stdout
    assert rig("identify", "last", "--runs", runs).returncode == 0
    (path,) = runs.glob("*/identification.json")
    (found,) = json.loads(path.read_text())["models"]
    frequency = np.array(found["frequency_hz"])

    def response(name: str) -> Any:
        entry = found["responses"][name]
        return np.array(entry["re"]) + 1j * np.array(entry["im"])

    drivetrain = response("Z_id") - response("Z_i")
    omega = 2.0 * np.pi * frequency
    assert np.mean(drivetrain.real) == pytest.approx(350.0, rel=0.02)
    assert np.polyfit(omega, drivetrain.imag, 1)[0] == pytest.approx(9.34, rel=0.05)
    model = plant("one_body")
    whole = np.array([dynamic_stiffness(model, w)[0, 0] / (1j * w) for w in omega])
    body = whole - 350.0 - 9.34j * omega
    gap = response("Z_i") - body
    assert 8.0 < np.median(gap.real) < 30.0
    assert np.abs(np.median(gap.imag)) < 0.02 * np.abs(body.imag).max()


@pytest.mark.slow
def test_the_optimum_is_the_impedance_match(rig: Any, tmp_path: Path) -> None:
    """|F|² / 8 R within 1 %, K and C within 5 and 15 %: the power is flat around the match.

    Without drag; Kp and Ki of the impedance law make up for the delay of the loop.
    """
    plain = tmp_path / "plant.yaml"
    base = LUPA / "plants" / "one_body.yaml"
    plain.write_text(f"extends: {base}\nmodes: {{float: {{quadratic_damping: 0}}}}\n")
    grid = [{"kp_n_s_per_m": [-1500, -500], "ki_n_per_m": [2000, 6000]}]
    path = write_campaign(
        tmp_path, "one_body", law="impedance", plant=str(plain), matrix={"grid": grid}
    )
    best = tmp_path / "best.yaml"
    done = rig("optimum", path, "--for", "shaft", "--lead-in", 30, "--output", best, "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    (optimum,) = json.loads(done.stdout)["optima"]
    omega = 2.0 * math.pi / PERIOD
    model = plant("one_body")
    own = dynamic_stiffness(model, omega)[0, 0] / (1j * omega)
    force = abs(excitation(model, omega)[0]) * AMPLITUDE / 0.05
    assert optimum["power_w"] == pytest.approx(-(force**2) / (8.0 * own.real), rel=0.01)
    assert optimum["values"]["ki"] == pytest.approx(-omega * own.imag, rel=0.05)
    assert optimum["values"]["kp"] == pytest.approx(-own.real, rel=0.15)
    assert optimum["at_limit"] == optimum["far"] == []
    assert rig("check", best).returncode == 0


@pytest.mark.parametrize("name", ["one_body", "one_body_32_teeth", "one_body_80_teeth", "two_body"])
def test_every_rig_passes_its_check(name: str, rig: Any, tmp_path: Path) -> None:
    done = rig("check", write_campaign(tmp_path, name), "--json")
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout)["problems"] == []


def test_mooring_lines_replace_the_linear_mooring(rig: Any, tmp_path: Path) -> None:
    """517.4 N/m of four lines in heave; the linear mooring of the same campaign is 253.36 N/m."""
    model = plant("two_body_lines")
    assert building.line_stiffness(model.plant)[1, 1] == pytest.approx(517.4, rel=1e-3)
    assert building.stiffness_matrix(model.plant, model.bem)[1, 1] == pytest.approx(77.05, rel=1e-3)
    lines = str(LUPA / "plants" / "two_body_lines.yaml")
    done = rig("check", write_campaign(tmp_path, "two_body", plant=lines))
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", ["damping_1p68s", "damping_2p5s", "damping_3s"])
def test_shipped_campaigns_pass_their_check(name: str, rig: Any) -> None:
    done = rig("check", LUPA / "campaigns" / f"{name}.yaml", "--json")
    assert done.returncode == 0, done.stdout
    report = json.loads(done.stdout)
    assert report["tank"]["full_s"] > 50.0
    assert report["rows"] == 23 + 2 * (name == "damping_1p68s")


@pytest.mark.parametrize("name", ["identification", "ramps"])
def test_campaigns_in_calm_water_pass_their_check(name: str, rig: Any) -> None:
    assert rig("check", LUPA / "campaigns" / f"{name}.yaml").returncode == 0


@pytest.mark.parametrize("name", ["one_body", "one_body_32_teeth", "one_body_80_teeth"])
def test_the_velocity_stop_is_that_of_the_motor(name: str) -> None:
    """150 rpm."""
    mapping, locate = load_mapping(LUPA / "rigs" / f"{name}.yaml")
    limits, _ = load_mapping(locate.resolve_path(("limits",), mapping["limits"]))
    speed = limits["axes"]["pto"]["velocity_stop_m_per_s"]
    gear = mapping["axes"]["pto"]["gear_ratio_rad_per_m"]
    assert speed * gear == pytest.approx(150.0 * 2.0 * math.pi / 60.0, rel=0.01)


def test_an_ampere_is_the_force_of_the_measured_torque_constant() -> None:
    """7.86 N m/A on the 50-tooth sprocket: 123.46 N at the belt."""
    (axis,) = plant("one_body").plant.axes.values()
    assert axis.torque_constant_n_m_per_a * axis.gear_ratio == pytest.approx(123.46, rel=1e-4)


def test_a_spring_between_two_bodies_is_limited_by_the_mooring(rig: Any, tmp_path: Path) -> None:
    """K k / (K + k) = 316.7 N/m of float and moored spar in series; the law's K < 0 is negative."""
    float_, spar = np.diag(building.stiffness_matrix(*plant("two_body")[:2]))
    largest = float_ * spar / (float_ + spar)
    assert largest == pytest.approx(316.7, abs=0.1)
    rows = {
        "list": [
            {"stiffness_n_per_m": k, "damping_n_s_per_m": 600.0}
            for k in (0.001 - largest, -1500.0, -9000.0)
        ]
    }
    done = rig("check", write_campaign(tmp_path, "two_body", matrix=rows), "--json")
    assert done.returncode == 2
    messages = [each["message"] for each in json.loads(done.stdout)["problems"]]
    assert [message[:8] for message in messages] == ["point 1 ", "point 2 "]
    assert (
        "K -1500 N/m exceeds the static stiffness 316.7 N/m of the motion of axis pto"
        in messages[0]
    )
    assert "allowed above -316.7 N/m" in messages[0]
    assert "the rig would stop at 0.24 m" in messages[0]
