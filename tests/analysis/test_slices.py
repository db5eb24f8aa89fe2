"""Slices through a matrix of many columns: where they lie, what is in them, what is said."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from between_points import interpolator
from matplotlib.figure import Figure
from matplotlib.image import imread

from rig.analysis import labels, panel
from rig.analysis.labels import BY_NAME, column
from rig.analysis.mesh import triangulation
from rig.analysis.points import Matrix, Point, matrix, varied
from rig.analysis.rows import POWERS
from rig.analysis.slices import KI, KP, SPRING_RATE, cut, optima, projected, remarks
from rig.analysis.surfaces import (
    can_be_sliced,
    default_view,
    draw,
    heading,
    scattered,
    write_sliced,
    write_surfaces,
)

SPRINGS = (490.9, -2763.0, -5715.0)
NO_ERROR = float("nan")


def rows(settings: list[dict[str, float]], power: Any, error: float = 0.5) -> xarray.Dataset:
    """A row table with a row for each setting, and power (W) by kind from ``power(setting)``."""
    names = settings[0]
    columns: dict[str, Any] = {
        "row": range(len(settings)),
        "state": ["complete"] * len(settings),
        "stator": [-13.0] * len(settings),
        "periods": [5] * len(settings),
        **{name: [each[name] for each in settings] for name in names},
    }
    told = [power(each) for each in settings]
    for kind in POWERS:
        columns[f"power_{kind}"] = [each[kind] for each in told]
        columns[f"power_{kind}_se"] = [error] * len(settings)
    attributes = {"campaign": "three", "run": "r1", "mode": "hil"}
    return xarray.Dataset(
        {name: ("row", np.array(list(values))) for name, values in columns.items()},
        None,
        attributes,
    )


def three() -> list[dict[str, float]]:
    grid = product(SPRINGS, (-3000.0, -2000.0, -1000.0), (-4000.0, 0.0, 4000.0))
    return [{"spring_rate": ks, "kp": kp, "ki": ki} for ks, kp, ki in grid]


def own_optima(at: dict[str, float]) -> dict[str, float]:
    """Mechanical power is best at the stiffest spring, AC in the middle, DC at the softest."""
    bowl = ((at["kp"] + 2000.0) / 500.0) ** 2 + (at["ki"] / 2000.0) ** 2
    best = dict(zip(("mechanical_1", "ac", "dc"), SPRINGS, strict=True))
    power = {k: -50.0 + bowl + abs(at["spring_rate"] - s) / 500.0 for k, s in best.items()}
    return power | {"mechanical_2": -10.0 + bowl}


def test_each_station_is_sliced_at_its_own_optimum() -> None:
    table = rows(three(), own_optima)
    found = matrix(table)
    for kind, spring in zip(("mechanical_1", "ac", "dc"), SPRINGS, strict=True):
        slice_ = cut(found, kind, KI, KP)
        assert slice_.sliced == {"spring_rate": spring}
        assert len(slice_.points) == 9
        assert {p.spring_rate for p in slice_.points} == {spring}
        assert slice_.best is not None
        assert (slice_.best.power, slice_.best.error) == (-50.0, 0.5)
        assert not slice_.best.at_edge
        expected = f"sliced at spring rate {labels.quantity(SPRING_RATE, spring)}"
        assert heading(slice_).endswith(expected)
    assert can_be_sliced(found)
    at_one_spring = tuple(p for p in found.points if p.setting["spring_rate"] == SPRINGS[0])
    assert len(at_one_spring) > 3
    assert not can_be_sliced(found._replace(points=at_one_spring))  # a run that ended early


def test_a_held_column_stays_where_it_is_held() -> None:
    found = matrix(rows(three(), own_optima))
    held = cut(found, "dc", KI, KP, {"spring_rate": 490.9})
    assert (held.held, held.sliced) == ({"spring_rate": 490.9}, {})
    assert held.best is not None
    assert held.best.point.spring_rate == 490.9
    assert heading(held) == "electrical DC\nspring rate +491 N/m held"
    near = cut(found, "dc", KI, KP, {"spring_rate": 490.9 * (1.0 + 1e-8)})
    assert near.points == held.points
    with pytest.raises(ValueError, match=r"never \+500 N/m; there is −5715 N/m, −2763 N/m, \+491"):
        cut(found, "dc", KI, KP, {"spring_rate": 500.0})


def test_any_column_can_be_left_out() -> None:
    found = matrix(rows(three(), own_optima))
    slice_ = cut(found, "dc", SPRING_RATE, KP)
    assert slice_.sliced == {"ki": 0.0}
    assert sorted(slice_.places) == sorted(product(SPRINGS, (-3000.0, -2000.0, -1000.0)))
    assert slice_.best is not None
    assert slice_.best.at_edge  # the softest spring is the last
    surface = interpolator(slice_.places, slice_.values)
    for place, value in zip(slice_.places, slice_.values, strict=True):
        assert float(surface(*place)) == pytest.approx(value)


def test_more_columns_are_sliced_together() -> None:
    settings = [
        {**at, "bus_voltage": bus, "switching_period": period}
        for at in three()
        for bus in (60.0, 90.0)
        for period in (50e-6, 200e-6)
    ]

    def power(at: dict[str, float]) -> dict[str, float]:
        more = at["bus_voltage"] / 10.0 - at["switching_period"] * 1e4
        return {kind: value + more for kind, value in own_optima(at).items()}

    table = rows(settings, power)
    found = matrix(table)
    slice_ = cut(found, "ac", KI, KP)
    assert slice_.sliced == {"spring_rate": -2763.0, "bus_voltage": 60.0, "switching_period": 2e-4}
    assert len(slice_.points) == 9
    drive = cut(found, "ac", BY_NAME["switching_period"], BY_NAME["bus_voltage"], {"kp": -1000.0})
    assert (drive.held, len(drive.points)) == ({"kp": -1000.0}, 4)
    # By spring rate, the best point's neighbours are those that differ in Kp and Ki alone.
    for best in optima(table):
        assert best.point.setting["bus_voltage"] == 60.0
        assert (best.at_edge, best.at_gap, best.points) == (False, False, 36)


def drive_settings() -> list[dict[str, float]]:
    grid = product((40.0, 75.0, 80.0), (50e-6, 100e-6, 200e-6), (0.0, 0.1))
    gains = {"spring_rate": -8508.0, "kp": -2500.0, "ki": 3000.0}
    names = ("bus_voltage", "switching_period", "velocity_threshold")
    return [gains | dict(zip(names, each, strict=True)) for each in grid]


def drive_power(at: dict[str, float]) -> dict[str, float]:
    """Mechanical power knows the threshold and 0.1 % of voltage, AC noise, DC all three."""
    bus, period, threshold = list(at.values())[3:]
    noise = 0.004 * np.sin(bus * 7.0 + period * 1e6)
    dc = -28.0 + bus / 8.0 - period * 5e4 - 20.0 * threshold
    mechanical = -67.0 - 0.001 * bus + 11.0 * threshold
    return dict(zip(POWERS, (mechanical, mechanical, -42.0 + noise, dc), strict=True))


def test_columns_that_make_no_difference_have_no_best_value() -> None:
    found = {best.kind: best for best in optima(rows(drive_settings(), drive_power, 0.005))}
    assert {kind: best.idle for kind, best in found.items()} == {
        "mechanical_1": ("bus_voltage", "switching_period"),
        "mechanical_2": ("bus_voltage", "switching_period"),
        "ac": ("bus_voltage", "switching_period", "velocity_threshold"),
        "dc": (),
    }
    over = BY_NAME["bus_voltage"], BY_NAME["switching_period"]
    drawn = {kind: cut(matrix(rows(drive_settings(), drive_power, 0.005)), kind, *over)
             for kind in ("mechanical_1", "ac", "dc")}  # fmt: skip
    said = {kind: (each.best.doubt, remarks(each)[1:]) for kind, each in drawn.items() if each.best}
    assert said == {
        "mechanical_1": ("within 1 %", ["all within 1 %"]),
        "ac": ("within errors", ["no more spread than its errors explain"]),
        "dc": ("grid's edge", []),
    }
    assert "grid's edge" not in panel.caption(drawn["ac"], 6.0)


def test_a_column_of_two_values_has_no_edge() -> None:
    """Both lie at its ends, and that says nothing; of three the outer two do."""
    for kps, edge in (((-2000.0, -1000.0), False), ((-3000.0, -2000.0, -1000.0), True)):
        settings = [
            {"spring_rate": 490.9, "kp": kp, "ki": ki}
            for kp in kps
            for ki in (-4000.0, 0.0, 4000.0)
        ]

        def power(at: dict[str, float]) -> dict[str, float]:
            return dict.fromkeys(POWERS, -50.0 + at["kp"] / 100.0 + (at["ki"] / 1000.0) ** 2)

        assert {best.at_edge for best in optima(rows(settings, power))} == {edge}


def test_a_point_asked_for_twice_is_one_with_its_error() -> None:
    again = [*three(), *three()[:1], *three()[:1]]
    table = rows(again, own_optima)
    table["power_dc"][0] += 3.0
    found = matrix(table)
    assert len(found.points) == len(found.asked) == 27
    first = found.points[0]
    values = table["power_dc"].values[[0, 27, 28]]
    assert first.rows == (0, 27, 28)
    assert first.power["dc"] == pytest.approx(values.mean())
    assert first.error["dc"] == pytest.approx(values.std(ddof=1) / np.sqrt(3.0))


def test_a_setting_read_from_a_log_is_the_setting() -> None:
    settings = three()
    settings[4] = {name: value * (1.0 + 1e-13) for name, value in settings[4].items()}
    settings[5]["ki"] = -0.0 if settings[5]["ki"] == 0.0 else settings[5]["ki"]
    found = matrix(rows(settings, own_optima))
    assert [c.name for c in varied(found)] == ["spring_rate", "kp", "ki"]
    assert len({p.kp for p in found.points}) == 3


def missing(*places: int) -> xarray.Dataset:
    table = rows(three(), own_optima)
    for i in places:
        table["state"][i] = "not run"
    return table


def test_missing_points_are_counted_and_are_no_zeros() -> None:
    at = [i for i, each in enumerate(three()) if each["spring_rate"] == -5715.0]
    slice_ = cut(matrix(missing(at[3], at[8])), "dc", KI, KP)
    assert len(slice_.points) == 7
    assert slice_.missing == ((-4000.0, -2000.0), (4000.0, -1000.0))
    assert remarks(slice_) == ["2 points not measured (×)"]
    surface = interpolator(slice_.places, slice_.values)
    assert float(surface(-4000.0, -2000.0)) < -40.0
    assert surface(4000.0, -1000.0).mask
    assert slice_.best is not None
    assert slice_.best.at_gap


def test_what_is_no_even_full_grid_is_said() -> None:
    def said(kis: list[float], skip: set[tuple[float, float]] = frozenset()) -> list[str]:  # type: ignore[assignment]
        settings = [
            {"spring_rate": 490.9, "kp": kp, "ki": ki}
            for kp in (-3000.0, -2000.0, -1000.0)
            for ki in kis
            if (kp, ki) not in skip
        ]
        return remarks(cut(matrix(rows(settings, own_optima)), "dc", KI, KP))

    assert said([-4000.0, 0.0, 4000.0]) == []
    assert said([-4000.0, 0.0, 500.0]) == ["Ki unevenly spaced"]
    assert said([-4000.0, 0.0, 4000.0], {(-3000.0, 0.0)}) == ["no full grid"]
    lonely = {(-2000.0, 0.0), (-2000.0, 500.0), (-3000.0, 500.0), (-1000.0, 0.0)}
    assert said([0.0, 500.0], lonely) == ["2 points only"]
    assert said([0.0]) == []  # a line: its axis says so
    pair = {(-3000.0, 0.0)}
    assert said([0.0], pair) == ["2 points only"]


def test_a_surface_of_noise_is_called_so() -> None:
    random = np.random.default_rng(1)

    def noise(at: dict[str, float]) -> dict[str, float]:
        return dict.fromkeys(POWERS, float(-50.0 + random.normal(0.0, 0.5)))

    said = "no more spread than its errors explain"
    held = {"spring_rate": 490.9}
    assert said in remarks(cut(matrix(rows(three(), noise)), "dc", KI, KP, held))
    assert said not in remarks(cut(matrix(rows(three(), own_optima)), "dc", KI, KP, held))
    unknown = rows(three(), noise, error=NO_ERROR)
    assert said not in remarks(cut(matrix(unknown), "dc", KI, KP, held))


def test_long_cells_of_an_uneven_grid_are_surface() -> None:
    places = list(product((0.0, 1000.0, 2000.0, 20_000.0), (-3000.0, -2000.0, -1000.0)))
    mesh = triangulation(places)
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


def test_what_a_picture_shows_where_nothing_is_asked() -> None:
    view = default_view(matrix(rows(three(), own_optima)))
    assert (view.x, view.y, view.by_spring) == (KI, KP, True)
    one_gain = [each for each in three() if each["ki"] == 0.0]
    assert default_view(matrix(rows(one_gain, own_optima))).by_spring
    springs = [each for each in one_gain if each["kp"] == -2000.0]
    view = default_view(matrix(rows(springs, own_optima)))
    assert (view.x.name, view.by_spring) == ("spring_rate", False)
    drive = [
        {**springs[0], "bus_voltage": bus, "switching_period": period, "kp": kp}
        for bus in (60.0, 75.0, 90.0)
        for period in (5e-5, 1e-4, 1.5e-4, 2e-4)
        for kp in (-2000.0, -1500.0)
    ]
    view = default_view(matrix(rows(drive, own_optima)))
    assert {view.x.name, view.y.name} == {"switching_period", "bus_voltage"}
    assert default_view(Matrix((), ())).by_spring


@pytest.mark.parametrize("kinds", [("dc",), ("mechanical_2", "ac", "dc")])
def test_slices_are_drawn(tmp_path: Path, kinds: tuple[str, ...]) -> None:
    table = missing(0, 5)
    picture = imread(write_sliced(table, tmp_path / "a.png", SPRING_RATE, KP, kinds=kinds))
    assert picture.std() > 0.05
    lines = table.isel(row=[i for i, each in enumerate(three()) if each["ki"] == 0.0])
    assert imread(write_sliced(lines, tmp_path / "b.png", kinds=kinds)).std() > 0.02
    assert imread(write_sliced(table.isel(row=[]), tmp_path / "c.png", kinds=kinds)).std() > 0.01
    with pytest.raises(ValueError, match="cannot be both axes"):
        write_sliced(table, tmp_path / "d.png", KP, KP)


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


def test_of_a_scattered_matrix_every_point_is_shown(tmp_path: Path) -> None:
    table = hypercube()
    found = matrix(table)
    assert scattered(found)
    assert not can_be_sliced(found)
    assert not scattered(matrix(rows(three(), own_optima)))
    of = projected(found, "dc", KI, KP)
    assert (len(of.points), of.sliced) == (40, {})
    assert of.best is not None
    assert of.best.power == float(table["power_dc"].min())
    figure = Figure(layout="constrained")
    draw(figure, table, 8.0)
    dots = [axes.collections[0].get_offsets() for axes in figure.axes[:3]]
    assert all(len(each) == 40 for each in dots)
    assert sorted(dots[0][:, 0]) == pytest.approx(sorted(table["ki"].values))
    assert "all 40 points" in figure.axes[0].get_title()
    assert imread(write_surfaces(table, tmp_path / "x.png")).std() > 0.03


def test_columns_are_written_as_people_say_them() -> None:
    period = column("switching_period_s")
    assert period is BY_NAME["switching_period"]
    assert labels.heading(period) == "switching period, µs"
    assert labels.setting(period, 50e-6) == "switching period 50 µs"
    assert labels.quantity(BY_NAME["discharge_level"], 15.0) == "15"
    assert labels.quantity(KP, -2500.0) == "−2500 N·s/m"
    assert labels.number(BY_NAME["velocity_threshold"], 0.05) == "0.05"
    assert labels.number(SPRING_RATE, 490.9) == "+491"
    with pytest.raises(KeyError, match="no column 'speed'; there are spring_rate, kp"):
        column("speed")


def test_a_point_knows_what_it_was_told() -> None:
    point = Point({"kp": -1.0}, 0.0, {}, {}, ())
    assert point.kp == -1.0
    assert np.isnan([point.ki, point.spring_rate]).all()


def test_power_that_hardly_differs_is_drawn_flat() -> None:
    """0.01 W from end to end is not blown up to all colours; 1 W is shown as it is."""
    flat, hilly = panel.scale([-67.51, -67.52]), panel.scale([-67.0, -68.0])
    assert flat.norm(-67.51) == pytest.approx(flat.norm(-67.52), abs=0.02)
    assert hilly.norm(-67.0) - hilly.norm(-68.0) > 0.7
    even = panel.scale([0.01, 0.02], even=True)
    assert even.norm(0.0) == pytest.approx(0.5)
