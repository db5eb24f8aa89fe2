"""The complete set point of a row: values of the matrix, and defaults of the campaign or rig."""

from collections import namedtuple
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from rig.campaign.kind import CampaignKind
from rig.config.campaign_file import BaseCampaignFile
from rig.config.matrix import KindColumns, LawColumns
from rig.config.problems import Problem
from rig.config.rig_file import BaseRigFile
from rig.config.yaml_source import SourceMap
from rig.law_choice import CHOICE
from rig.planning.point import Point


@cache
def setting_type(columns: KindColumns, law_columns: LawColumns) -> Any:
    """Return the NamedTuple of a row's set point, with a field for each column of the matrix."""
    names = tuple(column.name for column in columns.with_law(law_columns))
    return namedtuple("RowSetting", names)


def zero_setting(file: BaseCampaignFile | type[BaseCampaignFile]) -> Any:
    """Return the set point with all values 0."""
    kind = setting_type(file.kind_columns, file.law_columns())
    return kind(*(0.0 for _ in kind._fields))


def row_setting(kind: CampaignKind, file: BaseCampaignFile, rig: BaseRigFile, point: Point) -> Any:
    """Return the set point of a point of the matrix."""
    zero = zero_setting(file)
    values = {column.name: column.default or 0.0 for column in file.law_columns()}
    values["reference_scale"] = 1.0
    if file.reference is not None:
        values["realisation"] = float(getattr(file.reference, "realisation", 1))
    values |= kind.defaults(file, rig)
    known = {name: value for name, value in values.items() if name in zero._fields}
    return type(zero)(**{**zero._asdict(), **known, **point.values})


def chosen_law_problems(
    file: BaseCampaignFile, points: Iterable[Point], locate: SourceMap
) -> Iterator[Problem]:
    """Yield a problem for each point that lacks a column of the law that it chooses.

    Only rows with that law need its columns, so the matrix does not require them.
    """
    for axis_law in file.axis_laws.values():
        parts = axis_law.law.parts
        own = {
            each.name: column
            for each, column in zip(axis_law.law.columns, axis_law.columns, strict=True)
        }
        for number, point in enumerate(points if parts else ()):
            choice = own[CHOICE]
            law = parts[int(point.values.get(choice.name, 0.0))]
            needed = [own[each.name] for each in law.columns if each.default is None]
            if missing := [each.key for each in needed if each.name not in point.values]:
                message = f"point {number}: the law {law.name} needs {', '.join(missing)}"
                at = point.locations.get(choice.name)
                if at is None:
                    yield locate.problem(("matrix",), None, message)
                else:
                    yield at.problem(law.name, message)


def columns_of(settings: tuple[Any, ...]) -> dict[str, tuple[float, ...]]:
    """Return the values of a table of set points by the names of their columns."""
    names = settings[0]._fields
    return {name: tuple(getattr(each, name) for each in settings) for name in names}
