"""`rig check` and `rig run` warn of a spring map that is not valid on the day of the run."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.kinds.wavebot.campaign import check_campaign

MAP = """\
name: spring_map
version: 1
quantity: spring_map
unit: N/m
correction:
  kind: table
  recorded: [-50, 50]
  corrected: [4000, -9000]
stroke_m: [0.5, 0.5]
valid: {valid}
outside: {outside}
source: a test
reason: to see
"""


def campaign(folder: Path, valid: str, outside: str = "refuse", **keys: Any) -> Path:
    """Write a campaign of three seconds on a rig with a spring map of the given validity."""
    (folder / "map.yaml").write_text(MAP.format(valid=valid, outside=outside))
    wavebot = str(CONFIGS / "rigs" / "wavebot.yaml")
    write_yaml(folder / "rig.yaml", {"extends": wavebot, "spring_map": "map.yaml"})
    return write_yaml(
        folder / "campaign.yaml",
        {
            "name": "dated",
            "rig": "rig.yaml",
            "sea": {"kind": "regular", "amplitude_m": 0.02, "frequency_hz": 1.0},
            "matrix": {"list": [{"spring_n_per_m": 0, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
            "tare": {"duration_s": 1},
            "start": {"set_point_s": 0, "lead_in_s": 1},
            "timing": {"settle_s": 1, "interval_s": 2},
            **keys,
        },
    )


@pytest.mark.parametrize(
    ("day", "warnings"),
    [("2026-03-01", 0), ("2026-05-31", 0), ("2026-02-28", 1), ("2026-06-01", 1)],
)
@pytest.mark.parametrize("outside", ["refuse", "unchanged"])
def test_a_day_outside_the_validity_gives_a_warning_with_file_and_line(
    day: str, warnings: int, outside: str, tmp_path: Path
) -> None:
    path = campaign(tmp_path, "{dates: {from: 2026-03-01, before: 2026-06-01}}", outside)
    report = check_campaign(path, day=date.fromisoformat(day))
    assert report.ok
    assert len(report.warnings) == warnings
    for warning in report.warnings:
        assert Path(warning.file) == tmp_path / "map.yaml"
        assert (warning.line, warning.key) == (10, "spring_map.valid")
        validity = "valid for dates from 2026-03-01 before 2026-06-01"
        assert f"spring_map v1 does not hold on {day}: {validity}" in warning.message
        assert report.text().endswith(f"warning: {warning.text()}")
    assert check_campaign(path).warnings == ()  # the day of the run is not given


def test_a_validity_by_run_number_gives_a_warning(tmp_path: Path) -> None:
    path = campaign(tmp_path, "{runs: {series: MASK4, before: 51}}")
    (warning,) = check_campaign(path, day=date(2026, 3, 1)).warnings
    assert "no run number is known" in warning.message


def test_a_rig_without_a_measured_map_gives_no_warning() -> None:
    assert check_campaign(CONFIGS / "campaigns" / "quick.yaml", day=date(1990, 1, 1)).warnings == ()


def test_check_and_run_use_the_date_of_the_host(tmp_path: Path) -> None:
    """Both commands use the host's date; a map valid before 2001 is never valid."""
    path = campaign(tmp_path, "{dates: {before: 2001-01-01}}")
    code, out, _ = rig_here("check", path, "--json")
    assert code == 0
    assert json.loads(out)["warnings"][0]["key"] == "spring_map.valid"
    code, out, _ = rig_here("check", path)
    assert code == 0
    assert "spring_map v1 does not hold on" in out
    code, out, err = rig_here("run", path, "--runs", tmp_path / "runs", "--json")
    assert code == 0, err
    assert "before 2001-01-01" in json.loads(out)["warnings"][0]["message"]
