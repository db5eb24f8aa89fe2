"""What `rig check` shows, on 100 columns and as JSON."""

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
from predicting import CONFIGS, STIFF, custom_rig, examined, predicted, rows, write_campaign
from rich.console import Console

from rig.cli.check_view import CheckView
from rig.design.predictions import RowPredictions

SEA = {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5}


def shown(path: Path, *, every_row: bool = False, width: int = 100) -> str:
    """The view of a campaign in a terminal of a width."""
    out = io.StringIO()
    console = Console(file=out, width=width, highlight=False)
    CheckView(every_row=every_row, console=console).show(examined(path))
    return out.getvalue()


def test_the_default_campaign_fits_into_100_columns() -> None:
    text = shown(CONFIGS / "campaigns" / "default.yaml")
    assert max(len(line.rstrip()) for line in text.splitlines()) <= 100
    assert len(text.splitlines()) < 45
    assert "\N{HORIZONTAL ELLIPSIS}" not in text  # nothing is cut
    assert "66 (66 points x 1)" in text
    assert "the campaign can be run" in text
    assert "8 of 66 rows" in text


def test_the_best_row_is_named_where_kp_and_ki_do_not_tell_it() -> None:
    text = shown(CONFIGS / "campaigns" / "mask4_run_120_short.yaml", width=130)
    line = next(line for line in text.splitlines() if line.startswith(" -8508"))
    found = re.findall(r"(-?[\d.]+) at row (\d+)", line)
    assert len(found) == 3
    assert "-2500/3000" not in line
    table = text[text.index("row spring") :]
    powers = {cells[0]: cells for cells in map(str.split, table.splitlines()) if cells}
    assert float(powers[found[2][1]][14]) == float(found[2][0])  # DC, the best of the eight
    assert float(found[2][0]) == min(float(powers[str(i)][14]) for i in range(8))
    default = shown(CONFIGS / "campaigns" / "default.yaml", width=130)
    assert " at row " not in default
    assert "at -2000/2000" in default


def test_a_narrow_terminal_gets_fewer_columns_not_cut_ones() -> None:
    text = shown(CONFIGS / "campaigns" / "default.yaml", width=80)
    table = text[text.index("Predicted, by") :]
    assert max(len(line.rstrip()) for line in table.splitlines()) <= 80
    assert "\N{HORIZONTAL ELLIPSIS}" not in table
    assert "surge" not in table


def test_every_row_is_shown_when_asked(tmp_path: Path) -> None:
    gains = [(STIFF, -1000.0 - 100.0 * i, 0.0) for i in range(12)]
    path = write_campaign(tmp_path, sea=SEA, matrix=rows(*gains))
    few, all_ = shown(path), shown(path, every_row=True)
    assert sum(f" {kp:g} " in all_ for _, kp, _ in gains) == 12
    assert sum(f" {kp:g} " in few for _, kp, _ in gains) < 12


