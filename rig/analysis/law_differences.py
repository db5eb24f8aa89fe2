"""The laws of a campaign with several: their rows, and the differences of their best points."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.intervals import CONFIDENCE
from rig.analysis.points import Matrix, Point, Setting, agrees, gain_matrix, row_settings
from rig.analysis.ranking import difference
from rig.analysis.rows import columns_of
from rig.config.law_settings import DEFAULT_LAW
from rig.law_choice import CHOICE
from rig.presentation import phrases
from rig.row_contents import CATEGORICAL, Column
from rig.stations import Station, shown

Pair = tuple[Matrix, Matrix]


class LawGroup(NamedTuple):
    """The set points of one law, or of one combination of the laws of several axes."""

    name: str  # of the law; empty in a campaign without a choice
    choice: Setting  # values of the columns that choose it
    matrix: Matrix  # its planned and measured points


class BestOfLaw(NamedTuple):
    """The best point of a law at a station, and how much less it absorbs than the best law's."""

    station: Station
    law: str
    point: Point
    watts: float  # W; 0 for the best law
    half_width: float  # W, of the 95 % interval; NaN where an error is unknown, and for the best


def is_choice(column: Column) -> bool:
    """Return whether the values of a column are laws: `law`, or `AXIS_law` of several axes."""
    return bool(column.choices) and (column.key == CHOICE or column.key.endswith(f"_{CHOICE}"))


def law_groups(matrix: Matrix) -> list[LawGroup]:
    """Return the groups of a campaign's set points by law, in the order of the campaign.

    A campaign of one law is one group without a name.
    """
    choosing = [column for column in matrix.columns if is_choice(column)]
    choices: list[Setting] = []
    for setting in matrix.planned:
        choice = {each.name: setting[each.name] for each in choosing if each.name in setting}
        if choice not in choices:
            choices.append(choice)
    if len(choices) < 2:
        return [LawGroup("", {}, matrix)]
    return [
        LawGroup(
            _name(choosing, choice),
            choice,
            matrix._replace(
                points=tuple(p for p in matrix.points if agrees(p.setting, choice)),
                planned=tuple(each for each in matrix.planned if agrees(each, choice)),
            ),
        )
        for choice in choices
    ]


def _name(choosing: list[Column], choice: Setting) -> str:
    names = {each.name: each.choices[int(choice[each.name])] for each in choosing}
    if len(names) == 1:
        return next(iter(names.values()))
    return ", ".join(f"{name.removesuffix(f'_{CHOICE}')} {law}" for name, law in names.items())


def recorded_laws(config: Mapping[str, Any]) -> dict[str, str]:
    """Return the law's name of each axis in a run's configuration, by name of its column.

    Runs recorded before there was a choice have the default law.
    """
    recorded = config.get(CHOICE) or {"name": DEFAULT_LAW}
    if isinstance(recorded.get("name"), str):
        return {CHOICE: recorded["name"]}
    return {f"{axis}_{CHOICE}": str(each["name"]) for axis, each in recorded.items()}


def with_joint_laws(matrices: Pair, laws: tuple[dict[str, str], dict[str, str]]) -> Pair:
    """Return the matrices of two runs with one numbering of their laws, in a column of both.

    ``laws`` are the `recorded_laws`, by which a run without a choice gets its column. Runs of one
    and the same law keep their columns.
    """
    columns = {c.name: c for matrix in matrices for c in matrix.columns if is_choice(c)}
    if not columns and laws[0] == laws[1]:
        return matrices
    for name in dict.fromkeys([*laws[0], *laws[1]]):
        columns.setdefault(name, Column(name, name, "1", name.replace("_", " "), CATEGORICAL))
    for name, column in columns.items():
        known = [
            next(
                (each.choices for each in matrix.columns if each.name == name),
                (own.get(name, DEFAULT_LAW),),
            )
            for matrix, own in zip(matrices, laws, strict=True)
        ]
        joint = column._replace(choices=tuple(dict.fromkeys([*known[0], *known[1]])))
        a, b = (_numbered(*each, joint) for each in zip(matrices, known, strict=True))
        matrices = a, b
    return matrices


