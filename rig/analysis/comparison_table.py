"""A comparison of two runs as text, JSON and CSV."""

import csv
from pathlib import Path
from typing import Any

from rig.analysis import labels
from rig.analysis.comparison import (
    Comparison,
    MatchedPoints,
    best_point,
    describe_pair,
    format_constant_difference,
    format_difference,
    joint_setting,
    mean_difference,
    power_difference,
)
from rig.analysis.differences import shorten
from rig.analysis.points import Point, error_source
from rig.presentation import phrases
from rig.presentation.json_values import json_value
from rig.row_contents import main_columns
from rig.stations import station_names

_MAX_DIFFERENCES = 12  # listed in the text, for each group
_MAX_UNMATCHED = 20


def as_text(comparison: Comparison) -> str:
    """Return the comparison as text for a terminal: differing settings first, then power."""
    lines = []
    for name, side in (("A", comparison.a), ("B", comparison.b)):
        stamp = phrases.mode_stamp(side.mode)
        lines.append(f"{name}  {side.run}, campaign {side.campaign or 'unknown'}   [{stamp}]")
        lines.append(
            f"   rig {side.rig}; sea {side.sea}; {side.points} points measured, {side.ended}"
        )
    for warning in comparison.warnings:
        lines += ["", f"!! {warning}"]
    lines += [
        "",
        "Settings that differ",
        *_settings_lines(comparison),
        "",
        *_matching_lines(comparison),
    ]
    if comparison.matched.pairs:
        lines += ["", *_mean_lines(comparison), "", *_point_lines(comparison)]
    for name, points in (("A", comparison.matched.only_a), ("B", comparison.matched.only_b)):
        if points:
            lines += ["", f"Only in {name}", *_unmatched_lines(points, comparison.matched)]
    return "\n".join([*lines, ""])


def _settings_lines(comparison: Comparison) -> list[str]:
    rows = [
        ("set point", *format_constant_difference(difference))
        for difference in comparison.matched.constant_differences
    ]
    counts: dict[str, int] = {}
    for difference in comparison.differences:
        counts[difference.group] = counts.get(difference.group, 0) + 1
        if counts[difference.group] <= _MAX_DIFFERENCES:
            rows.append(
                (difference.group, difference.key, shorten(difference.a), shorten(difference.b))
            )
    if not rows:
        return ["  none"]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    lines = [
        f"  {group:<{widths[0]}}  {key:<{widths[1]}}  A {a:<{widths[2]}}  B {b}"
        for group, key, a, b in rows
    ]
    for group, count in counts.items():
        if count > _MAX_DIFFERENCES:
            lines.append(f"  {group}: and {count - _MAX_DIFFERENCES} more, all in --json")
    return lines


def _matching_lines(comparison: Comparison) -> list[str]:
    matched = comparison.matched
    bounds = ", ".join(
        f"{column.label} within "
        f"{labels.format_quantity(column, comparison.tolerances[column.name]).lstrip('+')}"
        for column in matched.columns
    )
    criterion = f" by {bounds}" if bounds else ": no column varies that both runs have"
    lines = [f"{len(matched.pairs)} pairs of points matched{criterion}"]
    if one_sided := ", ".join(column.label for column in matched.one_sided):
        lines.append(f"only one run varies {one_sided}: its points share points of the other run")
    return [*lines, f"{len(matched.only_a)} points only in A, {len(matched.only_b)} only in B"]


def _mean_lines(comparison: Comparison) -> list[str]:
    pairs = comparison.matched.pairs
    source = error_source(point for pair in pairs for point in pair)
    lines = [
        "Mean difference and best points of the matched pairs, W (B less A"
        + (f"; ± standard error by {source})" if source else ")"),
        f"  {'':<32}{'B - A':>16}{'best of A':>18}{'best of B':>18}",
    ]
    for station in comparison.stations:
        tops = (best_point(pairs, station.name, side) for side in (0, 1))
        cells = "".join(f"{_format_point_power(top, station.name):>18}" for top in tops)
        mean = format_difference(mean_difference(pairs, station.name))
        lines.append(f"  {station.label:<32}{mean:>16}{cells}")
    return lines


def _format_point_power(point: Point | None, station: str) -> str:
    if point is None:
        return "-"
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


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as JSON data: powers in W, columns in SI, unknown values null."""
    matched = comparison.matched
    names = [station.name for station in comparison.stations]
    means = {name: mean_difference(matched.pairs, name) for name in names}
    values = {
        "a": comparison.a._asdict(),
        "b": comparison.b._asdict(),
        "warnings": list(comparison.warnings),
        "same_sea": comparison.same_sea,
        "settings": [each._asdict() for each in comparison.differences],
        "set_points_held": [
            {"column": each.column.name, "unit": each.column.unit, "a": each.a, "b": each.b}
            for each in matched.constant_differences
        ],
        "matched_on": dict(comparison.tolerances),
        "varied_in_one_run": [column.name for column in matched.one_sided],
        "mean_difference_w": {
            name: {
                "b_less_a": mean.watts,
                "standard_error": mean.error,
            }
            for name, mean in means.items()
        },
        "pairs": [
            {
                "setting": joint_setting(matched, pair),
                "rows_a": list(pair.a.rows),
                "rows_b": list(pair.b.rows),
                **{
                    name: {
                        "a": pair.a.power[name],
                        "b": pair.b.power[name],
                        "b_less_a": power_difference(pair, name).watts,
                        "standard_error": power_difference(pair, name).error,
                    }
                    for name in names
                },
            }
            for pair in matched.pairs
        ],
        "only_a": [{"rows": list(p.rows), "setting": p.setting} for p in matched.only_a],
        "only_b": [{"rows": list(p.rows), "setting": p.setting} for p in matched.only_b],
    }
    return {key: json_value(value) for key, value in values.items()}


def write_csv(comparison: Comparison, path: Path) -> Path:
    """Write a CSV with a line for each pair, then for each unmatched point.

    Set points are in SI, powers in W; ``se`` is the standard error.
    """
    matched = comparison.matched
    columns = [*matched.columns, *matched.one_sided]
    headings = [f"{c.name} [{c.unit}]" for c in columns]
    names = [station.name for station in comparison.stations]
    powers = [f"{name} {quantity} [W]" for name in names for quantity in ("A", "A se", "B", "B se")]
    difference_headings = [
        f"{name} {quantity} [W]" for name in names for quantity in ("B - A", "B - A se")
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["in", "rows A", "rows B", *headings, *powers, *difference_headings])
        for pair in matched.pairs:
            setting = joint_setting(matched, pair)
            setting_cells = [setting.get(c.name, "") for c in columns]
            power_cells = [x for n in names for p in pair for x in (p.power[n], p.error[n])]
            difference_cells = [x for name in names for x in power_difference(pair, name)]
            writer.writerow(
                [
                    "both",
                    _row_ids(pair.a),
                    _row_ids(pair.b),
                    *setting_cells,
                    *power_cells,
                    *difference_cells,
                ]
            )
        for run, points in (("A", matched.only_a), ("B", matched.only_b)):
            for point in points:
                setting_cells = [point.setting.get(c.name, "") for c in columns]
                cells: list[Any] = []
                for name in names:
                    own, none = [point.power[name], point.error[name]], ["", ""]
                    cells += [*own, *none] if run == "A" else [*none, *own]
                rows = [_row_ids(point), ""] if run == "A" else ["", _row_ids(point)]
                writer.writerow(
                    [run, *rows, *setting_cells, *cells, *[""] * len(difference_headings)]
                )
    return path


def _row_ids(point: Point) -> str:
    return " ".join(map(str, point.rows))
