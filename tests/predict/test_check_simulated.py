"""`rig check` of laws without a linear form: the report says so, and simulates the rows."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from command_here import rig
from mode_plants import CYLINDER
from predicting import CONFIGS, STIFF, rows, write_campaign
from test_modular_simulation import LAW_PAGE

from rig.analysis.rows import row_table
from tests.docs.blocks import file_of

SEA = {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5}
TIMES = {
    "tare": {"duration_s": 1},
    "start": {"lead_in_s": 6},
    "timing": {"settle_s": 1, "interval_s": 5.5},
}
LAWS: dict[str, tuple[Any, dict[str, list[float]]]] = {
    "latching": (
        {"use": "latching", "hold_stiffness_n_per_m": 1e5, "hold_damping_n_s_per_m": 5e3},
        {"kp_n_s_per_m": [-2000], "latch_s": [0.1, 0.3]},
    ),
    "declutching": ("declutching", {"kp_n_s_per_m": [-2000], "declutch_s": [0.1, 0.3]}),
    "nonlinear damping": (
        "nonlinear damping",
        {"quadratic_n_s2_per_m2": [3000, 5000], "coulomb_n": [20]},
    ),
    "velocity table": (
        {"use": "velocity table", "velocity_m_per_s": [-1, 0, 1], "force_n": [3000, 0, -2000]},
        {"table_scale": [0.5, 1], "retract_factor": [1]},
    ),
    "growing_damping": (
        {"use": "./growing_damping.py", "max_force_n": 3000},
        {"c0_n_s_per_m": [1000], "c1_n_s_per_m2": [0, 10000]},
    ),
}
MODULAR = "modular"


def check(path: Path, *options: str) -> dict[str, Any]:
    """Return the report of a campaign that may run, as JSON."""
    done = rig("check", path, *options, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def write_law_campaign(folder: Path, kind: str, law: str) -> Path:
    """Write a campaign of two rows with a law, on the WaveBot or on a new rig."""
    settings, gains = LAWS[law]
    text = file_of(LAW_PAGE, "growing_damping.py")
    (folder / "growing_damping.py").write_text(text)
    if kind == MODULAR:
        new = rig("new", "rig", "buoy", "--bem", CYLINDER, "--dof", "Heave", "--folder", folder)
        assert new.returncode == 0, new.stderr
        keys = {"rig": str(folder / "buoy" / "rig.yaml"), "matrix": {"grid": [gains]}}
    else:
        keys = {"matrix": {"grid": [{"spring_n_per_m": [STIFF], **gains}]}}
    return write_campaign(folder, sea=SEA, law=settings, **TIMES, **keys)


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", ["wavebot", MODULAR])
def test_rows_of_laws_without_linear_form_are_those_of_a_rehearsal(
    kind: str, law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every number of the simulated rows has the bits of the row table of a run."""
    path = write_law_campaign(tmp_path, kind, law)
    with monkeypatch.context() as empty_cache:
        empty_cache.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        report = check(path)
        assert "--simulate compiles it" in report["not_simulated"]
        assert "simulated" not in report
    report = check(path, "--simulate")
    if kind == "wavebot":
        assert report["not_predicted"] == f"the law {law} has no linear form"
    assert not {"predictions", "not_simulated"} & report.keys()
    assert report["simulated_extent"] == "all 2 rows"
    run = rig("run", path, "--runs", tmp_path / "runs", "--json")
    assert run.returncode == 0, run.stderr
    table = row_table(json.loads(run.stdout)["folder"])
    names = [name for name in table.variables if table[name].dtype.kind == "f"]
    assert {"power_dc", "stroke", "force_rms"} <= set(names)
    for number, row in enumerate(report["simulated"]):
        for name in set(names) & row.keys():
            logged = float(table[name].values[number])
            assert row[name] == (logged if math.isfinite(logged) else None), name
    first, second = report["simulated"]
    assert first["power_dc"] != second["power_dc"]
    text = rig("check", path).stdout  # compiled now
    assert "simulated" in text
    assert f"{second['power_dc']:.4g}" in text
    if kind == "wavebot":
        assert f"not predicted: the law {law} has no linear form; simulated instead" in text


@pytest.mark.slow
def test_linear_law_is_simulated_on_request_beside_its_prediction(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, sea=SEA, **TIMES, matrix=rows((STIFF, -2000.0, 0.0)))
    assert "simulated" not in check(path)
    report = check(path, "--simulate")
    (predicted,), (simulated,) = report["predictions"], report["simulated"]
    for name in ("position_rms", "power_mechanical_1", "power_ac"):
        assert simulated[name] == pytest.approx(predicted[name], rel=0.02), name  # after 7 s
    text = rig("check", path, "--simulate").stdout
    assert "Predicted, by spring rate" in text
    assert "Simulated, the row" in text


@pytest.mark.slow
def test_long_plan_is_simulated_in_part_and_completely_on_request(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_law_campaign(tmp_path, "wavebot", "declutching")
    complete = check(path, "--simulate")
    monkeypatch.setattr("rig.sweeps.simulated_check.MAX_SECONDS", 10.0)
    part = check(path)
    assert part["simulated"] == complete["simulated"][:1]
    assert part["simulated_extent"].startswith("the first 1 of 2 rows")
    assert part["warnings"] == []
    assert check(path, "--simulate")["simulated"] == complete["simulated"]


def test_campaigns_that_cannot_be_simulated_say_why() -> None:
    for options in ((), ("--simulate",)):
        report = check(CONFIGS / "campaigns" / "spring_map_short.yaml", *options)
        assert report["not_simulated"] == "compiled code cannot simulate a hoist"
        assert "simulated" not in report
    session = rig("check", "driveline_short", "--simulate")
    assert session.returncode == 2
    assert "rig sweep" in session.stderr


def equal_rows(folder: Path, **more: Any) -> tuple[list[dict[str, Any]], str]:
    """Return the groups of equal rows of three set points, as JSON, and the text of the report."""
    matrix = rows((STIFF, -2000.0, 0.0), (STIFF, -1000.0, 0.0))
    matrix["list"] += rows((STIFF, -2000.0, 0.0), surge_kp_n_s_per_m=-4000.0)["list"]
    path = write_campaign(folder, sea=SEA, matrix=matrix, **more)
    return check(path)["equal_rows"], rig("check", path).stdout


def test_rows_with_one_prediction_and_different_gains_are_explained(tmp_path: Path) -> None:
    """Surge gains act on heave by guide friction only, and on nothing if surge is off."""
    (group,), text = equal_rows(tmp_path)
    assert (group["rows"], group["columns"]) == ([0, 2], ["surge_kp_n_s_per_m"])
    assert "surge_position_peak" in group["changed"]
    assert "rows 0, 2 differ only in surge_kp_n_s_per_m, by too little for the digits" in text
    (group,), text = equal_rows(tmp_path, surge={"use": "off"})
    assert (group["rows"], group["changed"]) == ([0, 2], [])
    reason = "differ only in surge_kp_n_s_per_m, on which this prediction does not depend"
    assert group["reason"] == reason
    assert f"rows 0, 2 {reason}" in text


def test_rows_with_different_predictions_or_equal_set_points_are_no_group(tmp_path: Path) -> None:
    matrix = rows((STIFF, -2000.0, 0.0), (STIFF, -1000.0, 0.0))
    path = write_campaign(tmp_path, sea=SEA, matrix=matrix, repeat=2)
    assert check(path)["equal_rows"] == []
