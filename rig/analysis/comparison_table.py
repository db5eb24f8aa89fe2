"""A comparison of two runs as people and programs read it: text, JSON, CSV."""

import csv
import math
from pathlib import Path
from typing import Any

from rig.analysis import labels, phrases
from rig.analysis.comparison import (
    KINDS,
    Comparison,
    best,
    gap,
    gap_words,
    held_words,
    joint_setting,
    mean_gap,
    where,
)
from rig.analysis.differences import shortened
from rig.analysis.matching import Matched
from rig.analysis.points import Point, scatter_of

_MOST_DIFFERENCES = 12  # of a group, in text
_MOST_UNMATCHED = 20


def as_text(told: Comparison) -> str:
    """The comparison for a terminal: what differs first, then power."""
    lines = []
    for name, side in (("A", told.a), ("B", told.b)):
        stamp = phrases.mode_stamp(side.mode)
        lines.append(f"{name}  {side.run}, campaign {side.campaign or 'unknown'}   [{stamp}]")
        lines.append(
            f"   rig {side.rig}; sea {side.sea}; {side.points} points measured, {side.ended}"
        )
    for warning in told.warnings:
        lines += ["", f"!! {warning}"]
    lines += ["", "Settings that differ", *_settings(told), "", *_matched(told)]
    if told.matched.pairs:
        lines += ["", *_means(told), "", *_points(told)]
    for name, points in (("A", told.matched.only_a), ("B", told.matched.only_b)):
        if points:
            lines += ["", f"Only in {name}", *_unmatched(points, told.matched)]
    return "\n".join([*lines, ""])


def _settings(told: Comparison) -> list[str]:
    rows = [("set point", *held_words(each)) for each in told.matched.held]
    counts: dict[str, int] = {}
    for each in told.differences:
        counts[each.group] = counts.get(each.group, 0) + 1
        if counts[each.group] <= _MOST_DIFFERENCES:
            rows.append((each.group, each.key, shortened(each.a), shortened(each.b)))
    if not rows:
        return ["  none"]
    wide = [max(len(row[i]) for row in rows) for i in range(3)]
    lines = [
        f"  {group:<{wide[0]}}  {key:<{wide[1]}}  A {a:<{wide[2]}}  B {b}"
        for group, key, a, b in rows
    ]
    for group, count in counts.items():
        if count > _MOST_DIFFERENCES:
            lines.append(f"  {group}: and {count - _MOST_DIFFERENCES} more, all in --json")
    return lines


def _matched(told: Comparison) -> list[str]:
    matched = told.matched
    by_name = labels.BY_NAME
    bounds = ", ".join(
        f"{by_name[name].label} within {labels.quantity(by_name[name], value).lstrip('+')}"
        for name, value in told.tolerances.items()
    )
    by = f" by {bounds}" if bounds else ": neither run varies what both have"
    lines = [f"{len(matched.pairs)} pairs of points matched{by}"]
    if alone := ", ".join(column.label for column in matched.alone):
        lines.append(f"one run alone varies {alone}: its points share those of the other run")
    return [*lines, f"{len(matched.only_a)} points only in A, {len(matched.only_b)} only in B"]


def _means(told: Comparison) -> list[str]:
    pairs = told.matched.pairs
    source = scatter_of(point for pair in pairs for point in pair)
    lines = [
        "Mean difference and best points of the matched pairs, W (B less A"
        + (f"; ± standard error by {source})" if source else ")"),
        f"  {'':<32}{'B - A':>16}{'best of A':>18}{'best of B':>18}",
    ]
    for kind in KINDS:
        tops = (best(pairs, kind, side) for side in (0, 1))
        cells = "".join(f"{_power(top, kind):>18}" for top in tops)
        mean = gap_words(mean_gap(pairs, kind))
        lines.append(f"  {phrases.POWER_NAMES[kind]:<32}{mean:>16}{cells}")
    return lines


def _power(point: Point | None, kind: str) -> str:
    if point is None:
        return "-"
    return phrases.watts(point.power[kind], point.error[kind]).removesuffix(" W")


