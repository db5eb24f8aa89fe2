"""Bars by row: all rows and all varying settings, in the requested order."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from matplotlib.figure import Figure
from matplotlib.image import imread

from rig.analysis import bars
from rig.analysis.points import gain_matrix
from rig.analysis.report import write_products
from rig.analysis.rows import row_table

SHAPE = synthetic.Shape(noise=1.0, wander=1.0, settle=5, tail=2, lead_in=10)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "drive"
    rows = synthetic.drive_rows()
    data = synthetic.run_rows(rows, SHAPE)
    config = {"name": "drive", "rig": {"drive": {"kind": "custom", "modulation": "svpwm"}}}
    return synthetic.write_run(folder, data, synthetic.plan_json(rows, SHAPE), config=config)


@pytest.fixture(scope="module")
def table(run: Path) -> xarray.Dataset:
    return row_table(run)


def draw_figure(table: xarray.Dataset, sort: bars.Sort, monkeypatch: pytest.MonkeyPatch) -> Figure:
    figures: list[Figure] = []

    def keep(figure: Figure, path: Path) -> Path:
        figure.draw_without_rendering()
        figures.append(figure)
        return path

    monkeypatch.setattr(bars.picture, "save", keep)
    bars.write_bars(table, Path("unused.png"), sort)
    return figures[0]


def heights(axes: Any) -> list[float]:
    return [bar.get_height() for bar in axes.patches[:36]]


def test_only_varying_columns_have_a_panel(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels = draw_figure(table, "run", monkeypatch).axes
    axis_labels = [axes.get_ylabel().replace("\n", " ") for axes in panels]
    assert axis_labels == [
        "electrical DC, W",
        "electrical AC, W",
        "bus voltage, V",
        "switching period, µs",
        "velocity threshold, m/s",
        "Kp, N·s/m",
    ]
    assert heights(panels[0]) == pytest.approx(table["power_dc"].values)
    assert heights(panels[3]) == pytest.approx(table["switching_period"].values * 1e6)
    assert [t.get_text() for t in panels[-1].get_xticklabels()] == [str(i) for i in range(36)]


def test_sorting_by_power_applies_to_every_panel(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels = draw_figure(table, "power", monkeypatch).axes
    order = np.argsort(table["power_dc"].values)
    assert heights(panels[0]) == pytest.approx(np.sort(table["power_dc"].values))
    assert heights(panels[2]) == pytest.approx(table["bus_voltage"].values[order])
    labels = [t.get_text() for t in panels[-1].get_xticklabels()]
    assert labels == [str(i) for i in order]


def test_whiskers_are_the_standard_errors(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table.copy(deep=True)
    table["power_dc_se"][3] = np.nan
    axes = draw_figure(table, "run", monkeypatch).axes[0]
    (whiskers,) = (c for c in axes.collections if len(c.get_segments()) > 2)
    reach = [0.5 * np.ptp(segment[:, 1]) for segment in whiskers.get_segments()]
    assert reach == pytest.approx(np.delete(table["power_dc_se"].values, 3))


def test_best_row_and_modulation_are_shown(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table.copy(deep=True)
    table["state"][20] = "cut short"
    figure = draw_figure(table, "run", monkeypatch)
    best = int(np.argmin(table["power_dc"].values))
    texts = [t.get_text() for t in figure.axes[0].texts]
    assert any(text.startswith(f"best: row {best}, −") for text in texts)
    assert "1 row without a complete window is left out" in texts
    head = [t.get_text() for part in figure.subfigs for t in part.texts]
    assert "rows in order of the run; modulation svpwm" in head
    assert "REHEARSAL: simulated plant" in head


def test_drive_campaign_writes_bars_by_default(run: Path) -> None:
    written = {path.name for path in write_products(run)}
    assert {"bars.png", "effects.csv", "surfaces.png"} <= written
    assert "surfaces_sliced.png" not in written  # one Ki
    text = (run / "summary.txt").read_text()
    assert "Main effects" in text
    assert "at bus voltage 60 V, switching period 200 µs" in text
    assert imread(run / "bars.png").std() > 0.05


def test_no_bars_without_varying_drive_columns(table: xarray.Dataset, tmp_path: Path) -> None:
    assert bars.varies_drive(gain_matrix(table))
    assert not bars.varies_drive(gain_matrix(table.isel(row=[0, 1])))  # Kp alone
    with pytest.raises(ValueError, match="no complete row"):
        bars.write_bars(table.isel(row=[]), tmp_path / "x.png")