def test_refused_rows_and_limits_are_shown_whole(tmp_path: Path) -> None:
    sea = {"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.4}
    gains = [(STIFF, -2000.0, 0.0), (-8508.0, -200.0, 2000.0)]
    path = write_campaign(tmp_path, sea=sea, matrix=rows(*gains))
    text = shown(path)
    (problem,) = predicted(path).refused
    assert problem.text() in text  # one line, to be copied
    assert "refused: 1" in text
    assert "the campaign cannot be run" in text


def test_columns_that_change_are_shown(tmp_path: Path) -> None:
    both = (-8508.0, -2500.0, 3000.0)
    matrix = rows(both, bus_voltage_v=75.0)
    matrix["list"] += rows(both, bus_voltage_v=40.0)["list"]
    path = write_campaign(tmp_path, rig=str(custom_rig(tmp_path)), sea=SEA, matrix=matrix)
    text = shown(path)
    assert " bus " in text
    assert "hyst" not in text


def orders(tmp_path: Path, order: str) -> Any:
    gains = [(-8508.0, -2000.0, 0.0), (8340.0, -2000.0, 0.0)] * 3
    path = write_campaign(
        tmp_path, sea={**SEA, "amplitude_m": 0.05}, matrix=rows(*gains), order=order
    )
    return shown(path), predicted(path).travel


def test_orders_that_save_nothing_share_a_line(tmp_path: Path) -> None:
    gains = [(490.9, -2000.0, 0.0), (490.9, -1500.0, 0.0)]
    text = shown(write_campaign(tmp_path, sea=SEA, matrix=rows(*gains), order="random"))
    assert "as given, fewest spring moves: nothing to save" in text


def test_another_order_saves_moves_and_seconds(tmp_path: Path) -> None:
    text, (now, other) = orders(tmp_path, "as given")
    assert (now.moves, other.moves) == (5, 1)
    # Stator 47 % and -93 %: 140 % a move at 0.010 m/s over 0.15 m a 100 %, 21 s each; the plan
    # holds 20 s for a move and then waits. The first row's place is 60 % from the start.
    assert now.moving == pytest.approx(9.0 + 5 * 21.0)
    assert now.waiting == pytest.approx(8.5 + 5 * 1.0)
    assert now.way == pytest.approx(60.0 + 5 * 140.0)
    assert now.duration - other.duration == pytest.approx(4 * 21.0)
    assert "fewest spring moves: saves 4 moves and 1 min 24 s" in text
    text, (now, other) = orders(tmp_path, "fewest spring moves")
    assert (now.moves, other.moves) == (1, 5)
    assert "as given: costs 4 moves and 1 min 24 s" in text


def numbers(value: Any) -> Any:
    """Every number of a JSON value."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, float):
        yield value


def test_json_holds_everything_and_no_nan(tmp_path: Path) -> None:
    path = write_campaign(tmp_path, sea=SEA, matrix=rows((STIFF, -2000.0, 0.0)), repeat=2)
    done = rig("check", path, "--json")
    assert done.returncode == 0, done.stderr

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    said = json.loads(done.stdout, parse_constant=refuse)
    assert (said["ok"], said["rows"], said["problems"]) == (True, 2, [])
    first = said["predictions"][0]
    assert set(RowPredictions._fields) <= set(first)
    assert first["spring_rate"] == STIFF
    limits = {margin["limit"] for margin in first["margins"]}
    assert {
        "position", "position warn", "spring stroke", "rotor travel", "velocity", "current peak",
        "current rms", "bus voltage", "stiffness", "loop gain", "surge position", "surge gain",
    } <= limits  # fmt: skip
    assert all(math.isfinite(value) for value in numbers(said))
    assert [one["order"] for one in said["orders"]] == ["as given", "fewest spring moves"]
    assert said["lead_in_prediction"] is None


def test_a_refused_campaign_is_told_with_its_predictions(tmp_path: Path) -> None:
    sea = {"kind": "regular", "amplitude_m": 0.3, "frequency_hz": 0.4}
    path = write_campaign(tmp_path, sea=sea, matrix=rows((-8508.0, -200.0, 2000.0)))
    said = json.loads(examined(path).to_json())
    assert not said["ok"]
    assert said["rows"] == 1
    assert said["predictions"][0]["position_peak"] > 0.35
    assert any(margin["broken"] for margin in said["predictions"][0]["margins"])


@pytest.mark.parametrize("sea", [{"kind": "calm"}, None], ids=["calm", "without the device"])
def test_there_may_be_nothing_to_predict(sea: dict[str, Any] | None, tmp_path: Path) -> None:
    path = CONFIGS / "campaigns" / "wave_calibration.yaml"
    if sea is not None:
        path = write_campaign(tmp_path, sea=sea, matrix=rows((STIFF, -2000.0, 0.0)))
    report = examined(path)
    assert report.ok, report.text()
    if sea is None:
        assert report.prediction is None
        assert "predictions" not in json.loads(report.to_json())
    else:
        assert predicted(path).rows[0].predicted.position_peak == 0.0
        assert "the campaign can be run" in shown(path)


def used_seconds(*words: str | Path) -> float:
    """Processor time of a command, s: what it takes on a machine that has nothing else to do."""
    before = os.times()
    done = subprocess.run(
        [sys.executable, "-m", "rig", *map(str, words)], capture_output=True, check=False
    )
    assert done.returncode == 0
    after = os.times()
    return (after.children_user + after.children_system) - (
        before.children_user + before.children_system
    )


def test_it_is_quick(tmp_path: Path) -> None:
    """3 s for the default campaign, 10 s for 99 rows of 300 s of irregular waves; doubled here,
    because a neighbour on the same core takes half of it."""
    assert used_seconds("check", CONFIGS / "campaigns" / "default.yaml") < 6.0
    gains = [(STIFF, kp, 100.0 * i) for kp in (-1000.0, -2000.0, -3000.0) for i in range(33)]
    path = write_campaign(
        tmp_path,
        sea={"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 300},
        matrix=rows(*gains),
    )
    assert used_seconds("check", path) < 20.0
