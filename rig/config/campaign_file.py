"""The campaign file: rig, sea, rows, and their order and timing.

The model of a kind of rig adds its own keys; `with_laws` adds the columns and parameters of laws.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeVar, cast

from pydantic import Field, create_model, field_validator

from rig.config.adaptive import AdaptiveRows
from rig.config.law_settings import AxisLaw, ExpandName, LawSettings, law_model
from rig.config.matrix import KindColumns, LawColumns, Matrix, matrix_model
from rig.config.model import FileModel, RuleViolation, WholeNumber, rule_error
from rig.config.problems import format_value
from rig.config.reference import Reference
from rig.config.sea import Sea, Seeds
from rig.config.tank import BEFORE_REFLECTION, Tank
from rig.config.task_file import FolderName, RowTiming, Tare, TareOrNone, Timing
from rig.row_contents import Column

RowOrder = Literal["as given", "random"]


class BaseStart(FileModel):
    """The time from the wave maker's trigger (0 s of the wave clock) to the first row."""

    lead_in_s: float = Field(default=120.0, ge=0, le=3600)  # at most, if measured
    lead_in: Literal["fixed", "measured"] = "fixed"  # measured: until the motion has settled
    least_lead_in_s: float = Field(default=10.0, ge=0, le=3600)  # if measured


class CampaignHead(FileModel):
    """The first keys of a campaign file, so that those of a kind may precede the matrix."""

    name: FolderName
    rig: str = Field(min_length=1)  # file, relative to this one
    plant: str | None = Field(default=None, min_length=1)  # replaces that of the rig
    seed: Seeds = 1  # several: the rows are measured in the sea of each, one after the other
    sea: Sea  # or the name of a file that holds it
    tank: Tank | None = None  # or the name of a file


