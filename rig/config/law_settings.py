"""The `law` key of a campaign or rig file: a law by name or path, and its parameters."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import BeforeValidator, Field, create_model

from controllers.law import Column as LawColumn
from controllers.law import Parameter, Settings
from rig import laws
from rig.config.matrix import KindColumns
from rig.config.model import FileModel, TupleOf
from rig.config.problems import ConfigError
from rig.config.yaml_source import KeyPath, SourceMap
from rig.law_choice import CHOICE
from rig.row_contents import Column

DEFAULT_LAW = "impedance"
IMPEDANCE = laws.own(DEFAULT_LAW)


class AxisLaw(NamedTuple):
    """The law of an axis, and the law's columns and parameters in the units of that axis."""

    law: laws.Law
    columns: tuple[LawColumn, ...]  # names and keys may have a prefix, so that axes differ
    parameters: tuple[Parameter, ...]  # in the order of the law's

    def chosen(self, values: Any) -> laws.Law:
        """Return the law that acts at a set point, an object as of `set_point`."""
        return self.law.chosen(self.set_point(values)) if self.law.parts else self.law

    def set_point(self, values: Any) -> Any:
        """Return the law's SetPoint from an object with an attribute for each column's name."""
        return self.law.module.SetPoint(*(getattr(values, each.name) for each in self.columns))

    @property
    def needed_columns(self) -> tuple[LawColumn, ...]:
        """The columns that rows of each law need, and that of the choice among several."""
        parts = (each for law in self.law.members for each in law.columns)
        return self._with_keys({CHOICE, *(each.key for each in parts if each.default is None)})

    def columns_in_force(self, values: Mapping[str, Any]) -> tuple[LawColumn, ...]:
        """Return the columns of the law that acts at a set point, and that of the choice.

        ``values`` of the set point by name of the column.
        """
        if not self.law.parts:
            return self.columns
        (choice,) = self._with_keys({CHOICE})
        law = self.law.parts[int(values[choice.name])]
        return self._with_keys({CHOICE, *(each.key for each in law.columns)})

    def _with_keys(self, own: set[str]) -> tuple[LawColumn, ...]:
        """Return the columns that the law itself has by these keys."""
        pairs = zip(self.law.columns, self.columns, strict=True)
        return tuple(each for column, each in pairs if column.key in own)


def shown_columns(
    axis_laws: Iterable[AxisLaw], rows: Iterable[Mapping[str, Any]]
) -> tuple[LawColumn, ...]:
    """Return the columns that a table of rows shows: those that any row's law needs.

    ``rows``: set points by name of the column.
    """
    return tuple(
        column
        for law in axis_laws
        for column in law.needed_columns
        if any(column in law.columns_in_force(row) for row in rows)
    )


def value_text(
    axis_laws: Iterable[AxisLaw], column: Column | LawColumn, values: Mapping[str, Any]
) -> str:
    """Return the value of a set point in a column as text: a name, if it has names.

    "-" where the law that acts has no such column. ``values`` by name of the column.
    """
    for law in axis_laws:
        acting = {each.name for each in law.columns_in_force(values)}
        if column.name in {each.name for each in law.columns} - acting:
            return "-"
    value = values[column.name]
    return column.choices[int(value)] if column.choices else f"{value:g}"


class TransferFunction(FileModel):
    """A transfer function by its coefficients, in descending powers of s."""

    numerator: TupleOf[float] = Field(min_length=1, max_length=20)
    """Coefficients, highest power first."""
    denominator: TupleOf[float] = Field(min_length=1, max_length=20)
    """Coefficients, highest power first."""


_Name = Annotated[str, Field(min_length=1)]
Use = _Name | Annotated[TupleOf[_Name], Field(min_length=2, max_length=20)]


class LawSettings(FileModel):
    """The law of an axis; `law_model` adds its parameters."""

    axis_parameters: ClassVar[tuple[Parameter, ...]] = ()  # as the axis has them

    use: Use = DEFAULT_LAW  # name, or path of a .py file; or several, among which rows choose

    def values(self, law: laws.Law) -> Settings:
        """Return the values of the law's parameters by the law's own keys."""
        keys = self.law_keys(law).items()
        given = ((own, getattr(self, key)) for own, key in keys)
        return {key: value if isinstance(value, tuple) else (value,) for key, value in given}

    def law_keys(self, law: laws.Law) -> dict[str, str]:
        """Return the key of each parameter in the file by the law's own key."""
        pairs = zip(law.parameters, self.axis_parameters, strict=True)
        return {own.key: each.key for own, each in pairs}


