"""Two runs of one matrix set against each other, point by point: B less A.

A difference below zero says that B absorbs more. Its standard error is that of both points, taken
as independent; nothing is said of what a run as a whole may be off by.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import xarray

from rig.analysis import labels, phrases
from rig.analysis.alarms import row_list
from rig.analysis.differences import Difference, differences, sea
from rig.analysis.matching import TOLERANCES, Held, Matched, Pair, apart, match
from rig.analysis.points import Matrix, Point, Setting, matrix
from rig.analysis.rows import INCOMPLETE, POWERS, row_table
from rig.config.columns import COLUMNS
from rig.recording.runs.folder import Facts, facts

KINDS = POWERS
"""The stations that are compared."""


class Side(NamedTuple):
    """One of the two runs."""

    run: str
    campaign: str
    mode: str
    rig: str
    sea: str
    ended: str
    points: int  # measured


class Gap(NamedTuple):
    """A difference of power, B less A, W; the error is NaN where one of both is unknown."""

    watts: float
    error: float


class Comparison(NamedTuple):
    """All that two runs have in common, and what they have not."""

    a: Side
    b: Side
    warnings: tuple[str, ...]  # the loudest first
    same_sea: bool
    differences: tuple[Difference, ...]
    matched: Matched
    tolerances: Mapping[str, float]  # of the matched columns, SI


def compare(
    run_a: Path,
    run_b: Path,
    tolerances: Mapping[str, float] | None = None,
    *,
    incomplete_rows: bool = False,
) -> Comparison:
    """Compare two recorded runs; ``tolerances`` (SI, by column name) replace the usual ones.

    ``incomplete_rows`` as of `rig.analysis.rows.row_table`.

    RunError if a record cannot be read, KeyError if the kind of rig has no rows and power.
    """
    one, other = facts(run_a), facts(run_b)
    a, b = (row_table(run, incomplete_rows=incomplete_rows) for run in (run_a, run_b))
    return compare_tables(one, other, a, b, tolerances)


def compare_tables(
    one: Facts,
    other: Facts,
    table_a: xarray.Dataset,
    table_b: xarray.Dataset,
    tolerances: Mapping[str, float] | None = None,
) -> Comparison:
    """The comparison of what is known of two runs and of their row tables."""
    found = matrix(table_a), matrix(table_b)
    matched = match(*found, tolerances)
    seas = sea(one), sea(other)
    settings = differences(one, other)
    same = not any(each.group == "sea" for each in settings)
    used = {c.name: {**TOLERANCES, **(tolerances or {})}[c.name] for c in matched.columns}
    return Comparison(
        _side(one, found[0]),
        _side(other, found[1]),
        (
            *_withheld(one, table_a),
            *_withheld(other, table_b),
            *_warnings(one, other, seas, same, matched),
        ),
        same,
        tuple(settings),
        matched,
        used,
    )


def _side(known: Facts, found: Matrix) -> Side:
    told = known.plan.get("sea") or {}
    status = str(known.status.get("status") or "no end recorded")
    text = str(told.get("words") or told.get("kind") or "not recorded")
    rig = (known.config.get("rig") or {}).get("name")
    return Side(
        known.run,
        known.campaign,
        known.mode,
        str(rig or "not recorded"),
        text,
        status,
        len(found.points),
    )


def _withheld(known: Facts, table: xarray.Dataset) -> list[str]:
    """Rows that enter no comparison because the record lacks ticks of them."""
    if not table.sizes.get("row", 0):
        return []
    rows = table["row"].values[table["state"].values == INCOMPLETE]
    said = "ticks missing from the record (--incomplete-rows compares them)"
    return [f"{known.run}: {row_list(rows)} withheld, {said}"] if len(rows) else []


def _warnings(
    one: Facts, other: Facts, seas: tuple[object, object], same: bool, matched: Matched
) -> list[str]:
    found = []
    if not same:
        texts = [
            str((f.plan.get("sea") or {}).get("words") or "not recorded") for f in (one, other)
        ]
        if texts[0] == texts[1]:
            texts = [f"{text} ({number})" for text, number in zip(texts, seas, strict=True)]
        found.append(f"DIFFERENT SEAS: A {texts[0]}; B {texts[1]}")
    elif not all(seas):
        found.append("SEA NOT RECORDED in both runs: they may be different")
    if one.mode != other.mode:
        found.append(f"DIFFERENT RUNGS: A {one.mode or 'unknown'}, B {other.mode or 'unknown'}")
    if not matched.pairs:
        found.append("NO SET POINT IN COMMON")
    return found


def gap(pair: Pair, kind: str) -> Gap:
    """The difference of one pair."""
    a, b = pair
    return Gap(b.power[kind] - a.power[kind], math.hypot(a.error[kind], b.error[kind]))


def mean_gap(pairs: tuple[Pair, ...], kind: str) -> Gap:
    """The mean difference over all pairs; a point in several of them counts its error once."""
    if not pairs:
        return Gap(math.nan, math.nan)
    share: dict[tuple[str, tuple[int, ...]], int] = {}
    errors: dict[tuple[str, tuple[int, ...]], float] = {}
    for pair in pairs:
        for name, point in zip("ab", pair, strict=True):
            share[name, point.rows] = share.get((name, point.rows), 0) + 1
            errors[name, point.rows] = point.error[kind]
    variance = sum((share[key] * errors[key]) ** 2 for key in share) / len(pairs) ** 2
    watts = sum(gap(pair, kind).watts for pair in pairs) / len(pairs)
    return Gap(watts, math.sqrt(variance))


def joint_setting(matched: Matched, pair: Pair) -> Setting:
    """The set point that a pair stands for: that of A, with what B alone varies."""
    names = [c.name for c in (*matched.columns, *matched.alone)]
    both = {**pair.b.setting, **pair.a.setting}
    for column in matched.alone:
        if pair.a.setting.get(column.name, 0.0) == 0.0 and column.name in pair.b.setting:
            both[column.name] = pair.b.setting[column.name]
    return {c.name: both[c.name] for c in COLUMNS if c.name in names and c.name in both}


def where(matched: Matched, pair: Pair) -> str:
    """A pair's set point in words, and how far it is from being the same."""
    text = labels.settings(joint_setting(matched, pair))
    off = apart(pair, matched.columns)
    if not off:
        return text
    steps = (
        f"{labels.BY_NAME[name].label} by {labels.quantity(labels.BY_NAME[name], step)}"
        for name, step in off.items()
    )
    return f"{text} (B off {', '.join(steps)})"


def best(pairs: tuple[Pair, ...], kind: str, side: int) -> Point | None:
    """The pair's point of run A (0) or B (1) that absorbs most among those matched."""
    here = [pair[side] for pair in pairs if math.isfinite(pair[side].power[kind])]
    return min(here, key=lambda point: point.power[kind]) if here else None


def held_words(held: Held) -> tuple[str, str, str]:
    """A column that is constant in both runs and differs: label, value of A, value of B."""
    values = [
        "not there" if value is None else labels.quantity(held.column, value)
        for value in (held.a, held.b)
    ]
    return held.column.label, values[0], values[1]


def gap_words(told: Gap) -> str:
    """A difference with its standard error."""
    return phrases.watts(told.watts, told.error).removesuffix(" W")
