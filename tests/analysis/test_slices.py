"""Slices through a matrix of many columns: their position, their points and their remarks."""

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from between_points import interpolator
from matplotlib.figure import Figure
from matplotlib.image import imread
from synthetic_runs import COLUMNS, POWERS, STATIONS_ATTRIBUTES

from rig import stations
from rig.analysis import labels, panel
from rig.analysis.points import Matrix, Point, gain_matrix, varied_columns
from rig.analysis.slices import (
    find_optima,
    project_matrix,
    slice_matrix,
    slice_remarks,
    triangulate,
)
from rig.analysis.surfaces import (
    can_be_sliced,
    default_view,
    draw_surfaces,
    is_scattered,
    slice_heading,
    write_sliced,
    write_surfaces,
)
from rig.row_contents import Column, find_column, main_columns

SPRING_RATE, KP, KI = main_columns(COLUMNS)
SPRINGS = (490.9, -2763.0, -5715.0)
NO_ERROR = float("nan")


def column(name: str) -> Column:
    return find_column(COLUMNS, name)


def rows(settings: list[dict[str, float]], power: Any, error: float = 0.5) -> xarray.Dataset:
    """Return a row table with a row for each setting and powers (W) from ``power(setting)``."""
    names = settings[0]
    columns: dict[str, Any] = {
        "row": range(len(settings)),
        "state": ["complete"] * len(settings),
        "stator": [-13.0] * len(settings),
        "periods": [5] * len(settings),
        **{name: [each[name] for each in settings] for name in names},
    }
    powers = [power(each) for each in settings]
    for kind in POWERS:
        columns[f"power_{kind}"] = [each[kind] for each in powers]
        columns[f"power_{kind}_se"] = [error] * len(settings)
    attributes = {"campaign": "three", "run": "r1", "mode": "hil", **STATIONS_ATTRIBUTES}
    return xarray.Dataset(
        {name: ("row", np.array(list(values))) for name, values in columns.items()},
        None,
        attributes,
    )


def three_springs() -> list[dict[str, float]]:
    grid = product(SPRINGS, (-3000.0, -2000.0, -1000.0), (-4000.0, 0.0, 4000.0))
    return [{"spring_rate": ks, "kp": kp, "ki": ki} for ks, kp, ki in grid]


def own_optima(at: dict[str, float]) -> dict[str, float]:
    """Return powers that are best at the first (mechanical), second (AC) and third (DC) spring."""
    bowl = ((at["kp"] + 2000.0) / 500.0) ** 2 + (at["ki"] / 2000.0) ** 2
    best = dict(zip(("mechanical_1", "ac", "dc"), SPRINGS, strict=True))
    power = {k: -50.0 + bowl + abs(at["spring_rate"] - s) / 500.0 for k, s in best.items()}
    return power | {"mechanical_2": -10.0 + bowl}


def test_each_station_is_sliced_at_its_own_optimum() -> None:
    table = rows(three_springs(), own_optima)
    matrix = gain_matrix(table)
    for kind, spring in zip(("mechanical_1", "ac", "dc"), SPRINGS, strict=True):
        slice_ = slice_matrix(matrix, kind, KI, KP)
        assert slice_.sliced == {"spring_rate": spring}
        assert len(slice_.points) == 9
        assert {p.setting["spring_rate"] for p in slice_.points} == {spring}
        assert slice_.best is not None
        assert (slice_.best.power, slice_.best.error) == (-50.0, 0.5)
        assert not slice_.best.at_edge
        expected = f"sliced at spring rate {labels.format_quantity(SPRING_RATE, spring)}"
        assert slice_heading(slice_).endswith(expected)
    assert can_be_sliced(matrix)
    at_one_spring = tuple(p for p in matrix.points if p.setting["spring_rate"] == SPRINGS[0])
    assert len(at_one_spring) > 3
    assert not can_be_sliced(matrix._replace(points=at_one_spring))  # a run that ended early


def test_a_fixed_column_keeps_its_value() -> None:
    matrix = gain_matrix(rows(three_springs(), own_optima))
    fixed = slice_matrix(matrix, "dc", KI, KP, {"spring_rate": 490.9})
    assert (fixed.fixed, fixed.sliced) == ({"spring_rate": 490.9}, {})
    assert fixed.best is not None
    assert fixed.best.point.setting["spring_rate"] == 490.9
    assert slice_heading(fixed) == "electrical DC\nat spring rate +491 N/m"
    near = slice_matrix(matrix, "dc", KI, KP, {"spring_rate": 490.9 * (1.0 + 1e-8)})
    assert near.points == fixed.points
    with pytest.raises(
        ValueError, match=r"\+500 N/m is not in the campaign; allowed −5715 N/m, −2763 N/m, \+491"
    ):
        slice_matrix(matrix, "dc", KI, KP, {"spring_rate": 500.0})


