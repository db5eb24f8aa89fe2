"""Points of the gain matrix: planned and measured set points, and the columns that vary."""

import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.compared_rows import BATCHES
from rig.analysis.cut_rows import cut_note
from rig.analysis.intervals import CONFIDENCE, Floats, combined_half_width
from rig.analysis.row_ends import END_REASON, WORSE
from rig.analysis.rows import COMPLETE, columns_of, stations_of
from rig.analysis.scatter import NO_ERROR, MeanError, error_of_sum, standard_error
from rig.analysis.uncertainty import BUDGET_ATTRIBUTE, CONTRIBUTIONS
from rig.presentation import phrases
from rig.row_contents import PANEL, Column, is_lacking, with_role
from rig.stations import Station, station_names

PERCENT = f"{100.0 * CONFIDENCE:g} %"
Setting = dict[str, float]
"""A set point by column name; unknown columns are absent."""


class Point(NamedTuple):
    """One set point of the gain matrix with the mean powers of its complete rows."""

    setting: Setting
    power: dict[str, float]  # W by station, negative is absorbed
    error: dict[str, float]  # W, standard error of `power`; NaN where unknown
    rows: tuple[int, ...]
    actuator: float = float("nan")  # position of the actuator of the panel column
    dof: dict[str, float] = {}  # noqa: RUF012 (degrees of freedom of `error` by station)
    by_seed: dict[int, dict[str, float]] = {}  # noqa: RUF012 (W, by seed of the sea and station)
    type_b: dict[str, Floats] = {}  # noqa: RUF012 (W, by station; shape: seas, sources of a budget)
    distributions: tuple[str, ...] = ()  # of the errors of these sources
    is_compared: bool = False  # with a row over the whole repeat period, which gives `error`
    cut_rows: tuple[int, ...] = ()  # rows that ended because they could no longer be the best
    window_error: dict[str, MeanError] = {}  # noqa: RUF012 (W, of the mean, by short windows alone)
    is_reference: bool = False  # one row over the whole repeat period: others are compared with it
    lacking: tuple[str, ...] = ()  # columns that its law lacks: their values mean nothing

    def contributions(self, name: str, seeds: Sequence[int] = ()) -> Floats:
        """Return the signed Type B contributions to the power of a station, W; empty without any.

        They are the mean over the rows, or over those in the seas of ``seeds``: all rows have the
        same errors, so repetitions and seas average the scatter, but not these.
        """
        if name not in self.type_b:
            return np.zeros(0)
        listed = list(self.by_seed)
        found = self.type_b[name][[listed.index(each) for each in seeds] or slice(None)]
        return np.asarray(found.mean(axis=0))

    def expanded(self, name: str) -> float:
        """Return the half width of the 95 % interval of a power by scatter and budget, W.

        NaN where the scatter is unknown.
        """
        error, dof = self.error[name], self.dof.get(name, np.inf)
        return combined_half_width(error, dof, self.contributions(name), self.distributions)

    def shown_error(self, name: str) -> float:
        """Return what people see after ±, W: the expanded uncertainty where a budget is known.

        Without one it is the standard error; `error_note` names which.
        """
        return self.expanded(name) if name in self.type_b else self.error[name]

    def power_text(self, name: str) -> str:
        """Return the power at a station with its `shown_error` as text."""
        return phrases.format_power(self.power[name], self.shown_error(name))


class Matrix(NamedTuple):
    """A gain matrix with its measured points."""

    points: tuple[Point, ...]  # measured points, in the order of the campaign
    planned: tuple[Setting, ...]  # every set point of the campaign, measured or not
    columns: tuple[Column, ...] = ()
    stations: tuple[Station, ...] = ()  # of the points' powers, in the order of the flow of power
    cut_note: str = ""  # the meaning of points with `cut_rows`; empty without any

    @property
    def panel(self) -> Column | None:
        """The column with a panel for each of its values; None without one."""
        return with_role(self.columns, PANEL)


def agrees(setting: Setting, fixed: Setting) -> bool:
    """Return whether a set point has these values; a column absent from it counts as equal."""
    return all(setting.get(name, value) == value for name, value in fixed.items())


def varied_columns(matrix: Matrix) -> list[Column]:
    """Return the columns that take more than one value in the campaign."""
    columns = []
    for column in matrix.columns:
        values = {setting[column.name] for setting in matrix.planned if column.name in setting}
        if len(values) > 1:
            columns.append(column)
    return columns


def levels(matrix: Matrix, name: str) -> list[float]:
    """Return the values that a column takes in the campaign, in increasing order."""
    return sorted({each[name] for each in matrix.planned if name in each})


def row_settings(table: xarray.Dataset) -> list[Setting]:
    """Return the set point of each row of the table.

    The set point of a run without a plan is a mean over its log. It is rounded to nine digits, so
    that rounding errors do not split one point into two.
    """
    names = (column.name for column in columns_of(table))
    columns = {name: table[name].values.tolist() for name in names if name in table}
    return [
        {
            name: float(f"{values[index]:.9g}") + 0.0  # there is no -0
            for name, values in columns.items()
            if np.isfinite(values[index])
        }
        for index in range(table.sizes.get("row", 0))
    ]


def degrees_of_freedom(table: xarray.Dataset, name: str) -> Floats:
    """Return those of a station's standard errors by row.

    They are infinite in a table without: that of a sweep by an earlier version.
    """
    key = f"power_{name}_dof"
    if key in table:
        return np.asarray(table[key].values)
    return np.full(table.sizes["row"], np.inf)


