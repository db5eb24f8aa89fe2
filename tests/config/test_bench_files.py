"""The bench's files: one broken file for every rule, and rules between several files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel
from ruamel.yaml import YAML

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.kinds.oswec_bench.config.constants_file import ConstantsFile
from rig.kinds.oswec_bench.config.limits_file import BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SessionFile
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions.check import check_session

CONFIGS = Path(__file__).parents[2] / "configs"
BROKEN = YAML(typ="safe", pure=True).load(Path(__file__).with_name("broken_bench_files.yaml"))

SESSION = """\
name: test
session: driveline
rig: rig.yaml
rows:
  - {amplitude_deg: 5, damping_n_m_s_per_rad: 42, period_s: 1.5}
timing: {rise_s: 1.5, settle_periods: 1, periods: 4}
correction: none
"""
TORQUE = """\
name: test
session: torque_tracking
rig: rig.yaml
grid: [{torque_amplitude_n_m: [20, 40], period_s: 20}]
timing: {rise_s: 5, settle_periods: 0, periods: 3}
shaft: clamped
"""
CONSTANTS = """\
name: torque_constant
rig: OSWEC bench
run: 20261122T110000Z_torque_constant
date: 2026-11-22
constants:
  torque_constant: {value: 16.7, unit: N*m/A, uncertainty: 0.2}
deflection_map: {torque_n_m: [-90, 0, 90], deflection_deg: [-0.2, 0, 0.2]}
"""
HIL_RIG = (CONFIGS / "rigs" / "oswec_bench_hil.yaml").read_text()
HIL_RIG = HIL_RIG.replace("extends: ", f"extends: {CONFIGS / 'rigs'}/")
FILES: dict[str, tuple[str, type[BaseModel]]] = {
    "session": (SESSION, SessionFile),
    "torque": (TORQUE, SessionFile),
    "rig": ((CONFIGS / "rigs" / "oswec_bench.yaml").read_text(), BenchRigFile),
    "wired": (HIL_RIG, BenchRigFile),
    "limits": ((CONFIGS / "limits" / "oswec_bench.yaml").read_text(), BenchLimitsFile),
    "constants": (CONSTANTS, ConstantsFile),
}


@pytest.mark.parametrize("name", FILES)
def test_valid_files_load(name: str, tmp_path: Path) -> None:
    text, model = FILES[name]
    (tmp_path / "x.yaml").write_text(text)
    load(tmp_path / "x.yaml", model)


RULES = [
    pytest.param(name, rule, id=f"{name} {rule['key']}: {rule['message']}")
    for name in FILES
    for rule in BROKEN[name]
]


@pytest.mark.parametrize(("name", "rule"), RULES)
def test_each_rule_reports_line_key_and_message(name: str, rule: Any, tmp_path: Path) -> None:
    text, model = FILES[name]
    assert text.count(rule["old"]) == 1
    path = tmp_path / "x.yaml"
    path.write_text(text.replace(rule["old"], rule["new"]))
    line = rule["line"] or text[: text.index(rule["old"])].count("\n") + 1
    with pytest.raises(ConfigError) as error_info:
        load(path, model)
    reported = [(p.line, p.key, p.message) for p in error_info.value.problems]
    matching = [problem for problem in reported if problem[1] == rule["key"]]
    assert [problem[:2] for problem in matching] == [(line, rule["key"])], reported
    assert rule["message"] in matching[0][2]


def driveline_point(row: int, amplitude: float, damping: float) -> dict[str, float]:
    speed = math.radians(amplitude) * 2.0 * math.pi / 1.5 / math.sqrt(2.0)
    return {
        "row": row, "amplitude_deg": amplitude, "period_s": 1.5, "damping_n_m_s_per_rad": damping,
        "rms_velocity_rad_per_s": speed, "rms_torque_n_m": damping * speed,
        "amplitude_difference_deg": 0.03 + 5e-4 * damping * speed,
        "phase_shift_percent": 0.5 - 0.3 * speed,
    }  # fmt: skip


POINTS = [
    driveline_point(i, a, r) for i, (a, r) in enumerate(((5, 42), (5, 104), (15, 42), (15, 104)))
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the shipped rig and the results of earlier sessions."""
    for kind in ("rigs", "limits"):
        (tmp_path / kind).mkdir()
        text = (CONFIGS / kind / "oswec_bench.yaml").read_text()
        (tmp_path / kind / "oswec_bench.yaml").write_text(text)
    for kind in ("plants", "calibrations"):
        (tmp_path / kind).symlink_to(CONFIGS / kind)
    rig = (tmp_path / "rigs" / "oswec_bench.yaml").read_text()
    (tmp_path / "rig.yaml").write_text(rig.replace("../", ""))
    (tmp_path / "constants.yaml").write_text(CONSTANTS)
    header = {"name": "driveline", "rig": "b", "run": "r1", "date": "2026-11-22"}
    (tmp_path / "driveline.yaml").write_text(json.dumps(header | {"driveline": POINTS}))
    return tmp_path


