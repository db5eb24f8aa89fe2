"""Output of `rig check` on 100 columns and as JSON."""

from __future__ import annotations

import io
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command_here import rig
from predicting import (
    CONFIGS,
    STIFF,
    check_report,
    custom_rig,
    predict_campaign,
    rows,
    write_campaign,
)
from rich.console import Console

from rig.kinds.wavebot.check_view import CheckView
from rig.kinds.wavebot.predictions.prediction import RowPredictions

SEA = {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5}


def shown(path: Path, *, every_row: bool = False, width: int = 100) -> str:
    """Return the view of a campaign in a terminal of a given width."""
    out = io.StringIO()
    console = Console(file=out, width=width, highlight=False)
    CheckView(every_row=every_row, console=console).show(check_report(path))
    return out.getvalue()


def test_the_default_campaign_fits_into_100_columns() -> None:
    text = shown(CONFIGS / "campaigns" / "default.yaml")
    assert max(len(line.rstrip()) for line in text.splitlines()) <= 100
    assert len(text.splitlines()) < 45
    assert "\N{HORIZONTAL ELLIPSIS}" not in text  # no truncated cell
    assert "66 (66 points x 1)" in text
    assert "8 of 66 rows" in text


def test_the_best_row_is_named_if_kp_and_ki_are_ambiguous() -> None:
    text = shown(CONFIGS / "campaigns" / "mask4_run_120_short.yaml", width=130)
    line = next(line for line in text.splitlines() if line.startswith(" -8508"))
    best_rows = re.findall(r"(-?[\d.]+) at row (\d+)", line)
    assert len(best_rows) == 3
    assert "-2500/3000" not in line
    table = text[text.index("row spring") :]
    powers = {cells[0]: cells for cells in map(str.split, table.splitlines()) if cells}
    assert float(powers[best_rows[2][1]][14]) == float(best_rows[2][0])  # DC, the best of the eight
    assert float(best_rows[2][0]) == min(float(powers[str(i)][14]) for i in range(8))
    default = shown(CONFIGS / "campaigns" / "default.yaml", width=130)
    assert " at row " not in default
    assert "at -2000/2000" in default


def test_a_narrow_terminal_shows_fewer_columns_without_truncation() -> None:
    text = shown(CONFIGS / "campaigns" / "default.yaml", width=80)
    table = text[text.index("Predicted, by") :]
    assert max(len(line.rstrip()) for line in table.splitlines()) <= 80
    assert "\N{HORIZONTAL ELLIPSIS}" not in table
    assert "surge" not in table


def test_every_row_is_shown_on_request(tmp_path: Path) -> None:
    gains = [(STIFF, -1000.0 - 100.0 * i, 0.0) for i in range(12)]
    path = write_campaign(tmp_path, sea=SEA, matrix=rows(*gains))
    default, complete = shown(path), shown(path, every_row=True)
    assert sum(f" {kp:g} " in complete for _, kp, _ in gains) == 12
    assert sum(f" {kp:g} " in default for _, kp, _ in gains) < 12