def test_any_column_can_be_left_out() -> None:
    matrix = gain_matrix(rows(three_springs(), own_optima))
    slice_ = slice_matrix(matrix, "dc", SPRING_RATE, KP)
    assert slice_.sliced == {"ki": 0.0}
    assert sorted(slice_.xy) == sorted(product(SPRINGS, (-3000.0, -2000.0, -1000.0)))
    assert slice_.best is not None
    assert slice_.best.at_edge  # the softest spring is the last
    surface = interpolator(slice_.xy, slice_.values)
    for place, value in zip(slice_.xy, slice_.values, strict=True):
        assert float(surface(*place)) == pytest.approx(value)


def test_more_columns_are_sliced_together() -> None:
    settings = [
        {**at, "bus_voltage": bus, "switching_period": period}
        for at in three_springs()
        for bus in (60.0, 90.0)
        for period in (50e-6, 200e-6)
    ]

    def power(at: dict[str, float]) -> dict[str, float]:
        more = at["bus_voltage"] / 10.0 - at["switching_period"] * 1e4
        return {kind: value + more for kind, value in own_optima(at).items()}

    table = rows(settings, power)
    matrix = gain_matrix(table)
    slice_ = slice_matrix(matrix, "ac", KI, KP)
    assert slice_.sliced == {"spring_rate": -2763.0, "bus_voltage": 60.0, "switching_period": 2e-4}
    assert len(slice_.points) == 9
    drive = slice_matrix(
        matrix, "ac", column("switching_period"), column("bus_voltage"), {"kp": -1000.0}
    )
    assert (drive.fixed, len(drive.points)) == ({"kp": -1000.0}, 4)
    # By spring rate, the best point's neighbours are those that differ in Kp and Ki alone.
    for best in find_optima(table):
        assert best.point.setting["bus_voltage"] == 60.0
        assert (best.at_edge, best.at_gap, best.points) == (False, False, 36)


def drive_settings() -> list[dict[str, float]]:
    grid = product((40.0, 75.0, 80.0), (50e-6, 100e-6, 200e-6), (0.0, 0.1))
    gains = {"spring_rate": -8508.0, "kp": -2500.0, "ki": 3000.0}
    names = ("bus_voltage", "switching_period", "velocity_threshold")
    return [gains | dict(zip(names, each, strict=True)) for each in grid]


def drive_power(at: dict[str, float]) -> dict[str, float]:
    """Return mechanical power with threshold and slight voltage effects, AC noise, DC with all."""
    bus, period, threshold = list(at.values())[3:]
    noise = 0.004 * np.sin(bus * 7.0 + period * 1e6)
    dc = -28.0 + bus / 8.0 - period * 5e4 - 20.0 * threshold
    mechanical = -67.0 - 0.001 * bus + 11.0 * threshold
    return dict(zip(POWERS, (mechanical, mechanical, -42.0 + noise, dc), strict=True))


def test_columns_that_make_no_difference_have_no_best_value() -> None:
    optima = {
        best.station.name: best for best in find_optima(rows(drive_settings(), drive_power, 0.005))
    }
    assert {kind: best.without_effect for kind, best in optima.items()} == {
        "mechanical_1": ("bus_voltage", "switching_period"),
        "mechanical_2": ("bus_voltage", "switching_period"),
        "ac": ("bus_voltage", "switching_period", "velocity_threshold"),
        "dc": (),
    }
    axes = column("bus_voltage"), column("switching_period")
    matrix = gain_matrix(rows(drive_settings(), drive_power, 0.005))
    slices = {kind: slice_matrix(matrix, kind, *axes) for kind in ("mechanical_1", "ac", "dc")}
    remarks_of = {
        kind: (each.best.caveat, slice_remarks(each)[1:])
        for kind, each in slices.items()
        if each.best
    }
    assert remarks_of == {
        "mechanical_1": ("within 1 %", ["all within 1 %"]),
        "ac": ("within errors", ["differences within errors"]),
        "dc": ("grid's edge", []),
    }
    assert "grid's edge" not in panel.format_caption(slices["ac"], 6.0)


