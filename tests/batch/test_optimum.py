"""The search for best set points: against impedance matching, its campaign, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import closed_form
import numpy as np
import plant_files
import pytest
from rehearsing import CONFIGS, write_campaign
from rig_command import rig_here

from sim_plant.bem import excitation_at

GRID = {"spring_n_per_m": 490.9, "kp_n_s_per_m": [-3000, -1000], "ki_n_per_m": [0, 8000]}
AMPLITUDE, FREQUENCY = 0.03, 0.5


def make_campaign(folder: Path, **keys: Any) -> Path:
    config = {
        "plant": str(CONFIGS / "plants" / "wavebot_linear.yaml"),
        "sea": {"kind": "regular", "amplitude_m": AMPLITUDE, "frequency_hz": FREQUENCY},
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": 30},
        "timing": {"settle_s": 20, "interval_s": 30},
        "matrix": {"grid": [GRID]},
    }
    return write_campaign(folder, **config | keys)


@pytest.mark.slow
def test_the_best_row_of_the_wavebot_is_the_impedance_match(tmp_path: Path) -> None:
    """|F|² / 8 R at the torque sensor within 1 %: the power is flat around its maximum."""
    output = tmp_path / "best.yaml"
    code, text, error = rig_here(
        "optimum", make_campaign(tmp_path), "--for", "mechanical_2", "--lead-in", "40",
        "--output", output, "--json",
    )  # fmt: skip
    assert code == 0, text + error
    report = json.loads(text)
    (optimum,) = report["optima"]
    params, hull = plant_files.plant("wavebot_linear").build(), plant_files.bem()
    impedance = closed_form.intrinsic_impedance(params, FREQUENCY)
    resistance = float(impedance.real) + params.pto.viscous
    force = abs(excitation_at(hull, np.array([FREQUENCY]))[0]) * AMPLITUDE
    assert optimum["power_w"] == pytest.approx(-(force**2) / (8.0 * resistance), rel=0.01)
    assert optimum["at_limit"] == []
    assert report["simulated_rows"] > 40
    code, text, _ = rig_here("check", output, "--json")
    assert code == 0
    checked = json.loads(text)
    assert checked["points"] == 5
    assert output.read_text().startswith("# Written by rig optimum")


def test_a_matrix_that_varies_nothing_is_refused(tmp_path: Path) -> None:
    row = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    code, _, error = rig_here("optimum", make_campaign(tmp_path, matrix={"list": [row]}))
    assert code == 2
    assert "varies no column of a law; give two values or more of kp_n_s_per_m" in error


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--for", "nowhere"], "nowhere"),
        (["--output", "best.json"], "a campaign is YAML; give a name ending in .yaml"),
        (["--output", "no/such/best.yaml"], "there is no folder no/such; make it first"),
    ],
)
def test_bad_options_are_refused_before_any_work(
    options: list[str], message: str, tmp_path: Path
) -> None:
    code, _, error = rig_here("optimum", make_campaign(tmp_path), *options)
    assert code == 2
    assert message in error


def test_another_file_is_never_overwritten(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("name: mine\n")
    code, _, error = rig_here("optimum", make_campaign(tmp_path), "--output", mine)
    assert code == 2
    assert "exists and is not of this command" in error
    assert mine.read_text() == "name: mine\n"


def test_a_session_has_no_optimum() -> None:
    code, _, error = rig_here("optimum", CONFIGS / "sessions" / "driveline_short.yaml")
    assert code == 2
    assert "a session has no gain matrix; name a campaign" in error