class ImpedanceSettings(LawSettings):
    """Settings of the impedance law in addition to the gains of the matrix."""

    zc: TransferFunction | None = (
        None  # Z_c(s), N*s/m or N*m*s/rad; adds the force Z_c v on the body
    )


ExpandName = BeforeValidator(
    lambda value: {"use": value} if isinstance(value, str | list) else value
)
"""Turns the short forms ``law: NAME`` and ``law: [NAME, NAME]`` into a mapping."""


@cache
def law_model(axis_law: AxisLaw) -> type[LawSettings]:
    """Return the model of the settings of an axis's law."""
    if axis_law.law.module is IMPEDANCE.module:
        return ImpedanceSettings
    fields: dict[str, Any] = {each.key: _parameter_field(each) for each in axis_law.parameters}
    created = create_model("LawSettings", __base__=LawSettings, **fields)
    created.axis_parameters = axis_law.parameters
    return created


def _parameter_field(parameter: Parameter) -> Any:
    number = Annotated[float, Field(ge=parameter.low, le=parameter.high)]
    default = parameter.default
    if parameter.listed:
        listed = Annotated[TupleOf[number], Field(min_length=1, max_length=1000)]
        return (listed, default if default else ...)
    return (number, default[0] if default else ...)


def find_law(
    value: Any, locate: SourceMap, columns: KindColumns, at: KeyPath = ("law",)
) -> laws.Law:
    """Return the law that a value of the key ``at`` names; the default without a valid name.

    A path is relative to the file with the key. ``columns`` are the kind's of a matrix. Raises
    `ConfigError` if the law cannot be used.
    """
    use, key = value, at
    if not isinstance(value, str | list):
        use = value.get("use") if isinstance(value, dict) else None
        use, key = use if isinstance(use, str | list) and use else DEFAULT_LAW, (*at, "use")
    if isinstance(use, str):
        return _find_law(use, locate, columns, key, key)
    named = [(each, (*key, i)) for i, each in enumerate(use) if isinstance(each, str) and each]
    found = [_find_law(each, locate, columns, place, key) for each, place in named]
    if len(found) < 2:  # the model of the settings refuses the list
        return found[0] if found else IMPEDANCE
    try:
        return laws.choice(found)
    except laws.LawError as error:
        raise ConfigError([locate.problem(key, None, str(error))]) from None


def _find_law(
    text: str, locate: SourceMap, columns: KindColumns, key: KeyPath, file_key: KeyPath
) -> laws.Law:
    """Return the law of a name or path at a key; ``file_key`` is in the file with the path."""
    try:
        law = laws.find(str(locate.resolve_path(file_key, text)) if laws.is_path(text) else text)
        if problems := columns.problems(law.columns):
            raise laws.LawError(f"the law {text} cannot be used: {'; '.join(problems)}")
    except laws.LawError as error:
        raise ConfigError([locate.problem(key, text, str(error))]) from None
    return law


def inherit_law(
    campaign: dict[str, Any],
    locate: SourceMap,
    rig: dict[str, Any],
    rig_locate: SourceMap,
    own: KeyPath = ("law",),
    key: KeyPath = ("law",),
) -> None:
    """Give a campaign without a law at ``key`` that at ``own`` of its rig, with its locations."""
    law, target = value_at(rig, own), value_at(campaign, key[:-1])
    if law is None or not isinstance(target, dict) or key[-1] in target:
        return
    target[key[-1]] = law
    places = rig_locate.locations.items()
    moved = ((place, at) for place, at in places if place[: len(own)] == own)
    locate.locations.update({(*key, *place[len(own) :]): at for place, at in moved})


def value_at(mapping: Any, key: KeyPath) -> Any:
    """Return the value at a key of nested mappings; None without it."""
    for part in key:
        mapping = mapping.get(part) if isinstance(mapping, dict) else None
    return mapping