def _numbered(matrix: Matrix, known: tuple[str, ...], joint: Column) -> Matrix:
    """Return a matrix with the laws ``known`` to its column by their numbers in a joint one."""

    def setting(before: Setting) -> Setting:
        law = known[int(before.get(joint.name, 0.0))]
        return before | {joint.name: float(joint.choices.index(law))}

    others = tuple(column for column in matrix.columns if column.name != joint.name)
    return matrix._replace(
        points=tuple(p._replace(setting=setting(p.setting)) for p in matrix.points),
        planned=tuple(map(setting, matrix.planned)),
        columns=(*others, joint),
    )


def common_laws(a: Matrix, b: Matrix) -> tuple[set[str], set[str], set[str]]:
    """Return the names of the laws that both matrices have, A alone has, and B alone has.

    Their columns are those of `with_joint_laws`; a matrix without them has the law without a name.
    """
    laws = [{law_name(m.columns, each) for each in m.planned} for m in (a, b)]
    return laws[0] & laws[1], laws[0] - laws[1], laws[1] - laws[0]


def of_laws(matrix: Matrix, names: Collection[str]) -> Matrix:
    """Return the points of a matrix that have one of these laws."""
    return matrix._replace(
        points=tuple(p for p in matrix.points if law_name(matrix.columns, p.setting) in names),
        planned=tuple(s for s in matrix.planned if law_name(matrix.columns, s) in names),
    )


def law_name(columns: Iterable[Column], setting: Setting) -> str:
    """Return the law of a set point; empty without a choice."""
    choosing = [each for each in columns if is_choice(each) and each.name in setting]
    return _name(choosing, setting) if choosing else ""


def tables_by_law(table: xarray.Dataset) -> list[tuple[str, xarray.Dataset]]:
    """Return name and rows of each law, in the order of the campaign."""
    settings = row_settings(table)
    groups = law_groups(Matrix((), tuple(settings), columns_of(table)))
    return [
        (group.name, table.isel(row=[agrees(each, group.choice) for each in settings]))
        for group in groups
    ]


def best_of_laws(table: xarray.Dataset) -> tuple[BestOfLaw, ...]:
    """Return the best point of each measured law at the stations of pictures, the best law first.

    Empty for a campaign of one law. The interval of a difference is that of
    `rig.analysis.ranking.difference`: of powers in the same seas, sea by sea.
    """
    matrix = gain_matrix(table)
    groups = law_groups(matrix)
    found: list[BestOfLaw] = []
    for station in reversed(shown(matrix.stations)) if len(groups) > 1 else ():
        name, best = station.name, list[tuple[str, Point]]()
        for group in groups:
            points = [p for p in group.matrix.points if np.isfinite(p.power[name])]
            if points:
                best.append((group.name, min(points, key=lambda point: point.power[name])))
        best.sort(key=lambda each: each[1].power[name])
        if len(best) < 2:
            continue
        found.append(BestOfLaw(station, *best[0], 0.0, float("nan")))
        found += [
            BestOfLaw(station, law, point, *difference(point, best[0][1], name))
            for law, point in best[1:]
        ]
    return tuple(found)


def laws_text(found: tuple[BestOfLaw, ...]) -> list[str]:
    """Return the best points of laws as lines for a terminal; empty without any."""
    if not found:
        return []
    percent = f"{100.0 * CONFIDENCE:g} %"
    lines = [f"Best point of each law, and its difference from the best law (± {percent} interval)"]
    width, station = max(len(each.law) for each in found), ""
    for each in found:
        label = "" if each.station.label == station else each.station.label
        station = each.station.label
        power = each.point.power_text(each.station.name)
        text = f"  {label:<32} {each.law:<{width}} {power:>16}   row {each.point.rows[0]}"
        if each.watts:
            text += f"   {phrases.format_power(each.watts, each.half_width)}"
            if np.isfinite(each.half_width) and each.watts <= each.half_width:
                text += " (not different)"
        lines.append(text)
    return lines


def laws_json(found: tuple[BestOfLaw, ...]) -> list[dict[str, Any]]:
    """Return the best points of laws as JSON data: powers in W, unknown values NaN."""
    return [
        {
            "power": each.station.name,
            "law": each.law,
            "rows": each.point.rows,
            "setting": each.point.setting,
            "mean_w": each.point.power[each.station.name],
            "standard_error_w": each.point.error[each.station.name],
            "above_best_law_w": each.watts,
            "half_width_w": each.half_width,
            "confidence": CONFIDENCE,
        }
        for each in found
    ]
