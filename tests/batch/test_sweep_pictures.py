"""Figures of sweeps, with a rehearsal of the same matrix on top."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure
from rehearsing import rehearse, write_campaign
from test_sweep_rows import POINTS, run_test_sweep

from rig.analysis.points import gain_matrix
from rig.analysis.surfaces import draw_surfaces
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.stations import shown, station_names
from rig.sweeps import pictures
from rig.sweeps.campaigns import LEAD_IN
from rig.sweeps.parameters import TaskFiles
from rig.sweeps.sweep import open_tasks

GRID = {
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "tare": {"duration_s": 1},
    "start": {"set_point_s": 1, "lead_in_s": 15},
    "timing": {"settle_s": 4, "interval_s": 6.5},
    "matrix": {
        "grid": [
            {"spring_n_per_m": 490.9, "kp_n_s_per_m": [-1500, -2500], "ki_n_per_m": [0, 4000]},
        ]
    },
}


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    folder = tmp_path_factory.mktemp("grid")
    path = write_campaign(folder, **GRID)
    tasks = open_tasks(path, sequential=False, lead_in=LEAD_IN)
    own = TaskFiles(path, tasks).open().plant["pto"]["torque_constant"]["value"]
    options = (f"plant.pto.torque_constant.value={own},7.5", "sea.amplitude_m=0.1,0.127")
    return run_test_sweep(path, *options, lead_in=LEAD_IN)[1]


@pytest.mark.slow
def test_rehearsal_agrees_with_the_sweep(
    table: xarray.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the campaign's own values both have the same plant; noise and lead-in differ."""
    captions: list[str] = []
    draw = pictures.write_surfaces

    def record_caption(rows: Any, path: Path, others: Any, beneath: str) -> Path:
        captions.append(beneath)
        assert len(others.points) == 4
        return draw(rows, path, others, beneath)

    monkeypatch.setattr(pictures, "write_surfaces", record_caption)
    result = rehearse(write_campaign(tmp_path, **GRID), tmp_path / "runs")
    written = pictures.write_pictures(table, tmp_path, result.folder)
    assert [path.name for path in written] == [
        "surfaces.png",
        "parameters.png",
        "map_plant.pto.torque_constant.value_sea.amplitude_m.png",
    ]
    assert all(path.stat().st_size > 20_000 for path in written)
    assert "sea amplitude 0.127 m; squares: rehearsal " in captions[0]
    plain = captions[0].replace(
        "\N{NO-BREAK SPACE}", " "
    )  # no-break spaces keep a number with its unit
    differences = re.findall(
        r"(mechanical|mechanical \(shaft\)|electrical AC|electrical DC) .?(\d\.\d) ± (\d\.\d) W",
        plain,
    )
    assert len(differences) == 4
    assert all(float(mean) <= 0.1 and float(spread) <= 0.1 for _, mean, spread in differences)


def test_measured_points_lie_within_their_panel(table: xarray.Dataset) -> None:
    """Two rows give lines; the measured points absorb 30 W less than any of them."""
    rows = table.isel({"plant.pto.torque_constant.value": 0, "sea.amplitude_m": 1, "row": [0, 1]})
    points = gain_matrix(rows)
    shifted = [p._replace(power={k: w + 30.0 for k, w in p.power.items()}) for p in points.points]
    figure = Figure((8.0, 8.0))
    draw_surfaces(figure.subfigures(), rows, 8.0, overlay=points._replace(points=tuple(shifted)))
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == 4
    for axes, kind in zip(panels, station_names(shown(STATIONS)), strict=True):
        low, high = axes.get_ylim()
        assert low < min(p.power[kind] for p in points.points)
        assert high > max(p.power[kind] for p in shifted)


@pytest.mark.slow
def test_run_of_another_matrix_is_refused(table: xarray.Dataset, tmp_path: Path) -> None:
    path = write_campaign(tmp_path, **GRID | {"matrix": {"list": [POINTS[2]]}})
    with pytest.raises(ValueError, match="no complete row has the gains"):
        pictures.write_pictures(table, tmp_path, rehearse(path, tmp_path / "runs").folder)


def labelled(key: str, unit: str) -> tuple[str, str]:
    table = xarray.Dataset(coords={key: (key, [1.0, 2.0], {"units": unit})})
    return pictures.parameter_label(table, key)


def test_parameters_are_named_in_words_with_their_unit() -> None:
    assert labelled("sea.amplitude_m", "m") == ("sea amplitude", "m")
    assert labelled("sea.tp_s", "") == ("sea tp", "s")
    assert labelled("plant.body.viscous_quadratic.value", "N s2/m2") == (
        "body viscous quadratic", "N·s²/m²",
    )  # fmt: skip
    assert labelled("seed", "") == ("seed", "")
    assert labelled("rig.heave.gear_ratio_rad_per_m", "") == ("heave gear ratio", "rad/m")


def test_lines_have_their_rows_at_the_right_end_where_there_is_room() -> None:
    axes = Figure().subplots()
    values = np.array([-10.0, -9.9, -5.0, np.nan, 0.0])
    pictures._label_rows(axes, 3.0, values, np.array([7, 8, 9, 10, 11]), range(5), 0.3)
    labels = {text.get_text(): text.xy for text in axes.texts}  # type: ignore[attr-defined]
    assert labels == {"7": (3.0, -10.0), "9": (3.0, -5.0), "11": (3.0, 0.0)}


def three_parameters(table: xarray.Dataset) -> xarray.Dataset:
    """Return the sweep with a third parameter, whose greater values cost power."""
    names = [name for name in table.data_vars if str(name).startswith("power_")]
    parts = [
        table.assign({name: table[name] + loss for name in names}).expand_dims(
            {"plant.drive.loss.value": [loss]}
        )
        for loss in (0.0, 5.0, 10.0)
    ]
    return xarray.concat(parts, "plant.drive.loss.value", combine_attrs="override")


def test_three_parameters_have_readable_facets(
    table: xarray.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No two tick labels of an axis overlap."""
    figures: list[Any] = []
    save = pictures.picture.save

    def record(figure: Figure, path: Path) -> Path:
        figures.append(figure)
        return save(figure, path)

    monkeypatch.setattr(pictures.picture, "save", record)
    written = pictures.write_pictures(three_parameters(table), tmp_path)
    assert tmp_path / "facets.png" in written
    assert len(figures) == len(written)
    for figure in figures:
        for axes in figure.axes:
            for axis, along in ((axes.xaxis, 0), (axes.yaxis, 1)):
                boxes = [
                    label.get_window_extent()
                    for label in axis.get_ticklabels()
                    if label.get_text() and label.get_visible()
                ]
                ends = [(box.intervalx, box.intervaly)[along] for box in boxes]
                inside = sorted(map(tuple, ends))
                assert all(a[1] <= b[0] for a, b in itertools.pairwise(inside)), axes.get_xlabel()


def test_failed_sweep_has_no_figures(table: xarray.Dataset, tmp_path: Path) -> None:
    failed = table.assign(state=table["state"].where(False, "failed"))
    assert pictures.write_pictures(failed, tmp_path) == []