def reported_problems(folder: Path, text: str, **others: str) -> list[tuple[str, str, str]]:
    for name, content in others.items():
        (folder / f"{name}.yaml").write_text(content)
    (folder / "x.yaml").write_text(text)
    report = check_session(folder / "x.yaml", further_check=problems)
    return [(Path(p.file).name, p.key, p.message) for p in report.problems]


def with_correction(correction: str, rows: str = "") -> str:
    text = SESSION.replace("correction: none", f"correction: {correction}")
    return (
        text.replace("{amplitude_deg: 5, damping_n_m_s_per_rad: 42, period_s: 1.5}", rows)
        if (rows)
        else text
    )


RULES_BETWEEN_FILES = [
    (SESSION.replace("amplitude_deg: 5", "amplitude_deg: 32"), "rows[0].amplitude_deg",
     "32 is more than limits and rig allow; allowed below 32 deg"),
    (SESSION.replace("period_s", "brake_current_a: 1.1, period_s"), "rows[0].brake_current_a",
     "1.1 is more than limits and rig allow; allowed up to 1 A"),
    (TORQUE.replace("[20, 40]", "[20, 130]"), "grid[0].torque_amplitude_n_m[1]",
     "130 is more than limits and rig allow; allowed below 120 N*m"),
    (SESSION.replace("rig.yaml", "none.yaml"), "rig", "No such file"),
    (SESSION + "calibrations: [none.yaml]\n", "calibrations[0]", "No such file"),
    (with_correction("{kind: online, regressions: none.yaml}"), "correction.regressions",
     "No such file"),
    (with_correction("{kind: online, regressions: constants.yaml}"), "correction.regressions",
     "has no driveline; allowed a file that has"),
    (with_correction("{kind: instantaneous, map: driveline.yaml}"), "correction.map",
     "has no deflection_map; allowed a file that has"),
    (with_correction("{kind: online, regressions: driveline.yaml}",
               "{amplitude_deg: 6, damping_n_m_s_per_rad: 42, period_s: 1.5}"),
     "rows[0].amplitude_deg", "no uncorrected row of these conditions in r1"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "key", "message"), RULES_BETWEEN_FILES)
def test_rules_between_files(folder: Path, text: str, key: str, message: str) -> None:
    reported = reported_problems(folder, text)
    assert [problem[:2] for problem in reported] == [("x.yaml", key)], reported
    assert message in reported[0][2]


def test_too_many_rows_are_refused_before_they_are_built(folder: Path) -> None:
    (reported,) = reported_problems(folder, SESSION.replace("rows:\n  -", "repeat: 1000\nrows:\n  - {amplitude_deg: 4, period_s: 1}\n  -"))  # fmt: skip  # noqa: E501
    assert reported[1:] == ("repeat", "2000 rows; allowed at most 1000")


def test_a_regression_needs_three_other_rows(folder: Path) -> None:
    text = with_correction("{kind: online, regressions: driveline.yaml}")
    assert reported_problems(folder, text) == []
    three_points = {
        "name": "d",
        "rig": "b",
        "run": "r2",
        "date": "2026-11-22",
        "driveline": POINTS[:3],
    }
    (reported,) = reported_problems(folder, text, driveline=json.dumps(three_points))
    assert reported[1:] == ("rows[0].amplitude_deg", "2 other rows in r2; a line needs 3")


def test_scales_of_rig_and_simulated_bench_must_agree(folder: Path) -> None:
    rig = (folder / "rig.yaml").read_text().replace("524288", "262144")
    (reported,) = reported_problems(folder, SESSION, rig=rig)
    assert reported[:2] == ("rig.yaml", "shaft_encoder.counts_per_revolution")
    assert "262144 is not the simulated bench's 524288" in reported[2]


def test_problems_of_all_files_are_reported_together(folder: Path) -> None:
    rig = (folder / "rig.yaml").read_text().replace("gear_ratio: 15", "gear_ratio: 0")
    limits = (folder / "limits" / "oswec_bench.yaml").read_text().replace("26\n", "99\n")
    (folder / "limits" / "oswec_bench.yaml").write_text(limits)
    reported = reported_problems(
        folder, SESSION.replace("seed", "sed").replace("5,", "95,"), rig=rig
    )
    assert [problem[0] for problem in reported] == ["x.yaml", "rig.yaml", "oswec_bench.yaml"]


def test_every_shipped_session_can_be_run() -> None:
    sessions = sorted((CONFIGS / "sessions").glob("*.yaml"))
    assert len(sessions) >= 10
    for path in sessions:
        report = check_session(path, further_check=problems)
        assert report.ok, report.text()
        assert json.loads(report.to_json())["rows"]
