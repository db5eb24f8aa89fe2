"""Rows that ended because they could no longer be the best are marked in all results."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from rig.analysis import bars, surfaces
from rig.analysis.cut_rows import cut_message, cut_note, ended_as_worse
from rig.analysis.points import gain_matrix
from rig.analysis.row_ends import END_REASON, END_STATION, FULL, PRECISE, WORSE, Precision, RowEnds
from rig.analysis.rows import row_table
from rig.analysis.slices import find_optima
from rig.api.row_frames import power_surfaces, row_frame
from rig.recording.runs.windows import Window

SHAPE = synthetic.Shape(noise=1.0, wander=1.0, settle=5, tail=2, lead_in=10)
CUT = [1, 4]
MESSAGE = (
    "Rows 1, 4 ended early: could no longer be the best at electrical DC [dc]. Such powers have "
    "larger errors, and the best row of another station may be among these rows."
)


@pytest.fixture(scope="module")
def fixed(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    rows = synthetic.default_rows()
    data = synthetic.run_rows(rows, SHAPE)
    folder = tmp_path_factory.mktemp("runs") / "cut"
    return row_table(synthetic.write_run(folder, data, synthetic.plan_json(rows, SHAPE)))


@pytest.fixture
def table(fixed: xarray.Dataset) -> xarray.Dataset:
    reasons = [WORSE if row in CUT else FULL for row in fixed["row"].values]
    return fixed.assign({END_REASON: ("row", reasons)}).assign_attrs({END_STATION: "dc"})


def drawn(monkeypatch: pytest.MonkeyPatch, write: Any, table: xarray.Dataset) -> Figure:
    figures: list[Figure] = []

    def keep(figure: Figure, path: Path, *_: Any) -> Path:
        figure.draw_without_rendering()
        figures.append(figure)
        return path

    monkeypatch.setattr(surfaces.picture, "save", keep)
    write(table, Path("unused.png"))
    return figures[0]


def legend_texts(figure: Figure) -> list[str]:
    return [
        text.get_text()
        for part in figure.subfigs
        for legend in part.legends
        for text in legend.get_texts()
    ]


def triangles(figure: Figure) -> list[tuple[float, float]]:
    return sorted(
        {
            (float(x), float(y))
            for axes in figure.axes
            for line in axes.lines
            if line.get_marker() == "v"
            for x, y in zip(*line.get_data(), strict=True)
        }
    )


def test_surfaces_mark_the_points_of_these_rows_alone(
    table: xarray.Dataset, fixed: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = drawn(monkeypatch, surfaces.write_surfaces, table)
    places = {(float(table["ki"][row]), float(table["kp"][row])) for row in CUT}
    assert triangles(figure) == sorted(places)
    assert legend_texts(figure) == [cut_note(table)]
    assert "electrical DC [dc]" in cut_note(table)
    plain = drawn(monkeypatch, surfaces.write_surfaces, fixed)
    assert triangles(plain) == legend_texts(plain) == []


def test_bars_of_these_rows_are_hatched(
    table: xarray.Dataset, fixed: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = drawn(monkeypatch, bars.write_bars, table)
    for axes in figure.axes[:2]:
        hatched = [i for i, bar in enumerate(axes.containers[0]) if bar.get_hatch()]
        assert hatched == CUT
        assert all(axes.containers[0][i].get_facecolor() == to_rgba("white") for i in CUT)
    assert legend_texts(figure) == [cut_note(table)]
    plain = drawn(monkeypatch, bars.write_bars, fixed)
    assert not any(bar.get_hatch() for bar in plain.axes[0].containers[0])
    assert legend_texts(plain) == []


def test_tables_and_messages_name_rows_and_station(
    table: xarray.Dataset, fixed: xarray.Dataset
) -> None:
    assert ended_as_worse(table) == CUT
    assert cut_message(table) == MESSAGE
    assert cut_message(fixed) == cut_note(fixed) == ""
    precise = fixed.assign({END_REASON: ("row", [PRECISE] * 2 + [FULL] * (fixed.sizes["row"] - 2))})
    assert cut_message(precise.assign_attrs({END_STATION: "dc"})) == (
        "Rows 0-1 ended when electrical DC [dc] was precise; powers of other stations may have "
        "larger errors."
    )
    frame = row_frame(table)
    assert frame.index[frame[END_REASON] == WORSE].tolist() == CUT
    assert float(power_surfaces(table)["ended_early"].sum()) == len(CUT)
    assert "ended_early" not in power_surfaces(fixed)


def test_the_best_point_of_another_station_has_a_remark(table: xarray.Dataset) -> None:
    matrix = gain_matrix(table)
    assert [point.rows for point in matrix.points if point.cut_rows] == [(row,) for row in CUT]
    lowest = table["power_ac"].values.copy()
    lowest[CUT[0]] = -1e3
    for optimum in find_optima(table.assign(power_ac=("row", lowest))):
        is_cut = optimum.station.name == "ac" and CUT[0] in optimum.point.rows
        assert ("ended early" in optimum.caveat) == is_cut
    assert any(
        "ended early" in o.caveat for o in find_optima(table.assign(power_ac=("row", lowest)))
    )


TICKS = 100  # of a period


def window(row: int, means: list[float]) -> Window:
    data = np.zeros(TICKS * len(means), [("tick", "<i8"), ("power.dc", "<f8")])
    data["tick"] = np.arange(len(data))
    data["power.dc"] = np.repeat(means, TICKS)
    return Window(row, 0, data, "")


def test_the_reason_follows_from_the_scatter_of_all_rows_before() -> None:
    """By hand: the variance pools at most 8 degrees of freedom of the rows before."""
    ends = RowEnds("dc", Precision(0.5, 0.0), TICKS, dict.fromkeys(range(4), 8 * TICKS), {})
    entry = {"incomplete_reason": ""}

    def reason(row: int, means: list[float]) -> str:
        return str(ends.complete(entry, window(row, means))[END_REASON])

    # Eight periods, variance 8/7 each: dof 7, sum of squares 8.
    assert reason(0, [-9.0, -11.0] * 4) == FULL
    # Two equal periods: variance (7 * 8/7 + 0) / 8 = 1, of the mean 1/2: 0.71 W > 0.5 W.
    assert reason(1, [-2.0, -2.0]) == WORSE
    # Four: dof 8 before, (8 * 1 + 0) / 11 / 4: 0.43 W.
    assert reason(2, [-2.0] * 4) == PRECISE
    assert ends.complete({"incomplete_reason": "started over"}, window(3, [-2.0]))[END_REASON] == ""
