"""Point-by-point comparison of two runs of one matrix: B less A.

A negative difference means that B absorbs more. Its standard error combines those of both points as
independent; it does not contain systematic errors common to a whole run.

Points are matched by set point, within a tolerance for each column, on the columns that vary in at
least one run and exist in both. A column that varies in neither run is a setting of the whole run;
a difference is reported, not matched. A drive without settings (a commercial one) has no drive
columns: every set of drive parameters of one run is then compared with the same point of the other.

Points of different laws are no pairs. Two runs without a common law, or that each vary a column
which the other lacks, have different axes: no point of one belongs to a point of the other. The
comparison is then that of their best points, also in each sea that both ran.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis import labels
from rig.analysis.differences import (
    Difference,
    differences,
    normalised_sea,
    sea_text,
    unlike_sea_texts,
)
from rig.analysis.law_differences import common_laws, of_laws, recorded_laws, with_joint_laws
from rig.analysis.points import (
    Matrix,
    Point,
    Setting,
    gain_matrix,
    levels,
    varied_columns,
)
from rig.analysis.rows import INCOMPLETE, record_of, rig_time
from rig.analysis.slices import Optimum, best_optima
from rig.analysis.stored_rows import current_table
from rig.config.problems import format_rows
from rig.presentation import phrases
from rig.presentation.json_values import json_value
from rig.recording.runs.folder import RunInfo, run_info
from rig.recording.table_file import write_table
from rig.row_contents import DRIVE, Column, union
from rig.stations import Station, station_names

_ROUNDING = 1e-9  # relative to the value, added to the tolerance
_TINY = 1e-300  # avoids 0/0 where tolerance and value are 0


class ComparedRun(NamedTuple):
    """One of the two runs."""

    run: str
    campaign: str
    mode: str
    rig: str
    sea: str
    ended: str
    points: int  # measured
    rig_time_s: float  # of its executed ticks; NaN if unknown


class PowerDifference(NamedTuple):
    """A difference of power, B less A, W; the error is NaN if one of both is unknown."""

    watts: float
    error: float


class Pair(NamedTuple):
    """Measured points of both runs at one set point."""

    a: Point
    b: Point


class ConstantDifference(NamedTuple):
    """A column that varies in neither run and differs between them; None where a run lacks it."""

    column: Column
    a: float | None
    b: float | None


class MatchedPoints(NamedTuple):
    """The matched points of two matrices, and the points and columns without a counterpart."""

    pairs: tuple[Pair, ...]  # in the order of run A
    only_a: tuple[Point, ...]
    only_b: tuple[Point, ...]
    columns: tuple[Column, ...]  # matched on
    one_sided: tuple[Column, ...]  # vary in one run, absent from the other
    all_columns: tuple[Column, ...]  # of either run
    constant_differences: tuple[ConstantDifference, ...]
    alone_a: tuple[Column, ...] = ()  # of the one-sided columns those of A
    alone_b: tuple[Column, ...] = ()
    laws_a: tuple[str, ...] = ()  # that B lacks
    laws_b: tuple[str, ...] = ()
    laws_differ: bool = False  # no law is common

    @property
    def axes_differ(self) -> bool:
        """Whether no points are paired: no law is common, or each run varies a column alone."""
        return self.laws_differ or bool(self.alone_a and self.alone_b)


class BestPoints(NamedTuple):
    """The measured points of both runs that absorb most at a station; None without any."""

    a: Point | None
    b: Point | None


class Comparison(NamedTuple):
    """The comparison of two runs: differing settings and matched points."""

    a: ComparedRun
    b: ComparedRun
    warnings: tuple[str, ...]  # the loudest first
    same_sea: bool
    differences: tuple[Difference, ...]
    matched: MatchedPoints
    tolerances: Mapping[str, float]  # of the matched columns, SI
    stations: tuple[Station, ...]  # those of A that B has, too
    best: Mapping[str, BestPoints]  # by name of the station
    seas: Mapping[int, Mapping[str, BestPoints]] = {}  # by seed, if the axes differ
    caveats: Mapping[str, tuple[str, str]] = {}  # of the best points, by name of the station


def compare(
    run_a: Path,
    run_b: Path,
    tolerances: Mapping[str, float] | None = None,
    *,
    incomplete_rows: bool = False,
) -> Comparison:
    """Compare two recorded runs; ``tolerances`` (SI, by column name) override the columns' own.

    ``incomplete_rows`` is that of `rig.analysis.rows.row_table`. Raises RunError if a record cannot
    be read, and KeyError if the kind of rig has no rows and power.
    """
    facts_a, facts_b = run_info(run_a), run_info(run_b)
    table_a, table_b = (
        current_table(run, incomplete_rows=incomplete_rows) for run in (run_a, run_b)
    )
    matrices = with_joint_laws(
        (gain_matrix(table_a), gain_matrix(table_b)),
        (recorded_laws(facts_a.config), recorded_laws(facts_b.config)),
    )
    matched = match(*matrices, tolerances)
    seas = normalised_sea(facts_a), normalised_sea(facts_b)
    settings = differences(facts_a, facts_b)
    same_sea = not any(each.group == "sea" for each in settings)
    optima = best_optima(table_a), best_optima(table_b)
    b_stations = {station.name for station in matrices[1].stations}
    stations = tuple(each for each in matrices[0].stations if each.name in b_stations)
    tolerances_used = {c.name: (tolerances or {}).get(c.name, c.tolerance) for c in matched.columns}
    return Comparison(
        _describe_run(facts_a, table_a, matrices[0]),
        _describe_run(facts_b, table_b, matrices[1]),
        (
            *_withheld_rows(facts_a, table_a),
            *_withheld_rows(facts_b, table_b),
            *_warnings(facts_a, facts_b, seas, same_sea, matched),
        ),
        same_sea,
        tuple(settings),
        matched,
        tolerances_used,
        stations,
        {
            each.name: BestPoints(*(best_point(matrix.points, each.name) for matrix in matrices))
            for each in stations
        },
        _best_by_sea(*matrices, stations) if matched.axes_differ and same_sea else {},
        {
            each.name: (_caveat(optima[0], each.name), _caveat(optima[1], each.name))
            for each in stations
        },
    )


def _caveat(optima: Mapping[str, Optimum], name: str) -> str:
    return optima[name].caveat if name in optima else ""


def _best_by_sea(
    a: Matrix, b: Matrix, stations: tuple[Station, ...]
) -> dict[int, dict[str, BestPoints]]:
    """Return the best points of both runs in each sea, by seed; empty for runs in one sea."""
    sides = [[_in_seas(point) for point in matrix.points] for matrix in (a, b)]
    seeds = [{seed for point in side for seed in point} for side in sides]
    return {
        seed: {
            each.name: BestPoints(
                *(best_point([p[seed] for p in side if seed in p], each.name) for side in sides)
            )
            for each in stations
        }
        for seed in sorted(seeds[0] & seeds[1])
    }


def _in_seas(point: Point) -> dict[int, Point]:
    """Return a point as it was in each of several seas: of one alone, its error is unknown."""
    unknown = dict.fromkeys(point.power, math.nan)
    return {
        seed: point._replace(power=power, error=unknown, by_seed={})
        for seed, power in point.by_seed.items()
    }


def _describe_run(run_facts: RunInfo, table: xarray.Dataset, matrix: Matrix) -> ComparedRun:
    status = str(run_facts.status.get("status") or "no end recorded")
    rig = (run_facts.config.get("rig") or {}).get("name")
    return ComparedRun(
        run_facts.run,
        run_facts.campaign,
        run_facts.mode,
        str(rig or "not recorded"),
        sea_text(run_facts),
        status,
        len(matrix.points),
        rig_time(record_of(table), run_facts),
    )


def _withheld_rows(run_facts: RunInfo, table: xarray.Dataset) -> list[str]:
    """Return a warning about rows excluded because the record lacks ticks of them."""
    if not table.sizes.get("row", 0):
        return []
    rows = table["row"].values[table["state"].values == INCOMPLETE]
    reason = "ticks missing from the record (--incomplete-rows compares them)"
    return [f"{run_facts.run}: {format_rows(rows)} withheld, {reason}"] if len(rows) else []


def _warnings(
    facts_a: RunInfo,
    facts_b: RunInfo,
    seas: tuple[object, object],
    same_sea: bool,
    matched: MatchedPoints,
) -> list[str]:
    warnings = []
    if not same_sea:
        texts = unlike_sea_texts(facts_a, facts_b)
        warnings.append(f"DIFFERENT SEAS: A {texts[0]}; B {texts[1]}")
    elif not all(seas):
        warnings.append("SEA NOT RECORDED in both runs: they may be different")
    if facts_a.mode != facts_b.mode:
        modes = f"A {facts_a.mode or 'unknown'}, B {facts_b.mode or 'unknown'}"
        warnings.append(f"DIFFERENT EXECUTION MODES: {modes}")
    if matched.laws_differ:
        laws = [", ".join(names) for names in (matched.laws_a, matched.laws_b)]
        warnings.append(
            f"DIFFERENT LAWS: A has {laws[0]}; B has {laws[1]}; the best points are compared"
        )
    elif matched.axes_differ:
        alone = (matched.alone_a, matched.alone_b)
        axes = [", ".join(column.label for column in columns) for columns in alone]
        warnings.append(
            f"DIFFERENT AXES: A alone varies {axes[0]}; B alone varies {axes[1]}; the best "
            "points are compared"
        )
    elif not matched.pairs:
        warnings.append("NO SET POINT IN COMMON")
    return warnings


def has_column(matrix: Matrix, column: Column) -> bool:
    """Return whether a run has this setting; those of a drive without settings are 0."""
    if column.role == DRIVE:
        names = [each.name for each in matrix.columns if each.role == DRIVE]
        return any(setting.get(name, 0.0) for setting in matrix.planned for name in names)
    return any(column.name in setting for setting in matrix.planned)


def match(a: Matrix, b: Matrix, tolerances: Mapping[str, float] | None = None) -> MatchedPoints:
    """Match the measured points of ``a`` and ``b`` that have a common law.

    ``tolerances`` (SI, by column name) override the columns' own. Each point is used
    once, nearest pairs first, unless a column varies in one run alone.
    """
    both, only_a, only_b = common_laws(a, b)
    if not (only_a or only_b):
        return _match_points(a, b, tolerances)
    found = _match_points(of_laws(a, both), of_laws(b, both), tolerances)
    if not both:
        found = found._replace(columns=(), one_sided=union(*map(varied_columns, (a, b))))
    return found._replace(
        only_a=(*found.only_a, *of_laws(a, only_a).points),
        only_b=(*found.only_b, *of_laws(b, only_b).points),
        laws_a=tuple(sorted(only_a)),
        laws_b=tuple(sorted(only_b)),
        laws_differ=bool(a.planned and b.planned) and not both,
    )


def _match_points(
    a: Matrix, b: Matrix, tolerances: Mapping[str, float] | None = None
) -> MatchedPoints:
    """Match the measured points of two matrices, whatever their laws."""
    varied_names = {c.name for c in varied_columns(a)} | {c.name for c in varied_columns(b)}
    all_columns = union(a.columns, b.columns)
    limits = {c.name: c.tolerance for c in all_columns} | dict(tolerances or {})
    varied = [c for c in all_columns if c.name in varied_names]
    constant_columns = [c for c in all_columns if c not in varied]
    columns = tuple(c for c in varied if has_column(a, c) and has_column(b, c))
    one_sided = tuple(c for c in varied if c not in columns)
    alone_a, alone_b = (tuple(c for c in one_sided if has_column(m, c)) for m in (a, b))
    # A column that varies in B alone: several points of B share one point of A.
    reuse_a, reuse_b = bool(alone_b), bool(alone_a)
    paired = () if alone_a and alone_b else _candidate_pairs(a.points, b.points, columns, limits)
    candidates = sorted(paired)
    pairs: list[tuple[int, int]] = []
    used_a: set[int] = set()
    used_b: set[int] = set()
    for _, i, j in candidates:
        if (reuse_a or i not in used_a) and (reuse_b or j not in used_b):
            pairs.append((i, j))
            used_a.add(i)
            used_b.add(j)
    return MatchedPoints(
        tuple(Pair(a.points[i], b.points[j]) for i, j in sorted(pairs)),
        tuple(p for i, p in enumerate(a.points) if i not in used_a),
        tuple(p for j, p in enumerate(b.points) if j not in used_b),
        columns,
        one_sided,
        all_columns,
        tuple(_find_constant_differences(a, b, constant_columns, limits)),
        alone_a,
        alone_b,
    )


def _candidate_pairs(
    a: Sequence[Point],
    b: Sequence[Point],
    columns: tuple[Column, ...],
    limits: Mapping[str, float],
) -> Iterator[tuple[float, int, int]]:
    """Yield pairs within tolerance: squared distance in tolerances, index in A, index in B."""
    values_a, values_b = (
        np.array([[p.setting.get(c.name, np.nan) for c in columns] for p in points])
        for points in (a, b)
    )
    if not a or not b:
        return
    tolerance = np.array([limits[c.name] for c in columns])
    for i, value_a in enumerate(values_a):
        steps = np.abs(values_b - value_a)
        bounds = tolerance + _ROUNDING * np.maximum(np.abs(values_b), np.abs(value_a))
        for j in np.flatnonzero((steps <= bounds).all(axis=1)).tolist():
            yield float(np.sum((steps[j] / np.maximum(bounds[j], _TINY)) ** 2)), i, j


def _find_constant_differences(
    a: Matrix, b: Matrix, constant_columns: list[Column], limits: Mapping[str, float]
) -> list[ConstantDifference]:
    differences = []
    for column in constant_columns:
        value_a, value_b = _constant_value(a, column), _constant_value(b, column)
        if value_a is None and value_b is None:
            continue
        if value_a is None or value_b is None or abs(value_a - value_b) > limits[column.name]:
            differences.append(ConstantDifference(column, value_a, value_b))
    return differences


def _constant_value(matrix: Matrix, column: Column) -> float | None:
    values = levels(matrix, column.name)
    return values[0] if values and has_column(matrix, column) else None


def power_difference(pair: Pair, station: str) -> PowerDifference:
    """Return the power difference of one pair at a station, given by name."""
    a, b = pair
    error = math.hypot(a.error[station], b.error[station])
    return PowerDifference(b.power[station] - a.power[station], error)


def mean_difference(pairs: tuple[Pair, ...], station: str) -> PowerDifference:
    """Return the mean difference over all pairs; a point shared by pairs adds its error once."""
    if not pairs:
        return PowerDifference(math.nan, math.nan)
    sides = [(side, point) for pair in pairs for side, point in zip("ab", pair, strict=True)]
    counts = Counter((side, point.rows) for side, point in sides)
    errors = {(side, point.rows): point.error[station] for side, point in sides}
    variance = sum((counts[key] * errors[key]) ** 2 for key in counts) / len(pairs) ** 2
    watts = sum(power_difference(pair, station).watts for pair in pairs) / len(pairs)
    return PowerDifference(watts, math.sqrt(variance))


def joint_setting(matched: MatchedPoints, pair: Pair) -> Setting:
    """Return the set point of a pair: that of A, with the columns that B alone varies."""
    names = [c.name for c in (*matched.columns, *matched.one_sided)]
    merged = {**pair.b.setting, **pair.a.setting}
    for column in matched.one_sided:
        if pair.a.setting.get(column.name, 0.0) == 0.0 and column.name in pair.b.setting:
            merged[column.name] = pair.b.setting[column.name]
    in_order = (c.name for c in matched.all_columns if c.name in names)
    return {name: merged[name] for name in in_order if name in merged}


def describe_pair(matched: MatchedPoints, pair: Pair) -> str:
    """Return a pair's set point as text, with the offsets of B."""
    text = labels.format_settings(matched.all_columns, joint_setting(matched, pair))
    steps = ((c, pair.b.setting[c.name] - pair.a.setting[c.name]) for c in matched.columns)
    offsets = [f"{c.label} by {labels.format_quantity(c, step)}" for c, step in steps if step]
    return f"{text} (B differs in {', '.join(offsets)})" if offsets else text