def test_a_column_of_two_values_has_no_edge() -> None:
    """Both values are ends of the range and do not count as edges; of three, the outer two do."""
    for kps, edge in (((-2000.0, -1000.0), False), ((-3000.0, -2000.0, -1000.0), True)):
        settings = [
            {"spring_rate": 490.9, "kp": kp, "ki": ki}
            for kp in kps
            for ki in (-4000.0, 0.0, 4000.0)
        ]

        def power(at: dict[str, float]) -> dict[str, float]:
            return dict.fromkeys(POWERS, -50.0 + at["kp"] / 100.0 + (at["ki"] / 1000.0) ** 2)

        assert {best.at_edge for best in find_optima(rows(settings, power))} == {edge}


def test_repeated_set_point_is_one_point_with_an_error() -> None:
    repeated = [*three_springs(), *three_springs()[:1], *three_springs()[:1]]
    table = rows(repeated, own_optima)
    table["power_dc"][0] += 3.0
    matrix = gain_matrix(table)
    assert len(matrix.points) == len(matrix.planned) == 27
    first = matrix.points[0]
    values = table["power_dc"].values[[0, 27, 28]]
    assert first.rows == (0, 27, 28)
    assert first.power["dc"] == pytest.approx(values.mean())
    assert first.error["dc"] == pytest.approx(values.std(ddof=1) / np.sqrt(3.0))


def test_settings_read_from_a_log_are_rounded() -> None:
    settings = three_springs()
    settings[4] = {name: value * (1.0 + 1e-13) for name, value in settings[4].items()}
    settings[5]["ki"] = -0.0 if settings[5]["ki"] == 0.0 else settings[5]["ki"]
    matrix = gain_matrix(rows(settings, own_optima))
    assert [c.name for c in varied_columns(matrix)] == ["spring_rate", "kp", "ki"]
    assert len({p.setting["kp"] for p in matrix.points}) == 3


def missing(*places: int) -> xarray.Dataset:
    table = rows(three_springs(), own_optima)
    for i in places:
        table["state"][i] = "not run"
    return table


def test_missing_points_are_counted_and_not_zero() -> None:
    at = [i for i, each in enumerate(three_springs()) if each["spring_rate"] == -5715.0]
    slice_ = slice_matrix(gain_matrix(missing(at[3], at[8])), "dc", KI, KP)
    assert len(slice_.points) == 7
    assert slice_.missing == ((-4000.0, -2000.0), (4000.0, -1000.0))
    assert slice_remarks(slice_) == ["2 points not measured (×)"]
    surface = interpolator(slice_.xy, slice_.values)
    assert float(surface(-4000.0, -2000.0)) < -40.0
    assert surface(4000.0, -1000.0).mask
    assert slice_.best is not None
    assert slice_.best.at_gap


def test_uneven_and_incomplete_grids_are_remarked() -> None:
    def remarks_for(kis: list[float], skip: set[tuple[float, float]] = frozenset()) -> list[str]:  # type: ignore[assignment]
        settings = [
            {"spring_rate": 490.9, "kp": kp, "ki": ki}
            for kp in (-3000.0, -2000.0, -1000.0)
            for ki in kis
            if (kp, ki) not in skip
        ]
        return slice_remarks(slice_matrix(gain_matrix(rows(settings, own_optima)), "dc", KI, KP))

    assert remarks_for([-4000.0, 0.0, 4000.0]) == []
    assert remarks_for([-4000.0, 0.0, 500.0]) == ["Ki unevenly spaced"]
    assert remarks_for([-4000.0, 0.0, 4000.0], {(-3000.0, 0.0)}) == ["incomplete grid"]
    lonely = {(-2000.0, 0.0), (-2000.0, 500.0), (-3000.0, 500.0), (-1000.0, 0.0)}
    assert remarks_for([0.0, 500.0], lonely) == ["2 points only"]
    assert remarks_for([0.0]) == []  # a line plot needs no remark
    pair = {(-3000.0, 0.0)}
    assert remarks_for([0.0], pair) == ["2 points only"]


