"""Point-by-point comparison of two runs of one matrix: B less A.

A negative difference means that B absorbs more. Its standard error combines those of both points as
independent; it does not contain systematic errors common to a whole run.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import xarray

from rig.analysis import labels
from rig.analysis.alarms import format_rows
from rig.analysis.differences import ABSENT, Difference, differences, normalised_sea
from rig.analysis.matching import (
    TOLERANCES,
    ConstantDifference,
    MatchedPoints,
    Pair,
    match,
    set_point_offsets,
)
from rig.analysis.points import Matrix, Point, Setting, gain_matrix
from rig.analysis.rows import INCOMPLETE, row_table
from rig.analysis.run_columns import column_named, known_columns
from rig.presentation import phrases
from rig.recording.runs.folder import RunInfo, run_info
from rig.stations import Station


class ComparedRun(NamedTuple):
    """One of the two runs."""

    run: str
    campaign: str
    mode: str
    rig: str
    sea: str
    ended: str
    points: int  # measured


class PowerDifference(NamedTuple):
    """A difference of power, B less A, W; the error is NaN if one of both is unknown."""

    watts: float
    error: float


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


def compare(
    run_a: Path,
    run_b: Path,
    tolerances: Mapping[str, float] | None = None,
    *,
    incomplete_rows: bool = False,
) -> Comparison:
    """Compare two recorded runs; ``tolerances`` (SI, by column name) override `TOLERANCES`.

    ``incomplete_rows`` is that of `rig.analysis.rows.row_table`. Raises RunError if a record cannot
    be read, and KeyError if the kind of rig has no rows and power.
    """
    facts_a, facts_b = run_info(run_a), run_info(run_b)
    table_a, table_b = (row_table(run, incomplete_rows=incomplete_rows) for run in (run_a, run_b))
    return compare_tables(facts_a, facts_b, table_a, table_b, tolerances)


def compare_tables(
    facts_a: RunInfo,
    facts_b: RunInfo,
    table_a: xarray.Dataset,
    table_b: xarray.Dataset,
    tolerances: Mapping[str, float] | None = None,
) -> Comparison:
    """Return the comparison of two runs from their facts and row tables."""
    matrices = gain_matrix(table_a), gain_matrix(table_b)
    matched = match(*matrices, tolerances)
    seas = normalised_sea(facts_a), normalised_sea(facts_b)
    settings = differences(facts_a, facts_b)
    same_sea = not any(each.group == "sea" for each in settings)
    tolerances_used = {
        c.name: {**TOLERANCES, **(tolerances or {})}[c.name] for c in matched.columns
    }
    return Comparison(
        _describe_run(facts_a, matrices[0]),
        _describe_run(facts_b, matrices[1]),
        (
            *_withheld_rows(facts_a, table_a),
            *_withheld_rows(facts_b, table_b),
            *_warnings(facts_a, facts_b, seas, same_sea, matched),
        ),
        same_sea,
        tuple(settings),
        matched,
        tolerances_used,
        tuple(s for s in matrices[0].stations if s.name in {x.name for x in matrices[1].stations}),
    )


def _describe_run(run_facts: RunInfo, matrix: Matrix) -> ComparedRun:
    sea = run_facts.plan.get("sea") or {}
    status = str(run_facts.status.get("status") or "no end recorded")
    sea_text = str(sea.get("words") or sea.get("kind") or "not recorded")
    rig = (run_facts.config.get("rig") or {}).get("name")
    return ComparedRun(
        run_facts.run,
        run_facts.campaign,
        run_facts.mode,
        str(rig or "not recorded"),
        sea_text,
        status,
        len(matrix.points),
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
        texts = [
            str((f.plan.get("sea") or {}).get("words") or "not recorded")
            for f in (facts_a, facts_b)
        ]
        if texts[0] == texts[1]:
            texts = [f"{text} ({number})" for text, number in zip(texts, seas, strict=True)]
        warnings.append(f"DIFFERENT SEAS: A {texts[0]}; B {texts[1]}")
    elif not all(seas):
        warnings.append("SEA NOT RECORDED in both runs: they may be different")
    if facts_a.mode != facts_b.mode:
        modes = f"A {facts_a.mode or 'unknown'}, B {facts_b.mode or 'unknown'}"
        warnings.append(f"DIFFERENT EXECUTION MODES: {modes}")
    if not matched.pairs:
        warnings.append("NO SET POINT IN COMMON")
    return warnings


def power_difference(pair: Pair, station: str) -> PowerDifference:
    """Return the power difference of one pair at a station, given by name."""
    a, b = pair
    error = math.hypot(a.error[station], b.error[station])
    return PowerDifference(b.power[station] - a.power[station], error)


def mean_difference(pairs: tuple[Pair, ...], station: str) -> PowerDifference:
    """Return the mean difference over all pairs; a point shared by pairs adds its error once."""
    if not pairs:
        return PowerDifference(math.nan, math.nan)
    counts: dict[tuple[str, tuple[int, ...]], int] = {}
    errors: dict[tuple[str, tuple[int, ...]], float] = {}
    for pair in pairs:
        for name, point in zip("ab", pair, strict=True):
            counts[name, point.rows] = counts.get((name, point.rows), 0) + 1
            errors[name, point.rows] = point.error[station]
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
    order = {each.name: i for i, each in enumerate(known_columns())}
    return {name: merged[name] for name in sorted(names, key=order.__getitem__) if name in merged}


def describe_pair(matched: MatchedPoints, pair: Pair) -> str:
    """Return a pair's set point as text, with the offsets of B."""
    text = labels.format_settings(joint_setting(matched, pair))
    offsets = set_point_offsets(pair, matched.columns)
    if not offsets:
        return text
    steps = (
        f"{column_named(name).label} by {labels.format_quantity(column_named(name), step)}"
        for name, step in offsets.items()
    )
    return f"{text} (B differs in {', '.join(steps)})"


def best_point(pairs: tuple[Pair, ...], station: str, side: int) -> Point | None:
    """Return the matched point of run A (0) or B (1) that absorbs most."""
    points = [pair[side] for pair in pairs if math.isfinite(pair[side].power[station])]
    return min(points, key=lambda point: point.power[station]) if points else None


def format_constant_difference(difference: ConstantDifference) -> tuple[str, str, str]:
    """Return label, value of A and value of B of a constant column that differs."""
    values = [
        ABSENT if value is None else labels.format_quantity(difference.column, value)
        for value in (difference.a, difference.b)
    ]
    return difference.column.label, values[0], values[1]


def format_difference(difference: PowerDifference) -> str:
    """Return a difference (W) with its standard error as text without the unit."""
    return phrases.format_power(difference.watts, difference.error).removesuffix(" W")