def best_point(points: Sequence[Point], station: str) -> Point | None:
    """Return the measured point that absorbs most at a station; None without any."""
    measured = [point for point in points if math.isfinite(point.power[station])]
    return min(measured, key=lambda point: point.power[station], default=None)


def format_difference(difference: PowerDifference) -> str:
    """Return a difference (W) with its standard error as text without the unit."""
    return phrases.format_power(difference.watts, difference.error).removesuffix(" W")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as JSON data: powers in W, columns in SI, unknown values null."""

    def difference_json(difference: PowerDifference) -> dict[str, float]:
        return {"b_less_a": difference.watts, "standard_error": difference.error}

    def point_json(point: Point | None, name: str) -> dict[str, Any] | None:
        if point is None:
            return None
        powers = {"mean_w": point.power[name], "standard_error_w": point.error[name]}
        return {"rows": point.rows, "setting": point.setting, **powers}

    matched, names = comparison.matched, station_names(comparison.stations)
    means = {name: mean_difference(matched.pairs, name) for name in names}
    values = {
        "a": comparison.a,
        "b": comparison.b,
        "warnings": comparison.warnings,
        "same_sea": comparison.same_sea,
        "settings": comparison.differences,
        "set_points_held": [
            {"column": each.column.name, "unit": each.column.unit, "a": each.a, "b": each.b}
            for each in matched.constant_differences
        ],
        "matched_on": dict(comparison.tolerances),
        "varied_in_one_run": [column.name for column in matched.one_sided],
        "axes_differ": matched.axes_differ,
        "laws_in_one_run": {"a": matched.laws_a, "b": matched.laws_b},
        "mean_difference_w": {name: difference_json(mean) for name, mean in means.items()},
        "best": {
            name: {
                side: point and (point_json(point, name) or {}) | {"caveat": caveat}
                for side, point, caveat in zip("ab", best, comparison.caveats[name], strict=True)
            }
            for name, best in comparison.best.items()
        },
        "best_by_seed": {
            str(seed): {
                name: {
                    side: point and point_json(point, name)
                    for side, point in zip("ab", best, strict=True)
                }
                for name, best in by_station.items()
            }
            for seed, by_station in comparison.seas.items()
        },
        "pairs": [
            {
                "setting": joint_setting(matched, pair),
                "rows_a": pair.a.rows,
                "rows_b": pair.b.rows,
                **{
                    name: {"a": pair.a.power[name], "b": pair.b.power[name]}
                    | difference_json(power_difference(pair, name))
                    for name in names
                },
            }
            for pair in matched.pairs
        ],
        "only_a": [{"rows": p.rows, "setting": p.setting} for p in matched.only_a],
        "only_b": [{"rows": p.rows, "setting": p.setting} for p in matched.only_b],
    }
    return {key: json_value(value) for key, value in values.items()}


def write_csv(comparison: Comparison, path: Path) -> Path:
    """Write a CSV with a line for each pair, then for each unmatched point.

    Set points are in SI, powers in W; ``se`` is the standard error.
    """
    matched = comparison.matched
    columns = (*matched.columns, *matched.one_sided)
    names = station_names(comparison.stations)

    def settings(setting: Setting) -> dict[str, Any]:
        return {f"{c.name} [{c.unit}]": setting.get(c.name, "") for c in columns}

    def powers(side: str, point: Point) -> dict[str, Any]:
        values = {}
        for name in names:
            values[f"{name} {side} [W]"] = point.power[name]
            values[f"{name} {side} se [W]"] = point.error[name]
        return {f"rows {side}": " ".join(map(str, point.rows)), **values}

    lines: list[dict[str, Any]] = []
    for pair in matched.pairs:
        line = {"in": "both", **settings(joint_setting(matched, pair))}
        line |= powers("A", pair.a) | powers("B", pair.b)
        for name in names:
            difference = power_difference(pair, name)
            line[f"{name} B - A [W]"], line[f"{name} B - A se [W]"] = difference
        lines.append(line)
    for side, points in (("A", matched.only_a), ("B", matched.only_b)):
        lines += [{"in": side, **settings(p.setting), **powers(side, p)} for p in points]
    quantities = ("A", "A se", "B", "B se"), ("B - A", "B - A se")
    headings = ["in", "rows A", "rows B", *settings({})]
    headings += [f"{name} {each} [W]" for group in quantities for name in names for each in group]
    return write_table({each: [line.get(each, "") for line in lines] for each in headings}, path)