def test_refusals_and_limits_are_shown_in_full(tmp_path: Path) -> None:
    sea = {"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.4}
    gains = [(STIFF, -2000.0, 0.0), (-8508.0, -200.0, 2000.0)]
    path = write_campaign(tmp_path, sea=sea, matrix=rows(*gains))
    text = shown(path)
    (problem,) = predict_campaign(path).refused
    assert problem.text() in text  # in one line, for copying
    assert "refused: 1" in text


def test_varying_columns_are_shown(tmp_path: Path) -> None:
    gains = (-8508.0, -2500.0, 3000.0)
    matrix = rows(gains, bus_voltage_v=75.0)
    matrix["list"] += rows(gains, bus_voltage_v=40.0)["list"]
    path = write_campaign(tmp_path, rig=str(custom_rig(tmp_path)), sea=SEA, matrix=matrix)
    text = shown(path)
    assert " bus " in text
    assert "hyst" not in text


def text_and_travel(tmp_path: Path, order: str) -> Any:
    gains = [(-8508.0, -2000.0, 0.0), (8340.0, -2000.0, 0.0)] * 3
    path = write_campaign(
        tmp_path, sea={**SEA, "amplitude_m": 0.05}, matrix=rows(*gains), order=order
    )
    return shown(path), predict_campaign(path).travel


def test_equivalent_orders_share_a_line(tmp_path: Path) -> None:
    gains = [(490.9, -2000.0, 0.0), (490.9, -1500.0, 0.0)]
    text = shown(write_campaign(tmp_path, sea=SEA, matrix=rows(*gains), order="random"))
    assert "as given, fewest spring moves: nothing to save" in text


def test_another_order_saves_moves_and_seconds(tmp_path: Path) -> None:
    text, (current, alternative) = text_and_travel(tmp_path, "as given")
    assert (current.moves, alternative.moves) == (5, 1)
    # Stator at 47 % and -93 %: 140 % per move at 0.010 m/s over 0.15 m per 100 %, 21 s each. The
    # plan allows 20 s per move and then waits. The first row is 60 % away from the start.
    assert current.moving_time == pytest.approx(9.0 + 5 * 21.0)
    assert current.waiting_time == pytest.approx(8.5 + 5 * 1.0)
    assert current.distance == pytest.approx(60.0 + 5 * 140.0)
    assert current.duration - alternative.duration == pytest.approx(4 * 21.0)
    assert "fewest spring moves: saves 4 moves and 1 min 24 s" in text
    text, (current, alternative) = text_and_travel(tmp_path, "fewest spring moves")
    assert (current.moves, alternative.moves) == (1, 5)
    assert "as given: costs 4 moves and 1 min 24 s" in text


def numbers(value: Any) -> Any:
    """Yield every number of a JSON value."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, float):
        yield value


def test_json_is_complete_and_without_nan(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, sea=SEA, matrix=rows((STIFF, -2000.0, 0.0)), repeat=2)
    completed = rig("check", path, "--json")
    assert completed.returncode == 0, completed.stderr

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    report = json.loads(completed.stdout, parse_constant=refuse)
    assert (report["ok"], report["rows"], report["problems"]) == (True, 2, [])
    first = report["predictions"][0]
    assert set(RowPredictions._fields) <= set(first)
    assert first["spring_rate"] == STIFF
    limits = {margin["limit"] for margin in first["margins"]}
    assert {
        "position", "position warn", "spring stroke", "rotor travel", "velocity", "current peak",
        "current rms", "bus voltage", "stiffness", "loop gain", "surge position", "surge gain",
    } <= limits  # fmt: skip
    assert all(math.isfinite(value) for value in numbers(report))
    assert [one["order"] for one in report["orders"]] == ["as given", "fewest spring moves"]
    assert report["lead_in_prediction"] is None


def test_a_refused_campaign_is_reported_with_its_predictions(tmp_path: Path) -> None:
    sea = {"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.4}
    path = write_campaign(tmp_path, sea=sea, matrix=rows((-8508.0, -200.0, 2000.0)))
    report = json.loads(check_report(path).to_json())
    assert not report["ok"]
    assert report["rows"] == 1
    assert report["predictions"][0]["position_peak"] > 0.35
    assert any(margin["broken"] for margin in report["predictions"][0]["margins"])


@pytest.mark.parametrize("sea", [{"kind": "calm"}, None], ids=["calm", "without the device"])
def test_calm_water_and_an_absent_device_are_accepted(
    sea: dict[str, Any] | None, tmp_path: Path
) -> None:
    path = CONFIGS / "campaigns" / "wave_calibration.yaml"
    if sea is not None:
        path = write_campaign(tmp_path, sea=sea, matrix=rows((STIFF, -2000.0, 0.0)))
    report = check_report(path)
    assert report.ok, report.text()
    if sea is None:
        assert report.prediction is None
        assert "predictions" not in json.loads(report.to_json())
    else:
        assert predict_campaign(path).rows[0].predicted.position_peak == 0.0
        assert "refused" not in shown(path)


def used_seconds(*arguments: str | Path) -> float:
    """Return the processor time of a command, s, which other load does not affect."""
    before = os.times()
    completed = subprocess.run(
        [sys.executable, "-m", "rig", *map(str, arguments)], capture_output=True, check=False
    )
    assert completed.returncode == 0
    after = os.times()
    return (after.children_user + after.children_system) - (
        before.children_user + before.children_system
    )


def test_check_is_fast(tmp_path: Path) -> None:
    """3 s for the default campaign, 10 s for 99 rows of 300 s of irregular waves.

    The limits are doubled because other load on the same core can take half of it.
    """
    assert used_seconds("check", CONFIGS / "campaigns" / "default.yaml") < 6.0
    gains = [(STIFF, kp, 100.0 * i) for kp in (-1000.0, -2000.0, -3000.0) for i in range(33)]
    path = write_campaign(
        tmp_path,
        sea={"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 300},
        matrix=rows(*gains),
    )
    assert used_seconds("check", path) < 20.0
