"""Surfaces pass through their points, end at the convex hull, and carry remarks."""

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from between_points import interpolator
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from synthetic_runs import POWERS, STATIONS_ATTRIBUTES

from rig.analysis.points import Point
from rig.analysis.slices import spans_surface, triangulate
from rig.analysis.surfaces import draw_surfaces, write_surfaces
from rig.presentation.picture import framed_figure, sign_note


def bowl(kp: float, ki: float) -> float:
    return -90.0 + ((kp + 2000.0) / 200.0) ** 2 + ((ki - 8000.0) / 800.0) ** 2


def point(kp: float, ki: float, power: float | None = None) -> Point:
    value = bowl(kp, ki) if power is None else power
    setting = {"spring_rate": 490.9, "kp": kp, "ki": ki}
    return Point(setting, dict.fromkeys(POWERS, value), dict.fromkeys(POWERS, 1.0), (), -13.0)


def with_soft_spring(of: Point) -> Point:
    return of._replace(setting={**of.setting, "spring_rate": -5715.0})


def places(measured: list[Point]) -> list[tuple[float, float]]:
    return [(p.setting["ki"], p.setting["kp"]) for p in measured]


def surface_of(measured: list[Point]) -> Any:
    return interpolator(places(measured), [p.power["ac"] for p in measured])


def grid(skip: set[tuple[float, float]] = frozenset()) -> list[Point]:  # type: ignore[assignment]
    gains = [(kp, ki) for kp in range(-3500, -999, 500) for ki in range(0, 10001, 2000)]
    return [point(float(kp), float(ki)) for kp, ki in gains if (kp, ki) not in skip]


def table(measured: list[Point]) -> xarray.Dataset:
    columns: dict[str, Any] = {
        "row": range(len(measured)),
        "point": range(len(measured)),
        "state": ["complete"] * len(measured),
        "stator": [p.actuator for p in measured],
        **{n: [p.setting[n] for p in measured] for n in ("spring_rate", "kp", "ki")},
    }
    for kind in POWERS:
        columns[f"power_{kind}"] = [p.power[kind] for p in measured]
        columns[f"power_{kind}_se"] = [p.error[kind] for p in measured]
    attributes = {"campaign": "default", "run": "r1", "mode": "rehearsal", **STATIONS_ATTRIBUTES}
    return xarray.Dataset(
        {k: ("row", np.array(list(v))) for k, v in columns.items()}, None, attributes
    )


def texts(measured: list[Point]) -> str:
    figure = Figure(layout="constrained")
    draw_surfaces(figure, table(measured), 8.0)
    figure.draw_without_rendering()
    parts = [t.get_text() for axes in figure.axes for t in [axes.title, *axes.texts]]
    return "\n".join([*parts, *(t.get_text() for t in figure.texts)])


def test_the_surface_passes_through_its_points() -> None:
    surface = surface_of(grid())
    for each in grid():
        assert float(surface(each.setting["ki"], each.setting["kp"])) == pytest.approx(
            each.power["ac"], abs=1e-9
        )