def test_a_surface_of_noise_is_remarked() -> None:
    random = np.random.default_rng(1)

    def noise(at: dict[str, float]) -> dict[str, float]:
        return dict.fromkeys(POWERS, float(-50.0 + random.normal(0.0, 0.5)))

    remark = "differences within errors"
    fixed = {"spring_rate": 490.9}
    assert remark in slice_remarks(
        slice_matrix(gain_matrix(rows(three_springs(), noise)), "dc", KI, KP, fixed)
    )
    assert remark not in slice_remarks(
        slice_matrix(gain_matrix(rows(three_springs(), own_optima)), "dc", KI, KP, fixed)
    )
    unknown = rows(three_springs(), noise, error=NO_ERROR)
    assert remark not in slice_remarks(slice_matrix(gain_matrix(unknown), "dc", KI, KP, fixed))


def test_long_cells_of_an_uneven_grid_are_surface() -> None:
    places = list(product((0.0, 1000.0, 2000.0, 20_000.0), (-3000.0, -2000.0, -1000.0)))
    mesh = triangulate(places)
    assert mesh.mask is None or not mesh.mask.any()
    surface = interpolator(places, [x / 1000.0 for x, _ in places])
    assert float(surface(11_000.0, -1500.0)) == pytest.approx(11.0)


def test_scattered_points_are_a_surface_within_their_hull() -> None:
    random = np.random.default_rng(8)
    places = [(float(x), float(y)) for x, y in random.uniform(0.0, 1.0, (60, 2))]
    surface = interpolator(places, [2.0 * x - y for x, y in places])
    inside = random.uniform(0.2, 0.8, (50, 2))
    for x, y in inside:
        assert float(surface(x, y)) == pytest.approx(2.0 * x - y)
    assert surface(1.1, 0.5).mask


def test_default_view() -> None:
    view = default_view(gain_matrix(rows(three_springs(), own_optima)))
    assert (view.x, view.y, view.by_panel) == (KI, KP, True)
    one_gain = [each for each in three_springs() if each["ki"] == 0.0]
    assert default_view(gain_matrix(rows(one_gain, own_optima))).by_panel
    springs = [each for each in one_gain if each["kp"] == -2000.0]
    view = default_view(gain_matrix(rows(springs, own_optima)))
    assert (view.x.name, view.by_panel) == ("spring_rate", False)
    drive = [
        {**springs[0], "bus_voltage": bus, "switching_period": period, "kp": kp}
        for bus in (60.0, 75.0, 90.0)
        for period in (5e-5, 1e-4, 1.5e-4, 2e-4)
        for kp in (-2000.0, -1500.0)
    ]
    view = default_view(gain_matrix(rows(drive, own_optima)))
    assert {view.x.name, view.y.name} == {"switching_period", "bus_voltage"}
    assert default_view(Matrix((), (), COLUMNS)).by_panel


@pytest.mark.parametrize("kinds", [("dc",), ("mechanical_2", "ac", "dc")])
def test_slices_are_drawn(tmp_path: Path, kinds: tuple[str, ...]) -> None:
    table = missing(0, 5)
    picture = imread(write_sliced(table, tmp_path / "a.png", (SPRING_RATE, KP), names=kinds))
    assert picture.std() > 0.05
    lines = table.isel(row=[i for i, each in enumerate(three_springs()) if each["ki"] == 0.0])
    assert imread(write_sliced(lines, tmp_path / "b.png", names=kinds)).std() > 0.02
    assert imread(write_sliced(table.isel(row=[]), tmp_path / "c.png", names=kinds)).std() > 0.01
    with pytest.raises(ValueError, match="cannot be both axes"):
        write_sliced(table, tmp_path / "d.png", (KP, KP))


def hypercube() -> xarray.Dataset:
    random = np.random.default_rng(4)
    settings = [
        {
            "spring_rate": float(random.choice(SPRINGS)),
            "kp": float(random.uniform(-3000.0, -1000.0)),
            "ki": float(random.uniform(-4000.0, 4000.0)),
            "bus_voltage": float(random.uniform(60.0, 90.0)),
        }
        for _ in range(40)
    ]
    return rows(settings, own_optima)