def gain_matrix(table: xarray.Dataset) -> Matrix:
    """Return the gain matrix of a row table; rows with equal set points form one point.

    The standard error of a repeated point comes from the scatter of its rows. Of a point in seas of
    several seeds, it comes from the scatter of the means of the seas, which count alike, and is at
    least the error by windows that ended early.
    """
    stations, matrix_columns = stations_of(table), columns_of(table)
    if "state" not in table or table.sizes["row"] == 0:
        return Matrix((), (), matrix_columns, stations)
    columns: dict[str, Any] = {str(name): table[name].values for name in table.variables}
    columns |= {f"power_{each.name}_dof": degrees_of_freedom(table, each.name) for each in stations}
    budget = json.loads(table.attrs.get(BUDGET_ATTRIBUTE, "{}"))
    distributions = tuple(budget.get("distributions", ()))
    settings = row_settings(table)
    planned: dict[tuple[tuple[str, float], ...], Setting] = {}
    members: dict[tuple[tuple[str, float], ...], list[int]] = {}
    for i, setting in enumerate(settings):
        key = tuple(setting.items())
        planned.setdefault(key, setting)
        if columns["state"][i] == COMPLETE:
            members.setdefault(key, []).append(i)

    panel = with_role(matrix_columns, PANEL)
    actuator = panel.actuator if panel else None
    points = tuple(
        _point(
            settings[rows[0]],
            columns,
            rows,
            station_names(stations),
            float(columns[actuator.name][rows[0]]) if actuator else float("nan"),
        )._replace(
            distributions=distributions,
            lacking=tuple(
                each.name
                for each in matrix_columns
                if is_lacking(each, matrix_columns, settings[rows[0]])
            ),
        )
        for rows in members.values()
    )
    return Matrix(points, tuple(planned.values()), matrix_columns, stations, cut_note(table))


def _point(
    setting: Setting, columns: dict[str, Any], rows: list[int], names: list[str], actuator: float
) -> Point:
    """Return the point of rows with one set point; ``columns`` are those of the row table."""
    # A sweep has one seed, or is over seeds: no column of its rows.
    has_seeds = "seed" in columns and columns["seed"].ndim == 1
    seeds = columns["seed"][rows] if has_seeds else np.zeros(len(rows), np.int64)
    in_sea = {
        int(seed): [r for r, s in zip(rows, seeds, strict=True) if s == seed] for seed in seeds
    }
    one_of_compared = len(rows) == 1 and BATCHES in columns and bool(columns[BATCHES].any())
    is_compared = one_of_compared and bool(columns[BATCHES][rows[0]])
    power, error, dof = dict[str, float](), dict[str, float](), dict[str, float]()
    type_b, window = dict[str, Floats](), dict[str, MeanError]()
    by_seed: dict[int, dict[str, float]] = {seed: {} for seed in in_sea} if len(in_sea) > 1 else {}
    for name in names:
        values = columns[f"power_{name}"]
        means = values[rows]
        if by_seed:
            means = np.array([values[group].mean() for group in in_sea.values()])
            for seed, mean in zip(in_sea, means.tolist(), strict=True):
                by_seed[seed][name] = mean
        power[name] = float(means.mean())
        if len(means) > 1:
            # Two seas may agree by chance, but their mean is no better known than its windows.
            window[name] = _window_error(name, columns, list(in_sea.values()))
            seas = MeanError(standard_error(means), len(means) - 1.0)
            error[name], dof[name] = max(seas, window[name], key=lambda each: each.error)
        else:
            error[name] = float(columns[f"power_{name}_se"][rows[0]])
            dof[name] = float(columns[f"power_{name}_dof"][rows[0]])
        if (shares := columns.get(f"power_{name}_{CONTRIBUTIONS}")) is not None:
            type_b[name] = np.array([shares[group].mean(axis=0) for group in in_sea.values()])
    numbers = tuple(columns["row"][rows].tolist())
    ends = columns[END_REASON][rows] if END_REASON in columns else [""] * len(rows)
    cut = tuple(row for row, end in zip(numbers, ends, strict=True) if end == WORSE)
    return Point(
        setting, power, error, numbers, actuator, dof, by_seed, type_b,
        is_compared=is_compared, cut_rows=cut, window_error=window,
        is_reference=one_of_compared and not is_compared,
    )  # fmt: skip


def _window_error(name: str, columns: dict[str, Any], groups: list[list[int]]) -> MeanError:
    """Return the error of the mean of the means of groups of rows, by windows that ended early.

    Such rows were compared with a row over the whole repeat period of the sea, which has none.
    """
    if BATCHES not in columns:
        return NO_ERROR
    return error_of_sum(
        MeanError(
            float(columns[f"power_{name}_se"][row]) / (len(group) * len(groups)),
            float(columns[f"power_{name}_dof"][row]),
        )
        for group in groups
        for row in group
        if columns[BATCHES][row]
    )


def error_source(points: Iterable[Point]) -> str:
    """Return the source of the points' standard errors as text; empty if no error is known."""
    sources = {
        _error_source(point)
        for point in points
        if any(np.isfinite(error) for error in point.error.values())
    }
    return f"scatter of {' and '.join(sorted(sources))}" if sources else ""


def error_note(points: Iterable[Point]) -> str:
    """Return what the ± of the points is as text; empty if no error is known."""
    points = tuple(points)
    if not (source := error_source(points)):
        return ""
    if any(point.type_b for point in points):
        return f"± {PERCENT} by {source} and Type B"
    return f"± standard error by {source}"


def _error_source(point: Point) -> str:
    if point.by_seed:
        return "seeds"
    if len(point.rows) > 1:
        return "repetitions"
    return "differences from a reference row" if point.is_compared else "wave periods"
