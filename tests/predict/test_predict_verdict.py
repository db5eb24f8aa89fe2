"""Refusals of rows that would trip or be unstable, and warnings of rows near a limit."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from command_here import rig
from predicting import (
    CONFIGS,
    SOFT,
    STIFF,
    check_report,
    custom_rig,
    predict_campaign,
    rows,
    write_campaign,
    write_named_yaml,
)

from rig.design.margin import Margin, tightest
from rig.kinds.wavebot.predictions.verdict import BUS, LOOP, POSITION

WAVES = {"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.4}
SMALL = {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5}


def limit_line(path: Path, key: str, nth: int = 0) -> int:
    """Return the line of a key in a shipped file."""
    line_numbers = [
        n for n, text in enumerate(path.read_text().splitlines(), 1) if f"{key}:" in text
    ]
    return line_numbers[nth]


def test_a_row_beyond_the_position_limit_is_named(tmp_path: Path) -> None:
    path = write_campaign(
        tmp_path, sea=WAVES, matrix=rows((STIFF, -2000.0, 0.0), (-8508.0, -200.0, 2000.0))
    )
    report = check_report(path)
    assert not report.ok
    assert report.campaign is None
    (problem,) = report.problems
    lines = path.read_text().splitlines()
    assert "-200" in lines[problem.line - 1]
    assert problem.key == "matrix.list[1].kp_n_s_per_m"
    assert problem.file.endswith("campaign.yaml")
    assert "row 1 (spring -8508 N/m, Kp -200 N*s/m, Ki 2000 N/m)" in problem.message
    match = re.search(
        r"predicted position peak (\d\.\d+) m, allowed up to 0\.35 m", problem.message
    )
    assert match is not None
    assert 0.35 < float(match.group(1)) < 0.45
    line = limit_line(CONFIGS / "limits" / "wavebot.yaml", "position_stop_m")
    assert f"limits/wavebot.yaml:{line}: heave.position_stop_m" in problem.message
    assert "spring.map[7].stroke_m" in problem.message  # the station of -8508 N/m
    allowed = [one for one in predict_campaign(path).rows if not any(one.blocking())]
    assert [one.row.row for one in allowed] == [0]


def test_an_unstable_row_is_named(tmp_path: Path) -> None:
    """Z_c drives with 4500 N*s/m; only a sufficient Kp stabilises it."""
    path = write_campaign(
        tmp_path,
        sea=SMALL,
        matrix=rows((STIFF, -6000.0, 0.0), (STIFF, -100.0, 0.0)),
        law={"zc": {"numerator": [90000.0], "denominator": [1.0, 20.0]}},
    )
    report = check_report(path)
    (problem,) = report.problems
    assert problem.key == "matrix.list[1].kp_n_s_per_m"
    assert "row 1 (spring 490.9 N/m, Kp -100 N*s/m, Ki 0 N/m)" in problem.message
    assert "the sampled heave loop is unstable" in problem.message
    stable = re.search(r"stable up to ([0-9.]+) times these gains", problem.message)
    assert stable is not None
    assert 0.2 < float(stable.group(1)) < 1.0
    assert predict_campaign(path).rows[1].predicted.spectral_radius > 1.0
    assert predict_campaign(path).rows[0].predicted.spectral_radius < 1.0


@pytest.mark.parametrize(
    ("sea", "limit", "side"),
    [
        (
            {"kind": "regular", "amplitude_m": 0.15, "frequency_hz": 0.4},
            "overvoltage_trip",
            "up to",
        ),
        ({**SMALL, "amplitude_m": 0.01}, "undervoltage_share", "at least"),
    ],
)
def test_a_bus_that_trips_is_named(
    sea: dict[str, Any], limit: str, side: str, tmp_path: Path
) -> None:
    """Without supply and dump the bus stores all wave power, or runs out of energy."""
    island = "wavebot_custom_islanded.yaml"
    path = write_campaign(
        tmp_path,
        rig=str(custom_rig(tmp_path, island, discharge_level=0)),
        sea=sea,
        matrix=rows((-8508.0, -2500.0, 0.0)),
    )
    report = check_report(path)
    (problem,) = report.problems
    line = limit_line(CONFIGS / "plants" / "wavebot_custom.yaml", limit)
    assert "row 0 (spring -8508 N/m" in problem.message
    assert re.search(rf"predicted bus voltage [0-9.e+]+ V, allowed {side} \d+ V", problem.message)
    assert f"plants/wavebot_custom.yaml:{line}: drive.{limit}" in problem.message


def test_undervoltage_before_the_first_wave_is_named(tmp_path: Path) -> None:
    """51 J above the trip of a 40 V bus last 8 s at 6.4 W, and the stator move takes 9 s."""
    path = write_campaign(
        tmp_path,
        rig=str(custom_rig(tmp_path, "wavebot_custom_islanded.yaml", bus_voltage_v=40)),
        sea={**WAVES, "amplitude_m": 0.1},
        tare={"duration_s": 1},
        start={"lead_in_s": 20},
        matrix=rows((-8508.0, -2500.0, 0.0)),
    )
    (problem,) = check_report(path).problems
    assert "predicted bus voltage" in problem.message
    assert "allowed at least 24 V" in problem.message


def test_the_commercial_bus_has_a_limit(tmp_path: Path) -> None:
    limits = write_named_yaml(
        tmp_path,
        "limits.yaml",
        {"extends": str(CONFIGS / "limits" / "wavebot.yaml"), "bus": {"voltage_stop_v": 150.05}},
    )
    rig_file = write_named_yaml(
        tmp_path,
        "rig.yaml",
        {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "limits": str(limits)},
    )
    path = write_campaign(
        tmp_path, rig=str(rig_file), sea=WAVES, matrix=rows((STIFF, -2000.0, 0.0))
    )
    (problem,) = check_report(path).problems
    assert "bus voltage" in problem.message
    assert "limits.yaml:" in problem.message
    assert "bus.voltage_stop_v" in problem.message


def test_a_warning_refuses_nothing(tmp_path: Path) -> None:
    """Beyond position_warn, near the stop, more current than the drive has: only warnings."""
    path = write_campaign(
        tmp_path,
        sea={**WAVES, "amplitude_m": 0.33},
        surge={"use": "hold"},
        matrix=rows((-8508.0, -1600.0, 0.0)),
    )
    report = check_report(path)
    assert report.ok, report.text()
    assert report.prediction is not None
    (warning,) = report.prediction.warnings
    assert "heave.position_warn_m" in warning.message
    assert "a stop is near" in warning.message


def test_current_beyond_the_limit_is_a_warning(tmp_path: Path) -> None:
    sea = {"kind": "regular", "amplitude_m": 0.2, "frequency_hz": 0.5}
    path = write_campaign(tmp_path, sea=sea, matrix=rows((8340.0, -100.0, 30000.0)))
    forecast = predict_campaign(path)
    assert forecast.refused == ()
    (warning,) = forecast.warnings
    assert "heave.current_peak_a), force is cut there" in warning.message
    assert "heave.current_rms_a), force is cut there" in warning.message
    assert "with 5 s of settling" in warning.message
    assert "of a change of gains remains in the mean over 14 s" in warning.message


def test_the_lead_in_is_checked_as_a_row(tmp_path: Path) -> None:
    """The lead-in has no Ki, so the body may move more in it than in the first row."""
    path = write_campaign(
        tmp_path,
        sea={**WAVES, "amplitude_m": 0.33},
        surge={"use": "hold"},
        matrix=rows((-8508.0, -2000.0, 0.0)),
        start={"set_point": {"kp_n_s_per_m": -100.0, "ki_n_per_m": 0.0}},
    )
    (problem,) = check_report(path).problems
    assert problem.key == "start.set_point.kp_n_s_per_m"
    assert problem.message.startswith("the lead-in (spring -8508 N/m, Kp -100 N*s/m")


def test_repetitions_of_a_point_are_one_problem(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, sea=WAVES, matrix=rows((-8508.0, -200.0, 2000.0)), repeat=3)
    forecast = predict_campaign(path)
    assert len(forecast.rows) == 3
    messages = [one.message for one in forecast.refused]
    assert any("row 0 and 2 more of point 0" in message for message in messages)


def test_run_refuses_what_check_refuses(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, sea=WAVES, matrix=rows((-8508.0, -200.0, 2000.0)))
    runs = tmp_path / "runs"
    completed = rig("run", path, "--runs", runs)
    assert completed.returncode == 2
    assert "row 0 (spring -8508 N/m" in completed.stdout
    assert not runs.exists()
    report = json.loads(rig("run", path, "--runs", runs, "--json").stdout)
    assert report["status"] == "bad input"
    assert report["problems"][0]["key"] == "matrix.list[0].kp_n_s_per_m"


def test_tightest_excludes_warning_limits(tmp_path: Path) -> None:
    path = write_campaign(
        tmp_path, sea=SMALL, matrix=rows((STIFF, -2000.0, 0.0), (SOFT, -2000.0, 4000.0))
    )
    for one in predict_campaign(path).rows:
        tightest_margin = tightest(one.margins)
        assert tightest_margin.limit.effect != "warn"
        assert all(tightest_margin.used >= m.used for m in one.margins if m.limit.effect != "warn")
        assert 0.0 < tightest_margin.used < 1.0


@pytest.mark.parametrize(
    ("margin", "used"),
    [
        (Margin(POSITION, 0.28, 0.35), 0.8),
        (Margin(POSITION, float("nan"), 0.35), float("inf")),
        (Margin(LOOP, 2.0, 1.0), 0.5),
        (Margin(LOOP, 0.0, 1.0), float("inf")),
        (Margin(BUS, 160.0, 200.0, 150.0), 0.2),
        (Margin(BUS, 160.0, 140.0, 150.0), float("inf")),
    ],
)
def test_used_share_of_a_limit(margin: Margin, used: float) -> None:
    assert margin.used == pytest.approx(used)
    assert margin.exceeded is (not used <= 1.0)
