"""The command `rig matrix`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rig_command import rig_here

from rig.interop.legacy import mask4
from rig.interop.legacy.matrix import read_csv
from rig.kinds.wavebot.campaign import check_campaign

CONFIGS = Path(__file__).parents[2] / "configs"
CALIBRATIONS = CONFIGS / "calibrations"
MATRIX = (
    "Kp,Ki,springK\n-500,0,-10000\n-2000,0,-10000\n-2000,0,-10000\n"
    "-2000,0,500\n-2000,0,500\n-999,0,500\n"
)


def rig(*arguments: str | Path) -> tuple[int, str, str]:
    return rig_here("matrix", *arguments)


def in_json(*arguments: str | Path) -> tuple[int, dict[str, Any]]:
    code, out, _ = rig(*arguments, "--json")
    return code, json.loads(out)


@pytest.fixture
def legacy_file(tmp_path: Path) -> Path:
    path = tmp_path / "GainMatrix002.csv"
    path.write_text(MATRIX)
    return path


def test_reports_the_role_of_every_line(legacy_file: Path) -> None:
    code, out, _ = rig(legacy_file, "--style", "mask4")
    assert code == 0
    for report in (
        "2 rows, 2 spring rates, 1 x Kp, 1 x Ki: lines 4, 6",
        "line 2: load row, about 5 s",
        "line 3: hold row, until 120 s of the wave clock",
        "line 5: doubled at a change of the spring rate",
        "line 7: Kp = -999",
    ):
        assert report in out
    code, report_json = in_json(legacy_file, "--style", "mask4")
    assert report_json["lines"] == {
        "measured": [4, 6], "lead": [2, 3], "doubled": [5], "undoubled": [], "repeated": [],
        "end": 7, "after_end": [],
    }  # fmt: skip
    assert report_json["matrix"]["rows"] == [[-10000.0, -2000.0, 0.0], [500.0, -2000.0, 0.0]]
    assert report_json["written"] is None


def test_reports_every_problem_as_text_and_json(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text("Kp,Ki,springK\n-1,x,3\n-1,nan,\n")
    code, _, errors = rig(path, "--style", "mask4")
    assert code == 2
    assert len(errors.splitlines()) == 3
    assert "bad.csv:2:2: ki_n_per_m: 'x' is not a number" in errors
    code, report = in_json(path, "--style", "mask4")
    assert code == 2
    assert [(p["line"], p["column"], p["key"]) for p in report["problems"]] == [
        (2, 2, "ki_n_per_m"), (3, 2, "ki_n_per_m"), (3, 3, "spring_n_per_m"),
    ]  # fmt: skip


def test_converted_matrix_names_its_calibration(legacy_file: Path, tmp_path: Path) -> None:
    new = tmp_path / "new.csv"
    arguments = (legacy_file, "--style", "mask4", "--to", new, "--calibrations", CALIBRATIONS)
    code, _, _ = rig(*arguments, "--calibration", "mask4_spring_rate", "--run", "36")
    assert code == 0
    text = new.read_text()
    assert "# from GainMatrix002.csv (MASK4)" in text
    assert "by mask4_spring_rate v2 (sha256 " in text
    assert "for run 36, MASK4 runs before 51" in text
    assert [row[0] for row in read_csv(new)[0].rows] == [-7690.0, 384.5]
    assert rig(*arguments)[0] == 2  # the file exists already
    later = (*arguments, "--force", "--calibration", "mask4_spring_rate", "--run", "62")
    assert rig(*later)[0] == 0
    assert [row[0] for row in read_csv(new)[0].rows] == [-10000.0, 500.0]
    assert "outside its range, unchanged" in new.read_text()
    code, _, errors = rig(*arguments, "--force", "--calibration", "mask4_spring_rate")
    assert code == 2
    assert "give --run" in errors


def test_converted_campaign_extends_another(legacy_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "deeper" / "from_mask4.yaml"
    path.parent.mkdir()
    arguments = (legacy_file, "--style", "mask4", "--to", path)
    code, _, errors = rig(*arguments)
    assert code == 2
    assert "--campaign" in errors
    base = CONFIGS / "campaigns" / "default.yaml"
    assert rig(*arguments, "--campaign", base)[0] == 0
    report = check_campaign(path)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.campaign.file.name == "from_mask4"
    rows = [(p.spring_rate, p.kp, p.ki) for p in report.campaign.points]
    assert rows == [(-10000.0, -2000.0, 0.0), (500.0, -2000.0, 0.0)]


def test_invalid_row_is_reported_at_its_line_of_the_legacy_file(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text("Kp,Ki,springK\n-1,0,0\n500,0,0\n500,0,0\n-999,0,0\n")
    assert rig(path, "--style", "mask4")[0] == 0
    code, _, errors = rig(path, "--style", "mask4", "--to", tmp_path / "new.csv")
    assert code == 2
    assert "m.csv:4:1: kp_n_s_per_m: 500 is out of range" in errors
    assert not (tmp_path / "new.csv").exists()


@pytest.mark.parametrize("name", ["g.csv", "g.xlsx"])
def test_legacy_file_is_written_from_todays_matrix(tmp_path: Path, name: str) -> None:
    todays_file = CONFIGS / "campaigns" / "csv_matrix.csv"
    path = tmp_path / name
    code, out, _ = rig(path, "--style", "mask4", "--from", todays_file)
    assert code == 0
    assert "14 rows with load, hold, doubled and end rows" in out
    assert mask4.read(path).matrix == read_csv(todays_file)[0]
    code, _, errors = rig(path, "--style", "mask4", "--from", todays_file)
    assert code == 2
    assert "--force overwrites it" in errors
    assert (
        in_json(path, "--style", "mask4", "--from", todays_file, "--force", "--no-header")[0] == 0
    )
    assert mask4.read(path, "Kp,Ki,springK").matrix == read_csv(todays_file)[0]
    assert rig(tmp_path / "x.csv", "--style", "lupa", "--from", todays_file)[0] == 2


def test_gains_of_other_rigs_need_a_statement_to_be_converted(tmp_path: Path) -> None:
    path, new = tmp_path / "l.csv", tmp_path / "new.csv"
    path.write_text("0,0\n-300,1400\n0,1450\n0,0\n")
    code, out, _ = rig(path, "--style", "lupa", "--step-s", "25")
    assert code == 0
    assert "lines 1, 4: all gains zero, before and after the test" in out
    assert "index 0 at time 0 (out of range) and repeats row 1 after 100 s" in out
    assert "give --lever-m, --gear, --positive-damping" in out
    code, _, errors = rig(path, "--style", "lupa", "--to", new)
    assert code == 2
    assert "--lever-m" in errors
    report = ("--lever-m", "0.0636651", "--gear", "1", "--positive-damping", "absorbs",
            "--spring-n-per-m", "0")  # fmt: skip
    assert rig(path, "--style", "lupa", "--to", new, *report)[0] == 0
    assert read_csv(new)[0].rows == ((0.0, -1400.0, 300.0), (0.0, -1450.0, 0.0))
    assert "lever 0.0636651 m, gear 1, positive damping absorbs" in new.read_text()
    code, converted = in_json(path, "--style", "lupa", "--torque-constant-ratio", "0.924", *report)
    assert converted["factor"] == pytest.approx(0.924, rel=1e-12)
    assert converted["lines"] == {"active": [2, 3], "zero_before": [1], "zero_after": [4]}


def test_steps_become_the_interval_of_a_campaign(tmp_path: Path) -> None:
    path, new = tmp_path / "f.csv", tmp_path / "new.yaml"
    path.write_text("0,500,0,0,0,0,0,0\n0,600,0,0,0,0,0,0\n")
    report = ("--lever-m", "0.5", "--gear", "3.75", "--positive-damping", "absorbs",
            "--spring-n-per-m", "490.9", "--flap", "aft", "--step-s", "31")  # fmt: skip
    base = CONFIGS / "campaigns" / "default.yaml"
    code, _, errors = rig(path, "--style", "foswec", "--to", new, "--campaign", base, *report)
    assert code == 0, errors
    report = check_campaign(new)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.campaign.file.timing.interval_s == 31.0
    assert [p.kp for p in report.campaign.points] == [-2000.0, -2400.0]
    assert rig(path, "--style", "foswec", "--step-s", "0")[0] == 2
