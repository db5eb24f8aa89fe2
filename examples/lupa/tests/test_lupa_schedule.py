"""Gain schedules: the times and zero rows of LUPA's own ones, and its Excel files."""

from pathlib import Path
from typing import Any

import pytest
from openpyxl import Workbook

from wec_lupa import schedule


@pytest.mark.parametrize(
    ("period", "full", "zeros"),
    [
        (1.23, 79.887, 7), (1.38, 76.633, 6), (1.68, 71.763, 5), (2.5, 63.065, 3),
        (3.0, 60.305, 3), (4.0, 57.877, 2), (5.0, 56.930, 2), (6.0, 56.465, 1),
    ],
)  # fmt: skip
def test_zero_rows_last_until_the_waves_have_built_up(
    period: float, full: float, zeros: int
) -> None:
    found = schedule.damping_schedule(period)
    assert found.full_waves == pytest.approx(full, abs=1e-3)
    assert found.zero_rows == zeros
    assert len(found.rows) == zeros + 20
    assert found.rows[zeros - 1 : zeros + 1] == ((0.0, 0.0), (0.0, 100.0))
    assert found.rows[-1] == (0.0, 2000.0)


def test_the_first_damping_of_3_s_begins_at_90_s() -> None:
    assert schedule.damping_schedule(3.0).first_damping == 90.0


def workbook(path: Path, rows: list[list[Any]]) -> Path:
    book = Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


def test_a_schedule_becomes_a_campaign(tmp_path: Path, capsys: Any) -> None:
    """The April 2025 schedule of 2 s: three zero rows, then K outer, C inner."""
    rows = [[0, 0]] * 3 + [[k, c] for k in (-2782, -2514.5) for c in (109.6, 548)]
    file = workbook(tmp_path / "grid.xlsx", rows)
    assert schedule.read_schedule(file) == [tuple(map(float, row)) for row in rows]
    schedule.main(["read", str(file), "--period", "2"])
    text = capsys.readouterr().out
    assert "- {stiffness_n_per_m: -2514.5, damping_n_s_per_m: 109.6}" in text
    assert "interval_s: 20}" in text


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([["K", "C"], [1, 2]], r"grid.xlsx:1: 'K' is no finite number"),
        ([[1, 2], [3]], r"grid.xlsx:2: has 1 columns; needed are K and C"),
        ([[1, 2, 3]], r"grid.xlsx:1: has 3 columns"),
        ([[1, None], [2, "=1/0"]], r"grid.xlsx:1: has 1 columns"),
        ([[True, 1]], r"True is no finite number"),
        ([], r"grid.xlsx: has no rows"),
    ],
)
def test_a_wrong_schedule_is_refused(tmp_path: Path, rows: list[list[Any]], message: str) -> None:
    with pytest.raises(schedule.ScheduleError, match=message):
        schedule.read_schedule(workbook(tmp_path / "grid.xlsx", rows))


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xlsx").write_text("no workbook")
    with pytest.raises(schedule.ScheduleError, match="is not an Excel workbook"):
        schedule.read_schedule(tmp_path / "a.xlsx")
    with pytest.raises(schedule.ScheduleError, match=r"allowed \*.xlsx"):
        schedule.read_schedule(tmp_path / "a.csv")
    with pytest.raises(SystemExit, match="No such file"):
        schedule.main(["read", str(tmp_path / "b.xlsx"), "--period", "2"])


def test_a_campaign_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text("mine")
    with pytest.raises(SystemExit, match="exists; it is never overwritten"):
        schedule.main(["damping", "--period", "2.5", "--output", str(tmp_path / "c.yaml")])
    with pytest.raises(SystemExit):
        schedule.main(["damping", "--period", "0"])
    assert (tmp_path / "c.yaml").read_text() == "mine"


@pytest.mark.parametrize("name", ["damping_1p68s", "damping_2p5s", "damping_3s"])
def test_the_shipped_campaigns_are_the_generated_ones(name: str, capsys: Any) -> None:
    path = Path(__file__).resolve().parents[1] / "campaigns" / f"{name}.yaml"
    period = name.removeprefix("damping_").removesuffix("s").replace("p", ".")
    schedule.main(["damping", "--period", period])
    assert path.read_text() == capsys.readouterr().out