def _points(told: Comparison) -> list[str]:
    heads = "".join(f"{phrases.STATION_ABBREVIATIONS[kind]:>20}" for kind in KINDS)
    title = "Differences by point, W (B - A; negative: B absorbs more)"
    lines = [title, f"  {'':<8}{heads}   set point"]
    for pair in told.matched.pairs:
        cells = "".join(f"{gap_words(gap(pair, kind)):>20}" for kind in KINDS)
        rows = f"{pair.a.rows[0]}|{pair.b.rows[0]}"
        lines.append(f"  {rows:<8}{cells}   {where(told.matched, pair)}")
    return lines


def _unmatched(points: tuple[Point, ...], matched: Matched) -> list[str]:
    lines = [
        f"  row {point.rows[0]}: {labels.settings(_brief(point, matched))}"
        for point in points[:_MOST_UNMATCHED]
    ]
    more = len(points) - len(lines)
    return [*lines, f"  and {more} more, all in the CSV"] if more > 0 else lines


def _brief(point: Point, matched: Matched) -> dict[str, float]:
    """The settings that tell a point from others: those that vary in either run."""
    varying = [column.name for column in (*matched.columns, *matched.alone)]
    names = varying or ["spring_rate", "kp", "ki"]
    return {name: value for name, value in point.setting.items() if name in names}


def as_json(told: Comparison) -> dict[str, Any]:
    """The comparison as plain data: W, columns in SI; what is unknown is null."""
    matched = told.matched
    means = {kind: mean_gap(matched.pairs, kind) for kind in KINDS}
    return {
        "a": told.a._asdict(),
        "b": told.b._asdict(),
        "warnings": list(told.warnings),
        "same_sea": told.same_sea,
        "settings": [each._asdict() for each in told.differences],
        "set_points_held": [
            {"column": each.column.name, "unit": each.column.unit, "a": each.a, "b": each.b}
            for each in matched.held
        ],
        "matched_on": dict(told.tolerances),
        "varied_in_one_run": [column.name for column in matched.alone],
        "mean_difference_w": {
            kind: {"b_less_a": _known(mean.watts), "standard_error": _known(mean.error)}
            for kind, mean in means.items()
        },
        "pairs": [
            {
                "setting": joint_setting(matched, pair),
                "rows_a": list(pair.a.rows),
                "rows_b": list(pair.b.rows),
                **{
                    kind: {
                        "a": _known(pair.a.power[kind]),
                        "b": _known(pair.b.power[kind]),
                        "b_less_a": _known(gap(pair, kind).watts),
                        "standard_error": _known(gap(pair, kind).error),
                    }
                    for kind in KINDS
                },
            }
            for pair in matched.pairs
        ],
        "only_a": [{"rows": list(p.rows), "setting": p.setting} for p in matched.only_a],
        "only_b": [{"rows": list(p.rows), "setting": p.setting} for p in matched.only_b],
    }


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def write_csv(told: Comparison, path: Path) -> Path:
    """One line a pair, then the points of one run alone; SI, power in W, errors standard errors."""
    matched = told.matched
    columns = [*matched.columns, *matched.alone]
    heads = [f"{c.name} [{c.unit}]" for c in columns]
    powers = [f"{kind} {what} [W]" for kind in KINDS for what in ("A", "A se", "B", "B se")]
    gaps = [f"{kind} {what} [W]" for kind in KINDS for what in ("B - A", "B - A se")]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["in", "rows A", "rows B", *heads, *powers, *gaps])
        for pair in matched.pairs:
            setting = joint_setting(matched, pair)
            at = [setting.get(c.name, "") for c in columns]
            both = [x for k in KINDS for p in pair for x in (p.power[k], p.error[k])]
            apart = [x for kind in KINDS for x in gap(pair, kind)]
            writer.writerow(["both", _rows(pair.a), _rows(pair.b), *at, *both, *apart])
        for name, points in (("A", matched.only_a), ("B", matched.only_b)):
            for point in points:
                at = [point.setting.get(c.name, "") for c in columns]
                cells: list[Any] = []
                for kind in KINDS:
                    own, none = [point.power[kind], point.error[kind]], ["", ""]
                    cells += [*own, *none] if name == "A" else [*none, *own]
                rows = [_rows(point), ""] if name == "A" else ["", _rows(point)]
                writer.writerow([name, *rows, *at, *cells, *[""] * len(gaps)])
    return path


def _rows(point: Point) -> str:
    return " ".join(map(str, point.rows))