def test_scattered_matrix_shows_every_point(tmp_path: Path) -> None:
    table = hypercube()
    matrix = gain_matrix(table)
    assert is_scattered(matrix)
    assert not can_be_sliced(matrix)
    assert not is_scattered(gain_matrix(rows(three_springs(), own_optima)))
    projection = project_matrix(matrix, "dc", KI, KP)
    assert (len(projection.points), projection.sliced) == (40, {})
    assert projection.best is not None
    assert projection.best.power == float(table["power_dc"].min())
    figure = Figure(layout="constrained")
    draw_surfaces(figure, table, 8.0)
    dots = [axes.collections[0].get_offsets() for axes in figure.axes[:3]]
    assert all(len(each) == 40 for each in dots)
    assert sorted(dots[0][:, 0]) == pytest.approx(sorted(table["ki"].values))
    assert "all 40 points" in figure.axes[0].get_title()
    assert imread(write_surfaces(table, tmp_path / "x.png")).std() > 0.03


def test_column_labels() -> None:
    period = column("switching_period_s")
    assert period is column("switching_period")
    assert labels.axis_label(period) == "switching period, µs"
    assert labels.format_setting(period, 50e-6) == "switching period 50 µs"
    assert labels.format_quantity(column("discharge_level"), 15.0) == "15"
    assert labels.format_quantity(KP, -2500.0) == "−2500 N·s/m"
    assert labels.format_number(column("velocity_threshold"), 0.05) == "0.05"
    assert labels.format_number(SPRING_RATE, 490.9) == "+491"
    with pytest.raises(KeyError, match="no column 'speed'; allowed spring_rate, kp"):
        column("speed")


def test_unknown_settings_of_a_point_are_nan() -> None:
    found = labels.best_values(main_columns(COLUMNS), Point({"kp": -1.0}, {}, {}, ()))
    values = {each.name: value for each, value in found}
    assert values.pop("kp") == -1.0
    assert values.keys() == {"spring_rate", "stator", "ki"}
    assert np.isnan(list(values.values())).all()


def test_small_power_differences_are_drawn_flat() -> None:
    """A range of 0.01 W does not use all colours; a range of 1 W does."""
    flat, hilly = panel.power_scale([-67.51, -67.52]), panel.power_scale([-67.0, -68.0])
    assert flat.norm(-67.51) == pytest.approx(flat.norm(-67.52), abs=0.02)
    assert hilly.norm(-67.0) - hilly.norm(-68.0) > 0.7
    small = panel.power_scale([-1e-4, -3e-5])  # W, of small powers the range is all there is
    assert small.norm(-3e-5) - small.norm(-1e-4) > 0.7
    assert panel.power_scale([0.0, 0.0]).norm(0.0) == pytest.approx(0.5)
    symmetric = panel.power_scale([0.01, 0.02], symmetric=True)
    assert symmetric.norm(0.0) == pytest.approx(0.5)


def test_match_of_the_impedance_is_marked_at_the_body() -> None:
    """Inside the grid only, and on the panels of the first station."""
    table = rows(three_springs(), own_optima)
    match = {"kp": -1500.0, "ki": 9000.0, "kp_real": -2500.0}
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    draw_surfaces(figure, table.assign_attrs(impedance_match=json.dumps(match)), 10.0)
    panels = [axes for axes in figure.axes if axes.get_subplotspec() is not None]
    for axes in panels:
        marks = [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "+"]
        assert marks == ([[[0.0, -2500.0]]] if axes in panels[:3] else [])
    assert "\N{MINUS SIGN}|Z|" in [text.get_text() for text in panels[0].texts]


@pytest.mark.parametrize("with_first", [True, False])
def test_match_of_the_impedance_is_marked_in_a_slice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, with_first: bool
) -> None:
    """`rig plot --surface kp ki`: on the panel of the first station, none without that station."""
    drawn: list[Figure] = []

    def keep(figure: Figure, path: Path) -> Path:
        drawn.append(figure)
        return path

    monkeypatch.setattr("rig.presentation.picture.save", keep)
    match = {"kp": -1500.0, "ki": 9000.0, "kp_real": -2500.0}
    table = rows(three_springs(), own_optima).assign_attrs(impedance_match=json.dumps(match))
    first, *others = (each.name for each in stations.shown(gain_matrix(table).stations))
    names = (first, *others) if with_first else tuple(others)
    write_sliced(table, tmp_path / "a.png", (KI, KP), names=names)
    (figure,) = drawn
    panels = [
        axes
        for part in (figure, *figure.subfigs)
        for axes in part.axes
        if axes.get_subplotspec() is not None
    ]
    marks = [
        line.get_xydata().tolist()
        for axes in dict.fromkeys(panels)
        for line in axes.lines
        if line.get_marker() == "+"
    ]
    assert marks == ([[[0.0, -2500.0]]] if with_first else [])
