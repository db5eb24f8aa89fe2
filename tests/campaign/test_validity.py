"""A spring map out of its validity is warned of by who checks and by who runs."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, yaml_file
from rig_command import rig_here

from rig.planning.campaign import check

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
    """Three seconds on a rig with a spring map of that validity."""
    (folder / "map.yaml").write_text(MAP.format(valid=valid, outside=outside))
    wavebot = str(CONFIGS / "rigs" / "wavebot.yaml")
    yaml_file(folder / "rig.yaml", {"extends": wavebot, "spring_map": "map.yaml"})
    return yaml_file(
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
    ("day", "told"),
    [("2026-03-01", 0), ("2026-05-31", 0), ("2026-02-28", 1), ("2026-06-01", 1)],
)
@pytest.mark.parametrize("outside", ["refuse", "unchanged"])
def test_a_day_outside_is_told_with_file_and_line(
    day: str, told: int, outside: str, tmp_path: Path
) -> None:
    path = campaign(tmp_path, "{dates: {from: 2026-03-01, before: 2026-06-01}}", outside)
    report = check(path, day=date.fromisoformat(day))
    assert report.ok
    assert len(report.warnings) == told
    for one in report.warnings:
        assert Path(one.file) == tmp_path / "map.yaml"
        assert (one.line, one.key) == (10, "spring_map.valid")
        said = "valid for dates from 2026-03-01 before 2026-06-01"
        assert f"spring_map v1 does not hold on {day}: {said}" in one.message
        assert report.text().endswith(f"warning: {one.text()}")
    assert check(path).warnings == ()  # nobody said when it is to run


def test_a_validity_by_run_number_cannot_be_told(tmp_path: Path) -> None:
    path = campaign(tmp_path, "{runs: {series: MASK4, before: 51}}")
    (one,) = check(path, day=date(2026, 3, 1)).warnings
    assert "no run number is known" in one.message


def test_a_rig_without_a_measured_map_has_nothing_to_tell() -> None:
    assert check(CONFIGS / "campaigns" / "quick.yaml", day=date(1990, 1, 1)).warnings == ()


def test_check_and_run_warn_of_today(tmp_path: Path) -> None:
    """Both by the host's date; a map that held in 2001 alone holds on none of them."""
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