def test_interpolated_values_lie_between_neighbours() -> None:
    surface = surface_of(grid())
    random = np.random.default_rng(5)
    for ki, kp in zip(random.uniform(0, 1e4, 200), random.uniform(-3500, -1000, 200), strict=True):
        corners = [
            bowl(y, x)
            for x in (2000.0 * (ki // 2000.0), 2000.0 * (ki // 2000.0 + 1))
            for y in (500.0 * (kp // 500.0), 500.0 * (kp // 500.0 + 1))
        ]
        assert min(corners) - 1e-9 <= float(surface(ki, kp)) <= max(corners) + 1e-9


def test_a_hole_is_not_zero() -> None:
    surface = surface_of(grid({(-2000, 4000)}))
    neighbours = [bowl(-2000.0, 2000.0), bowl(-2000.0, 6000.0), bowl(-1500.0, 4000.0)]
    assert float(surface(4000.0, -2000.0)) <= max(neighbours)


def test_nothing_outside_the_points() -> None:
    surface = surface_of(grid())
    assert surface(10_100.0, -2000.0).mask
    assert surface(5000.0, -900.0).mask


def test_a_half_done_grid_is_not_bridged() -> None:
    measured = [p for p in grid() if p.setting["kp"] > -3500.0 or p.setting["ki"] == 0.0]
    surface = surface_of(measured)
    assert surface(6000.0, -3100.0).mask  # inside the hull, but between points far apart
    assert not surface(500.0, -3100.0).mask


@pytest.mark.parametrize("columns", [2, 3, 11])
def test_narrow_grids_are_surfaces(columns: int) -> None:
    measured = [point(kp, 1000.0 * i) for kp in (-2000.0, -1000.0) for i in range(columns)]
    assert spans_surface(places(measured))
    mesh = triangulate(places(measured))
    assert mesh.mask is None or not mesh.mask.any()


def test_too_few_or_collinear_points_are_no_surface() -> None:
    assert not spans_surface([(0.0, -1000.0), (100.0, -2000.0)])
    line = [point(-1000.0 - 500.0 * i, 2000.0 * i) for i in range(5)]
    assert not spans_surface(places(line))
    assert "points on one line" in texts(line)
    assert "2 points only" in texts(line[:2])
    assert "1 point only" in texts(line[:1])
    assert "no complete row" in texts([])


def drawn(measured: list[Point], not_run: tuple[int, ...] = ()) -> tuple[list[Axes], list[Axes]]:
    """Return panels and colour bars, row by row."""
    figure = Figure(layout="constrained")
    rows = table(measured)
    for i in not_run:
        rows["state"][i] = "not run"
    draw_surfaces(figure, rows, 8.0)
    colour_bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    return [axes for axes in figure.axes if axes not in colour_bars], colour_bars


def test_one_line_of_points_is_a_line_without_colours() -> None:
    one_kp = [point(-2000.0, 2000.0 * i) for i in range(5)]
    one_ki = [point(-1000.0 - 500.0 * i, 8000.0) for i in range(5)]
    for line, x in ((one_kp, "Ki, N/m"), (one_ki, "Kp, N·s/m"), (one_kp[:2], "Ki, N/m")):
        panels, bars = drawn(line)
        assert not bars
        assert [axes.get_xlabel() for axes in panels] == [x] * 4
        assert panels[2].get_ylabel() == "electrical AC, W"
    assert "points on one line" not in texts(one_kp)  # a line plot needs no remark
    assert "Kp −2000, Ki +8000 (grid's edge)" in texts(one_kp)
    assert len(drawn(grid())[1]) == 4


def test_missing_points_of_a_line_are_crosses_on_its_axis() -> None:
    panels, _ = drawn([point(-2000.0, 2000.0 * i) for i in range(5)], (1, 4))
    crosses = [line for line in panels[0].lines if line.get_marker() == "x"]
    assert [list(line.get_xdata()) for line in crosses] == [[2000.0, 8000.0]]
    assert panels[0].get_xlim()[1] > 8000.0
    assert panels[0].get_ylim()[0] > -95.0  # zero is not in the range


def test_the_power_axis_spans_at_least_one_percent() -> None:
    exact = point(-2000.0, 0.0, -603.7)._replace(error=dict.fromkeys(POWERS, 0.001))
    low, high = drawn([exact])[0][0].get_ylim()
    assert low < -603.7 < high
    assert high - low >= 1.0


def test_lines_of_several_springs_share_a_scale() -> None:
    first = [point(-2000.0, 2000.0 * i) for i in range(3)]
    second = [with_soft_spring(point(-3000.0, 2000.0 * i)) for i in (0, 1)]
    panels, bars = drawn([*first, *second])
    assert not bars
    assert panels[0].get_ylim() == panels[1].get_ylim()
    assert [axes.get_ylabel() for axes in panels[:2]] == ["mechanical, W", ""]


def test_a_line_next_to_a_surface_labels_its_axis() -> None:
    line = [with_soft_spring(point(-2000.0, 2000.0 * i)) for i in range(5)]
    panels, bars = drawn([*grid(), *line])
    assert len(bars) == 4
    assert [axes.get_ylabel() for axes in panels[:2]] == ["Kp, N·s/m", "mechanical, W"]


def test_the_optimum_is_marked_with_value_and_gains() -> None:
    shown = texts(grid())
    assert "−90.0 ± 1.0 W at Kp −2000, Ki +8000" in shown
    assert "spring +491 N/m, stator −13 %" in shown
    edge = [p for p in grid() if p.setting["ki"] <= 4000.0]
    assert "(grid's edge)" in texts(edge)


def test_a_row_without_a_number_is_left_out() -> None:
    broken = [*grid({(-2000, 8000)}), point(-2000.0, 8000.0, float("nan"))]
    assert "nan" not in texts(broken)


@pytest.mark.parametrize("found", [grid(), grid()[:1], []], ids=["grid", "one point", "nothing"])
def test_a_picture_is_written(tmp_path: Path, found: list[Point]) -> None:
    picture = imread(write_surfaces(table(found), tmp_path / "surfaces.png"))
    assert picture.shape[0] > 500
    assert picture.std() > 0.01  # not blank


@pytest.mark.parametrize("letters", [5, 20, 40, 64])
@pytest.mark.parametrize("width", [6.6, 8.0, 12.8])
def test_the_subtitle_does_not_overlap_the_run(letters: int, width: float) -> None:
    attributes = {"run": f"20260504T093000Z_{'m' * letters}", "mode": "rehearsal"}
    subtitle = "other columns at the optimum of each panel"
    figure, _ = framed_figure(width, 3.0, "Power surfaces", attributes, subtitle=subtitle)
    figure.draw_without_rendering()
    texts = {text.get_text(): text.get_window_extent() for text in figure.subfigs[0].texts}
    run = next(box for text, box in texts.items() if text.startswith("run "))
    assert not texts[subtitle].overlaps(run)


@pytest.mark.parametrize("subtitle", ["", "other columns at the optimum of each panel"])
def test_a_long_note_stays_within_the_picture(subtitle: str) -> None:
    """The note on errors by a reference row was cut at the left."""
    attributes = {"run": "20261127T150457Z_basin", "mode": "rehearsal"}
    note = sign_note("± standard error by scatter of differences from a reference row")
    figure, _ = framed_figure(6.6, 3.0, "Power surfaces", attributes, note, subtitle)
    figure.draw_without_rendering()
    boxes = {text.get_text(): text.get_window_extent() for text in figure.subfigs[0].texts}
    assert {"run 20261127T150457Z_basin", note, *filter(None, [subtitle])} <= boxes.keys()
    head = figure.subfigs[0].bbox
    shown = [box for text, box in boxes.items() if text]
    assert all(box.x0 >= head.x0 and box.x1 <= head.x1 for box in shown)
    assert all(box.y0 >= head.y0 and box.y1 <= head.y1 for box in shown)
    assert not any(a.overlaps(b) for a, b in combinations(shown, 2))
