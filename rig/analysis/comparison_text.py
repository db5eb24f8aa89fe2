"""A comparison of two runs as text for a terminal."""

import math
from collections import Counter
from collections.abc import Iterable

from rig.analysis import labels, law_differences
from rig.analysis.comparison import (
    Comparison,
    MatchedPoints,
    Pair,
    describe_pair,
    format_difference,
    mean_difference,
    power_difference,
)
from rig.analysis.differences import shorten
from rig.analysis.points import Point, error_source
from rig.config.differences import ABSENT
from rig.presentation import phrases
from rig.presentation.phrases import clock_text
from rig.row_contents import main_columns, union
from rig.stations import station_names

_MAX_DIFFERENCES = 12  # listed in the text, for each group
_MAX_UNMATCHED = 20


def as_text(comparison: Comparison) -> str:
    """Return the comparison as text for a terminal: differing settings first, then power."""
    lines = []
    for name, side in (("A", comparison.a), ("B", comparison.b)):
        stamp = phrases.mode_stamp(side.mode)
        lines.append(f"{name}  {side.run}, campaign {side.campaign or 'unknown'}   [{stamp}]")
        time = clock_text(side.rig_time_s) if math.isfinite(side.rig_time_s) else "unknown"
        lines.append(
            f"   rig {side.rig}; sea {side.sea}; {side.points} points measured, {side.ended}; "
            f"rig time {time}"
        )
    for warning in comparison.warnings:
        lines += ["", f"!! {warning}"]
    lines += ["", "Settings that differ", *_settings_lines(comparison)]
    lines += ["", *_best_lines(comparison)]
    if comparison.seas:
        lines += ["", *_sea_lines(comparison)]
    if comparison.matched.axes_differ:
        return "\n".join([*lines, ""])
    lines += ["", *_matching_lines(comparison)]
    if comparison.matched.pairs:
        lines += ["", *_mean_lines(comparison), "", *_point_lines(comparison)]
    for name, points in (("A", comparison.matched.only_a), ("B", comparison.matched.only_b)):
        if points:
            lines += ["", f"Only in {name}", *_unmatched_lines(points, comparison.matched)]
    return "\n".join([*lines, ""])


def _settings_lines(comparison: Comparison) -> list[str]:
    rows = []
    for column, *values in comparison.matched.constant_differences:
        a, b = (ABSENT if v is None else labels.format_quantity(column, v) for v in values)
        rows.append(("set point", column.label, f"A {a}", f"B {b}"))
    counts = Counter[str]()
    for group, key, a, b in comparison.differences:
        counts[group] += 1
        if counts[group] <= _MAX_DIFFERENCES:
            rows.append((group, key, f"A {shorten(a)}", f"B {shorten(b)}"))
    if not rows:
        return ["  none"]
    lines = phrases.aligned(rows, lambda column, cell: False)
    for group, count in counts.items():
        if count > _MAX_DIFFERENCES:
            lines.append(f"  {group}: and {count - _MAX_DIFFERENCES} more, all in --json")
    return lines


def _matching_lines(comparison: Comparison) -> list[str]:
    matched = comparison.matched
    bounds = ", ".join(
        f"equal {column.label}"
        if column.choices
        else f"{column.label} within "
        f"{labels.format_quantity(column, comparison.tolerances[column.name]).lstrip('+')}"
        for column in matched.columns
    )
    criterion = f" by {bounds}" if bounds else ": no column varies that both runs have"
    lines = [f"{len(matched.pairs)} pairs of points matched{criterion}"]
    if one_sided := ", ".join(column.label for column in matched.one_sided):
        lines.append(f"only one run varies {one_sided}: its points share points of the other run")
    for name, laws in (("A", matched.laws_a), ("B", matched.laws_b)):
        if laws:
            lines.append(f"only {name} has rows of the law {', '.join(laws)}: they are in no pair")
    return [*lines, f"{len(matched.only_a)} points only in A, {len(matched.only_b)} only in B"]


