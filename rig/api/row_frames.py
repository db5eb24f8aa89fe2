"""The rows of a run as a table of pandas, and their powers over the columns that vary."""

from collections.abc import Iterable
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from rig.analysis.labels import format_number
from rig.analysis.points import Matrix, Point, gain_matrix, levels, varied_columns
from rig.analysis.rows import (
    COMPLETE,
    INCOMPLETE,
    INTERRUPTED,
    NOT_RUN,
    columns_of,
    values_of_laws,
)
from rig.analysis.uncertainty import SOURCE
from rig.recording.runs import RunInfo, reader
from rig.recording.runs.windows import read_windows
from rig.row_contents import Column

if TYPE_CHECKING:
    import pandas

_MAX_GAPS = 4  # cells of a grid for each point; above it the points are listed
_ALARM = "_alarm"
UNITS = "units"  # attribute of a table: units by column


def row_frame(table: xarray.Dataset) -> "pandas.DataFrame":
    """Return a row table as a DataFrame by row; units are in its `attrs`.

    Values that stand for a name are that name, alarms are bools, columns that a row's law lacks are
    NaN. The contributions of the sources of a budget, which have two dimensions, stay in the
    dataset.
    """
    import pandas

    columns: dict[str, Any] = {}
    for name, variable in table.variables.items():
        if SOURCE in variable.dims:
            continue
        values = variable.values
        columns[str(name)] = values.astype(bool) if str(name).endswith(_ALARM) else values
    columns |= values_of_laws(table)
    for column in columns_of(table):
        if column.choices and column.name in columns:
            numbers = columns[column.name].tolist()
            columns[column.name] = [_choice(column, number) for number in numbers]
    frame = pandas.DataFrame(columns)
    frame = frame.set_index("row") if "row" in frame else frame.rename_axis("row")
    frame.attrs[UNITS] = {
        str(name): str(variable.attrs["units"])
        for name, variable in table.variables.items()
        if "units" in variable.attrs and name in columns
    }
    return frame


def _choice(column: Column, number: float) -> str:
    return format_number(column, number) if np.isfinite(number) else ""


def session_frame(path: Path, info: RunInfo) -> "pandas.DataFrame":
    """Return the planned rows of a session with their states, as of the rows of a campaign."""
    import pandas

    planned = {int(row["row"]): row for row in info.plan.get("rows") or []}
    states: dict[int, dict[str, Any]] = {}
    for window in read_windows(reader.open_files(path), ["time"], info.plan, incomplete_rows=True):
        if window.row < 0:
            continue
        state = INTERRUPTED if window.incomplete_reason else COMPLETE
        state = INCOMPLETE if state == COMPLETE and window.missing else state
        states[window.row] = {
            "state": state,
            "incomplete_reason": window.incomplete_reason or window.missing_text,
            "start": float(window.data["time"][0]),
            "samples": len(window.data),
        }
    unmeasured = {"state": NOT_RUN, "incomplete_reason": "", "start": np.nan, "samples": 0}
    rows = [
        {key: _plain(value) for key, value in planned[row].items()} | states.get(row, unmeasured)
        for row in sorted(planned)
    ]
    frame = pandas.DataFrame(rows)
    frame = frame.set_index("row") if rows else frame.rename_axis("row")
    frame.attrs[UNITS] = {"start": "s"}
    return frame


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, str | int | float) else str(value)


def power_surfaces(table: xarray.Dataset) -> xarray.Dataset:
    """Return the powers of the points of a gain matrix over the columns that vary.

    Rows of equal set points are one point: their mean. A grid has a dimension for each column, with
    NaN where nothing was measured; a scattered matrix has the dimension `point`, with the columns
    as coordinates. Values that stand for a name are that name.
    """
    matrix = gain_matrix(table)
    varied = varied_columns(matrix)
    sizes = [len(levels(matrix, column.name)) for column in varied]
    if not varied or prod(sizes) > _MAX_GAPS * len(matrix.planned):
        return _listed_points(matrix, varied)
    axes = {column.name: levels(matrix, column.name) for column in varied}
    place = {name: {value: i for i, value in enumerate(axis)} for name, axis in axes.items()}
    found = xarray.Dataset(coords={c.name: _coordinate(c, axes[c.name]) for c in varied})
    points = [p for p in matrix.points if all(name in p.setting for name in axes)]
    where = tuple(
        np.array([place[name][p.setting[name]] for p in points], np.int64) for name in axes
    )
    for name, (values, attributes) in _results(matrix, points).items():
        grid = np.full(sizes, np.nan)
        grid[where] = values
        found[name] = (tuple(axes), grid, attributes)
    return found


def _listed_points(matrix: Matrix, varied: Iterable[Column]) -> xarray.Dataset:
    found = xarray.Dataset(
        {
            name: ("point", values, attributes)
            for name, (values, attributes) in _results(matrix, list(matrix.points)).items()
        }
    )
    coordinates = {
        column.name: (
            "point",
            *_coordinate(column, [p.setting.get(column.name, np.nan) for p in matrix.points])[1:],
        )
        for column in varied
    }
    return found.assign_coords(coordinates)


def _coordinate(column: Column, values: list[float]) -> tuple[str, Any, dict[str, str]]:
    attributes = {"long_name": column.label} | ({} if column.choices else {UNITS: column.unit})
    return (
        column.name,
        [_choice(column, v) for v in values] if column.choices else values,
        attributes,
    )


def _results(matrix: Matrix, points: list[Point]) -> dict[str, tuple[list[float], dict[str, str]]]:
    """Return power and standard error of each station, and the expanded uncertainty by a budget.

    `ended_early` is 1 where a row was cut because it could no longer be the best, if any was.
    """
    found: dict[str, tuple[list[float], dict[str, str]]] = {}
    for station in matrix.stations:
        name, label = station.name, station.label
        attributes = {UNITS: "W", "long_name": label}
        found[f"power_{name}"] = [p.power[name] for p in points], attributes
        error = attributes | {"long_name": f"{label}, standard error"}
        found[f"power_{name}_se"] = [p.error[name] for p in points], error
        if any(name in p.type_b for p in points):
            expanded = attributes | {"long_name": f"{label}, expanded uncertainty (95 %)"}
            found[f"power_{name}_expanded"] = [p.expanded(name) for p in points], expanded
    if matrix.cut_note:
        note = {UNITS: "1", "long_name": matrix.cut_note}
        found["ended_early"] = [float(bool(p.cut_rows)) for p in points], note
    return found
