"""The command `rig testlog`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from log_books import MASK4_LOG, write_log
from measured_data import needs, reference
from rig_command import rig_here

CALIBRATIONS = Path(__file__).parents[2] / "configs" / "calibrations"
FILE = "waveBotCtrlMdl_2023_09_21_04_46_26"


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")


def rig(*arguments: str | Path) -> tuple[int, str, str]:
    folder = ("--calibrations", CALIBRATIONS) if "--calibrations" not in arguments else ()
    return rig_here("testlog", *arguments, *folder)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(
        tmp_path / "log.xlsx",
        ("MASK4_024", None, FILE, "None", "multisine [10]amps, mag spring @ -12kN/m", "[10A;10B]"),
        (None, None, "*** MAP CORRECTED"),
        ("MASK4_062", 38, None, "0.4 Hz JONSWAP 10 inch Hs gamma = 3.3, 300s repeat 6A",
         "GainMatrix006_2, magK=-6152", "Lost PTP."),
    )  # fmt: skip


def test_prints_a_table(log: Path) -> None:
    code, out, _ = rig(log)
    assert code == 0
    for report in (
        "-12000 -> -9228",
        "*** MAP CORRECTED",
        "38: jonswap 0.4 Hz Hs 0.254 m 6A",
        "no file name; time synchronisation",
        "2 runs, 2 remarks",
        "by mask4_spring_rate v2 (sha256 ",
        "MASK4 runs before 51",
    ):
        assert report in out
    assert "-6152 ->" not in out


def test_prints_one_run_in_full(log: Path) -> None:
    code, out, _ = rig(log, "--run", "24")
    assert code == 0
    assert "-12000 by mask4_spring_rate v2 is -9228" in out
    assert "10 A A, 10 A B" in out
    code, out, _ = rig(log, "--run", "62")
    assert "-6152: outside the range of mask4_spring_rate v2, unchanged" in out
    assert "! F4      time synchronisation: Lost PTP." in out
    code, _, errors = rig(log, "--run", "3")
    assert (code, "no run 3 in the log; it has 24 .. 62" in errors) == (2, True)


def test_prints_json(log: Path) -> None:
    report: dict[str, Any] = json.loads(rig(log, "--json")[1])
    first, second = report["runs"]
    assert first["spring"] == {
        "written_n_per_m": -12000.0, "cell": "E2", "corrected_n_per_m": -9228.0,
        "by": "mask4_spring_rate v2", "valid": True,
    }  # fmt: skip
    assert (second["spring"]["corrected_n_per_m"], second["spring"]["valid"]) == (-6152.0, False)
    assert second["waves"][0]["hs_m"] == 0.254
    assert second["remarks"][1] == {
        "kind": "time synchronisation", "cell": "F4", "text": "Lost PTP.",
    }  # fmt: skip
    assert report["links"]["wave_series"] == {"38": [62]}
    assert report["separators"][0]["before_run"] == 62
    one: dict[str, Any] = json.loads(rig(log, "--run", "24", "--json")[1])
    assert "links" not in one
    assert [run["run"] for run in one["runs"]] == [24]


def test_without_calibrations_rates_stay_as_written(log: Path, tmp_path: Path) -> None:
    code, out, _ = rig(log, "--calibrations", tmp_path / "none")
    assert code == 0
    assert "-12000" in out
    assert "->" not in out
    report = json.loads(rig(log, "--calibrations", tmp_path / "none", "--json")[1])
    assert report["spring_calibration"] is None
    assert report["runs"][0]["spring"] == {"written_n_per_m": -12000.0, "cell": "E2"}


def test_two_calibrations_for_one_series_are_refused(log: Path, tmp_path: Path) -> None:
    text = (CALIBRATIONS / "mask4_spring_rate_v1.yaml").read_text()
    for name in ("first", "second"):
        changed = text.replace("name: mask4_spring_rate", f"name: {name}")
        (tmp_path / f"{name}.yaml").write_text(changed)
    code, _, errors = rig(log, "--calibrations", tmp_path)
    assert code == 2
    assert "several calibrations of spring rates for MASK4: first, second" in errors


def test_invalid_log_is_reported(tmp_path: Path) -> None:
    code, _, errors = rig(tmp_path / "none.xlsx")
    assert (code, "none.xlsx:1: cannot be read" in errors) == (2, True)
    report = json.loads(rig(tmp_path / "none.xlsx", "--json")[1])
    assert report["problems"][0]["file"].endswith("none.xlsx")


@needs(MASK4_LOG)
def test_the_measured_log(monkeypatch: pytest.MonkeyPatch) -> None:
    log = reference(MASK4_LOG)
    code, out, _ = rig(log)
    assert code == 0
    assert "142 runs" in out
    report: dict[str, Any] = json.loads(rig(log, "--json")[1])
    assert [run["run"] for run in report["runs"]] == list(range(1, 143))
    corrected = {
        run["run"]: run["spring"]["corrected_n_per_m"] for run in report["runs"] if run["spring"]
    }
    assert corrected[24] == -9228.0
    assert corrected[62] == -6152.0