class BaseCampaignFile(CampaignHead):
    """A campaign: the rows of a gain matrix.

    A kind whose campaigns may have no rows (wave calibration) makes the matrix optional.
    """

    inline: ClassVar[tuple[str, ...]] = ("sea", "tank")
    kind_columns: ClassVar[KindColumns]
    axis_laws: ClassVar[Mapping[str, AxisLaw]]  # by axis, in the order of the rig
    reference_axes: ClassVar[tuple[str, ...]]  # that a reference may excite; the first by default

    matrix: Matrix | None
    timing: RowTiming = Timing()
    start: BaseStart = BaseStart()
    law: Any  # settings of the law, or of several by axis
    reference: Reference | None = None  # open-loop force, in addition to the feedback
    tare: TareOrNone = Tare()  # None: `none` in the file
    order: str = "as given"  # a kind narrows it to `RowOrder`, or to that and one of least travel
    repeat: WholeNumber = Field(default=1, ge=1, le=1000)
    """Number of times that each row is measured."""
    adaptive: AdaptiveRows | None = None  # None: all rows of the matrix are measured, in order

    @field_validator("reference", mode="before")
    @classmethod
    def _find_axis(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if not hasattr(cls, "reference_axes"):  # without the laws of the axes, a problem of its own
            return {"axis": "", **value}
        axis = value.get("axis", cls.reference_axes[0])
        if axis not in cls.reference_axes:
            allowed = ", ".join(cls.reference_axes)
            raise rule_error(f"{format_value(axis)} is not known; allowed {allowed}", "axis")
        return {**value, "axis": axis}

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that each of several seeds gives a sea of its own, and what `adaptive` needs."""
        if self.adaptive is not None:
            yield from self._adaptive_rules(self.adaptive)
        if isinstance(self.seed, int):
            return
        if not hasattr(self.sea, "seed"):
            yield self.violation(
                "seed",
                f"several seeds, but a {self.sea.kind} sea has no random phases; "
                "repeat: measures each row several times",
            )
        for i, seed in enumerate(self.seed):
            if seed in self.seed[:i]:
                yield RuleViolation(("seed", i), f"{seed} is listed twice", seed)

    def _adaptive_rules(self, adaptive: AdaptiveRows) -> Iterator[RuleViolation]:
        if self.order != "as given":
            yield self.violation("order", "adaptive chooses the order; leave the key out")
        if self.repeat > 1:
            yield self.violation("repeat", "adaptive measures each row once; leave the key out")
        if len(self.seeds) > 1:
            yield RuleViolation(("seed",), "adaptive measures in one sea; allowed one seed")
        if self.tank is not None and self.tank.windows == BEFORE_REFLECTION:
            message = "the tank ends the rows before reflected waves arrive; leave the key out"
            yield RuleViolation(("adaptive",), message)
        if self.matrix is None:
            yield RuleViolation(("adaptive",), "there is no matrix to choose rows from")
        if adaptive.max_rows < adaptive.first_rows:
            least = adaptive.first_rows
            message = f"{adaptive.max_rows} is less than first_rows = {least}"
            yield RuleViolation(("adaptive", "max_rows"), message, adaptive.max_rows)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds, in whose seas the rows are measured one after the other."""
        return (self.seed,) if isinstance(self.seed, int) else self.seed

    def sea_seed(self, seed: int) -> int:
        """Return the seed of the sea's phases for ``seed``, which is one of `seeds`.

        Only several seeds replace the sea's own one.
        """
        own: int | None = getattr(self.sea, "seed", None)
        return seed if own is None or len(self.seeds) > 1 else own

    @property
    def tare_duration(self) -> float:
        """Duration of the tare, s; 0 if the file has `tare: none`."""
        return self.tare.duration_s if self.tare is not None else 0.0

    @classmethod
    def law_columns(cls) -> LawColumns:
        """Return the columns that the laws of all axes add to the matrix."""
        return tuple(column for each in cls.axis_laws.values() for column in each.columns)

    @classmethod
    def columns(cls) -> tuple[Column, ...]:
        """Return all columns of the matrix."""
        return cls.kind_columns.with_law(cls.law_columns())

    def law_settings(self, axis: str) -> LawSettings:
        """Return the settings of an axis' law."""
        settings = self.law if len(self.axis_laws) == 1 else getattr(self.law, axis)
        return cast(LawSettings, settings)


F = TypeVar("F", bound=BaseCampaignFile)


@cache
def with_laws(
    model: type[F], columns: KindColumns, axis_laws: tuple[tuple[str, AxisLaw], ...]
) -> type[F]:
    """Return a kind's model of a campaign with the columns and the parameters of its laws.

    The key `law` has the settings of a single law; those of several are a mapping by axis. A
    reference may excite these axes, unless the kind's model lists others.
    """
    settings: dict[str, Any] = {axis: _settings_field(each) for axis, each in axis_laws}
    law = next(iter(settings.values()))
    if len(settings) > 1:
        several = create_model("LawsByAxis", __base__=FileModel, **settings)
        law = (several, ... if _has_required(several) else several())
    law_columns = tuple(column for _, each in axis_laws for column in each.columns)
    matrix: Any = matrix_model(columns, law_columns)
    required = model.model_fields["matrix"].is_required()
    fields: dict[str, Any] = {
        "matrix": (matrix, ...) if required else (matrix | None, None),
        "law": law,
    }
    created = create_model("CampaignFile", __base__=model, **fields)
    created.kind_columns, created.axis_laws = columns, dict(axis_laws)
    if not hasattr(model, "reference_axes"):
        created.reference_axes = tuple(created.axis_laws)
    return created


def _settings_field(axis_law: AxisLaw) -> Any:
    """Return type and default of the settings of an axis' law."""
    settings = law_model(axis_law)
    return (Annotated[settings, ExpandName], ... if _has_required(settings) else settings())


def _has_required(model: type[FileModel]) -> bool:
    return any(field.is_required() for field in model.model_fields.values())
