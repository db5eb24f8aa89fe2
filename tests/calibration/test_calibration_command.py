"""`rig calibration` called by a person or a script."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from calibration_files import CALIBRATIONS, write
from log_books import write_log
from rig_command import rig_here

from rig.recording.calibration import open_history

NAME = "mask4_spring_rate"


def rig(*arguments: str | Path, folder: Path = CALIBRATIONS) -> tuple[int, str, str]:
    return rig_here("calibration", *arguments, "--calibrations", folder)


def in_json(*arguments: str | Path, folder: Path = CALIBRATIONS) -> Any:
    return json.loads(rig(*arguments, "--json", folder=folder)[1])


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(
        tmp_path / "log.xlsx",
        ("MASK4_024", None, None, "None", "heave multisine, mag spring @ -12kN/m", ""),
        ("MASK4_036", 16, None, "0.4 Hz Regular wave, 5 inch AMPLITUDE", "GainMatrix002", ""),
        ("MASK4_062", 38, None, '2.5 s 10" Hs JONSWAP', "GainMatrix006_2, magK=-6152", ""),
    )


def test_list_marks_the_valid_version(tmp_path: Path) -> None:
    code, out, _ = rig("list")
    assert code == 0
    first, second, note = out.splitlines()
    assert first.startswith("  mask4_spring_rate v1 ")
    assert second.startswith("* mask4_spring_rate v2 ")
    assert "scale 0.769, MASK4 runs before 51" in second
    assert note.startswith("*")
    listed = in_json("list")
    assert [(one["name"], one["version"]) for one in listed] == [(NAME, 1), (NAME, 2)]
    assert listed[1]["valid"]["runs"]["before"] == 51
    write(tmp_path, correction="{kind: table, recorded: [0, 1], corrected: [1, 3]}")
    assert "table 0 -> 1, 1 -> 3" in rig("list", folder=tmp_path)[1]


def test_show_prints_one_version() -> None:
    code, out, _ = rig("show", NAME)
    assert code == 0
    for report in ("v2", "supersedes   mask4_spring_rate v1", "section 4.1", "values stay"):
        assert report in out
    shown = in_json("show", CALIBRATIONS / "mask4_spring_rate_v1.yaml")
    assert (shown["version"], shown["supersedes"]) == (1, None)
    assert shown["sha256"] == open_history(CALIBRATIONS).find(f"{NAME}@1").sha256
    code, _, errors = rig("show", f"{NAME}@3")
    assert (code, "has no version 3; there are 1, 2" in errors) == (2, True)


def test_values_are_corrected_and_inverted() -> None:
    assert rig("apply", NAME, "-x", "-12000", "--run", "24")[1] == (
        "-12000 by mask4_spring_rate v2 is -9228\n"
    )
    assert rig("apply", NAME, "-x", "-9228", "--run", "MASK4_024", "--invert")[1] == (
        "-9228 was recorded as -12000, before mask4_spring_rate v2\n"
    )
    assert "unchanged" in rig("apply", NAME, "-x", "-6152", "--run", "62")[1]
    assert "unchanged" in rig("apply", NAME, "-x", "-6152", "--run", "62", "--invert")[1]
    assert "is -12000" in rig("apply", f"{NAME}@1", "-x", "-12000", "--run", "24")[1]
    report = in_json("apply", NAME, "-x", "-12000", "-x", "10000", "--run", "24")
    assert [(v["given"], v["value"], v["by"], v["inside"]) for v in report["values"]] == [
        (-12000.0, -9228.0, "mask4_spring_rate v2", True),
        (10000.0, 7690.0, "mask4_spring_rate v2", True),
    ]
    assert report["calibration"]["correction"] == {"kind": "scale", "factor": 0.769}


@pytest.mark.parametrize(
    ("arguments", "report"),
    [
        (("-x", "1"), "no run number is known"),
        (("--run", "24"), "nothing to correct; give --value or --testlog"),
        (("-x", "1", "--run", "abc"), "'abc' is not a run; write 24 or SERIES_024"),
        (("-x", "1", "--date", "26.9.2023"), "'26.9.2023' is not a date; write it as 2023-09-26"),
        (("-x", "nan", "--run", "24"), "nan is not a finite number"),
    ],
)
def test_an_impossible_correction_gives_the_reason(arguments: tuple[str, ...], report: str) -> None:
    code, _, errors = rig("apply", NAME, *arguments)
    assert code == 2
    assert report in errors


def test_a_date_decides_where_dates_are_valid(tmp_path: Path) -> None:
    write(tmp_path, valid="{dates: {before: 2023-09-26}}", outside="refuse")
    assert (
        "8 by one v1 is 4"
        in rig("apply", "one", "-x", "8", "--date", "2023-09-25", folder=tmp_path)[1]
    )
    code, _, errors = rig("apply", "one", "-x", "8", "--date", "2023-09-26", folder=tmp_path)
    assert (code, "one v1 does not hold for 2023-09-26" in errors) == (2, True)


def test_a_corrected_log_names_its_calibration(log: Path, tmp_path: Path) -> None:
    code, out, _ = rig("apply", NAME, "--testlog", log)
    assert code == 0
    assert "MASK4_024      -12000 ->      -9228 N/m\n" in out
    assert "MASK4_062       -6152 ->      -6152 N/m  outside the valid range, unchanged" in out
    path = tmp_path / "rates.csv"
    assert rig("apply", NAME, "--testlog", log, "-o", path)[0] == 0
    known = open_history(CALIBRATIONS).find(NAME)
    first, second, *rows = path.read_text().splitlines()
    assert first.startswith("# spring_rate of log.xlsx (sha256 ")
    assert first.endswith(f"by {known.description()}")
    assert second == "# scale 0.769, MASK4 runs before 51"
    assert rows == [
        "run,field,recorded [N/m],corrected [N/m],valid",
        "MASK4_024,E2,-12000.0,-9228.0,yes",
        "MASK4_062,E4,-6152.0,-6152.0,no",
    ]
    assert rig("apply", NAME, "--testlog", log, "-o", path)[0] == 2  # never overwritten
    assert len(in_json("apply", NAME, "--testlog", log)["values"]) == 2


def test_diff_lists_changes_and_outdated_products(log: Path) -> None:
    code, out, _ = rig("diff", f"{NAME}@1", f"{NAME}@2", "--testlog", log)
    assert code == 0
    for report in (
        "mask4_spring_rate v1 -> mask4_spring_rate v2",
        "correction.factor: 1.0 -> 0.769",
        "2 values changed, 1 unchanged",
        "MASK4_024 E2: -12000 -> -9228 N/m (recorded -12000)",
        "MASK4_036 row 3: spring rates are in GainMatrix002, not in the log",
        "MASK4_036: row table, power surfaces",
    ):
        assert report in out
    report = in_json("diff", f"{NAME}@1", f"{NAME}@2", "--testlog", log)
    assert report["stale"]["MASK4_024"] == ["identified impedance"]
    assert report["changed"][0]["new"] == -9228.0
    code, _, errors = rig("diff", f"{NAME}@1", NAME)
    assert (code, "--testlog, --runs" in errors) == (0, True)


def test_diff_examines_runs(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    run = runs / "20230920T100000Z_a"
    run.mkdir(parents=True)
    (run / "run.json").write_text('{"run": "a", "started_utc": "2023-09-20T10:00:00+00:00"}')
    (run / "config.json").write_text("{}")
    (run / "plan.json").write_text('{"rows": [{"row": 3, "spring_rate": -5715.0}]}')
    (run / "rows.csv").write_text("row\n3\n")
    valid = "{dates: {from: 2023-09-01}}"
    old = write(tmp_path, valid=valid)
    new = write(
        tmp_path, valid=valid, version=2, supersedes=1, correction="{kind: scale, factor: 0.769}"
    )
    code, out, _ = rig("diff", old, new, "--runs", runs)
    assert code == 0
    assert "20230920T100000Z_a row 3: -2857.5 -> -4394.835 N/m (recorded -5715)" in out
    assert "20230920T100000Z_a: rows.csv" in out
    code, out, _ = rig("diff", f"{NAME}@1", NAME, "--runs", runs)
    assert "0 values changed, 0 unchanged" in out
    assert "undecided" in out
    code, _, errors = rig("diff", old, f"{NAME}@1")
    assert (code, "do not correct the same thing" in errors) == (2, True)


def test_a_broken_file_is_reported_with_its_line(tmp_path: Path) -> None:
    write(tmp_path, outside="never")
    code, _, errors = rig("list", folder=tmp_path)
    assert (code, "one_1.yaml:7: outside: " in errors) == (2, True)
    assert in_json("list", folder=tmp_path)["problems"][0]["line"] == 7
    assert "no such folder" in rig("list", folder=tmp_path / "none")[2]
