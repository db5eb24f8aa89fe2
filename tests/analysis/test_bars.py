"""Bars by row: every row and every setting that varies is there, in the order asked for."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from matplotlib.figure import Figure
from matplotlib.image import imread

from rig.analysis import bars
from rig.analysis.points import matrix
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


def drawn(table: xarray.Dataset, sort: bars.Sort, monkeypatch: pytest.MonkeyPatch) -> Figure:
    kept: list[Figure] = []

    def keep(figure: Figure, path: Path) -> Path:
        figure.draw_without_rendering()
        kept.append(figure)
        return path

    monkeypatch.setattr(bars.picture, "save", keep)
    bars.write_bars(table, Path("unused.png"), sort)
    return kept[0]


def heights(axes: Any) -> list[float]:
    return [bar.get_height() for bar in axes.patches[:36]]


def test_only_what_varies_has_a_panel(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels = drawn(table, "run", monkeypatch).axes
    said = [axes.get_ylabel().replace("\n", " ") for axes in panels]
    assert said == [
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


def test_sorted_by_power_every_panel_is(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    panels = drawn(table, "power", monkeypatch).axes
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
    axes = drawn(table, "run", monkeypatch).axes[0]
    (whiskers,) = (c for c in axes.collections if len(c.get_segments()) > 2)
    reach = [0.5 * np.ptp(segment[:, 1]) for segment in whiskers.get_segments()]
    assert reach == pytest.approx(np.delete(table["power_dc_se"].values, 3))


def test_the_best_row_and_the_modulation_are_said(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table.copy(deep=True)
    table["state"][20] = "cut short"
    figure = drawn(table, "run", monkeypatch)
    best = int(np.argmin(table["power_dc"].values))
    texts = [t.get_text() for t in figure.axes[0].texts]
    assert any(text.startswith(f"best: row {best}, −") for text in texts)
    assert "1 row without a whole window is left out" in texts
    head = [t.get_text() for part in figure.subfigs for t in part.texts]
    assert "rows as run; modulation svpwm" in head
    assert "REHEARSAL: simulated plant" in head


def test_a_drive_campaign_makes_them_by_itself(run: Path) -> None:
    made = {path.name for path in write_products(run)}
    assert {"bars.png", "effects.csv", "surfaces.png"} <= made
    assert "surfaces_sliced.png" not in made  # one Ki
    text = (run / "summary.txt").read_text()
    assert "Main effects" in text
    assert "at bus voltage 60 V, switching period 200 µs" in text
    assert imread(run / "bars.png").std() > 0.05


def test_no_drive_column_no_bars(table: xarray.Dataset, tmp_path: Path) -> None:
    assert bars.varies_drive(matrix(table))
    assert not bars.varies_drive(matrix(table.isel(row=[0, 1])))  # Kp alone
    with pytest.raises(ValueError, match="no complete row"):
        bars.write_bars(table.isel(row=[]), tmp_path / "x.png")