def _best_lines(comparison: Comparison) -> list[str]:
    """Return the best measured point of each run, station by station, matched or not."""
    both = [point for best in comparison.best.values() for point in best if point is not None]
    lines = ["Best points of each run, W" + _error_text(both)]
    matched = comparison.matched
    laws = [column for column in matched.all_columns if law_differences.is_choice(column)]
    columns = union(matched.columns, matched.one_sided, laws)
    for station in comparison.stations:
        label = station.label
        sides = zip(
            "AB", comparison.best[station.name], comparison.caveats[station.name], strict=True
        )
        for side, point, caveat in sides:
            if point is None:
                lines.append(f"  {label:<34}{side}{'-':>17}")
            else:
                setting = labels.point_settings(columns, point)
                power = _format_point_power(point, station.name)
                row = ", ".join(map(str, point.rows))
                text = f"  {label:<34}{side}{power:>17}   row {row}: {setting}"
                lines.append(f"{text}   {caveat}" if caveat else text)
            label = ""
        a, b = comparison.best[station.name]
        if a is not None and b is not None:
            difference = power_difference(Pair(a, b), station.name)
            lines.append(f"  {'':<30}B - A{format_difference(difference):>17}")
    return lines


def _sea_lines(comparison: Comparison) -> list[str]:
    """Return the powers of the best points in each sea, station by station."""
    lines = ["Best points of each run in each sea, W (without ±: one sea alone)"]
    for station in comparison.stations:
        for seed, by_station in comparison.seas.items():
            a, b = by_station[station.name]
            if a is None or b is None:
                continue
            watts = [point.power[station.name] for point in (a, b)]
            cells = [phrases.format_signed(each, 2) for each in (*watts, watts[1] - watts[0])]
            lines.append(
                f"  {station.label:<34}seed {seed:<8} A {cells[0]:>9}  B {cells[1]:>9}  "
                f"B - A {cells[2]:>9}"
            )
    return lines


def _error_text(points: Iterable[Point]) -> str:
    """Return what ± means, as the end of a heading; empty without errors."""
    source = error_source(points)
    return f" (± standard error by {source})" if source else ""


def _mean_lines(comparison: Comparison) -> list[str]:
    pairs = comparison.matched.pairs
    source = error_source(point for pair in pairs for point in pair)
    lines = [
        "Mean difference of the matched pairs, W (B less A"
        + (f"; ± standard error by {source})" if source else ")")
    ]
    for station in comparison.stations:
        mean = format_difference(mean_difference(pairs, station.name))
        lines.append(f"  {station.label:<34}{mean:>18}")
    return lines


def _format_point_power(point: Point, station: str) -> str:
    return phrases.format_power(point.power[station], point.error[station]).removesuffix(" W")


def _point_lines(comparison: Comparison) -> list[str]:
    headings = "".join(f"{station.short_label:>20}" for station in comparison.stations)
    title = "Differences by point, W (B - A; negative: B absorbs more)"
    lines = [title, f"  {'':<8}{headings}   set point"]
    for pair in comparison.matched.pairs:
        differences = (power_difference(pair, name) for name in station_names(comparison.stations))
        cells = "".join(f"{format_difference(each):>20}" for each in differences)
        rows = f"{pair.a.rows[0]}|{pair.b.rows[0]}"
        lines.append(f"  {rows:<8}{cells}   {describe_pair(comparison.matched, pair)}")
    return lines


def _unmatched_lines(points: tuple[Point, ...], matched: MatchedPoints) -> list[str]:
    columns = (*matched.columns, *matched.one_sided) or main_columns(matched.all_columns)
    lines = [
        f"  row {point.rows[0]}: "
        + ", ".join(
            labels.format_setting(c, point.setting[c.name])
            for c in matched.all_columns
            if c in columns and c.name in point.setting
        )
        for point in points[:_MAX_UNMATCHED]
    ]
    more = len(points) - len(lines)
    return [*lines, f"  and {more} more, all in the CSV"] if more > 0 else lines
