"""Parts that the files of campaigns and sessions share."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer

from rig.config.model import FileModel, RuleViolation, WholeNumber, rule_error
from rig.config.problems import format_number, format_value


class RowEnd(FileModel):
    """The end of a row by its power, as soon as that is known well enough; else after its periods.

    `rig.realtime.assessment` has the rules for a regular sea, `rig.realtime.paired_rows` those for
    irregular ones.
    """

    station: str = Field(default="dc", min_length=1)  # by id or label
    least_periods: WholeNumber | None = Field(default=None, ge=2, le=1000)  # of a regular sea
    least_s: float | None = Field(default=None, gt=0, le=3600)  # of an irregular one
    precision_w: float | None = Field(default=None, gt=0, le=1e6)  # standard error of the mean
    precision_percent: float | None = Field(default=None, gt=0, le=100)  # of the best row's power
    worse_rows: bool = False  # a row that cannot be the best any more ends, too

    @property
    def least_wave_periods(self) -> int:
        """Least number of periods of a regular sea, without the key 3."""
        return self.least_periods or 3

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that there is something by which a row may end."""
        if self.precision_w is None and self.precision_percent is None and not self.worse_rows:
            message = "nothing ends a row; give precision_w, precision_percent or worse_rows: true"
            yield RuleViolation((), message)


class Timing(FileModel):
    """Duration of a row; `rig.planning.windows` derives missing values from the sea."""

    scheme: Literal["default", "mask4"] = "default"  # named set of durations
    settle: Literal["fixed", "measured"] = "fixed"  # measured: until transients have decayed
    settle_s: float | None = Field(default=None, ge=0, le=3600)  # at most, if measured
    interval_s: float | None = Field(default=None, ge=1, le=7200)
    """Time from row to row, with settling."""
    periods: WholeNumber | None = Field(default=None, ge=1, le=10_000)  # whole periods to measure
    end: RowEnd | None = None  # None: after its periods

    @property
    def is_assessed(self) -> bool:
        """Whether the length of a row depends on what is measured."""
        return self.settle == "measured" or self.end is not None

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that a row is longer than its settling time."""
        settle, interval = self.settle_s, self.interval_s
        if settle is not None and interval is not None and interval <= settle:
            yield RuleViolation(
                ("interval_s",),
                f"{format_number(interval)} leaves nothing to measure; "
                f"allowed above settle_s = {format_number(settle)} s",
                interval,
            )
        if self.is_assessed and self.scheme == "mask4":
            yield RuleViolation(
                ("scheme",), "its rows have a fixed length; allowed default", "mask4"
            )
        if self.is_assessed and interval is not None:
            message = "rows that end by themselves have no interval; leave the key out"
            yield RuleViolation(("interval_s",), message, interval)


def _expand_timing(value: Any) -> Any:
    if isinstance(value, str):
        if value in ("default", "mask4"):
            return {"scheme": value}
        raise rule_error(
            f"{format_value(value)} is not known; "
            "allowed default, mask4, or a mapping of settle_s, interval_s, periods"
        )
    return value


RowTiming = Annotated[Timing, BeforeValidator(_expand_timing)]
"""The timing of a row, also by the name of a scheme."""


class Tare(FileModel):
    """Sensor zeros, taken in calm water with the drive off."""

    duration_s: float = Field(default=5.0, ge=0.5, le=600)  # time over which the zeros are averaged


def _require_folder_name(name: str) -> str:
    plain = all(c.isascii() and (c.isalnum() or c in "._-") for c in name)
    if not (plain and name and len(name) <= 64 and name[0].isalnum() and name[-1] != "."):
        raise rule_error(
            f"{format_value(name)} cannot name a run's folder; allowed 1 .. 64 letters, digits, "
            "'-', '_', '.', beginning with a letter or digit"
        )
    return name


FolderName = Annotated[str, AfterValidator(_require_folder_name)]
"""A name that is valid as the name of a run's folder."""


def _expand_tare(value: Any) -> Any:
    if value == "none":
        return None
    if isinstance(value, (dict, Tare)):
        return value
    raise rule_error(
        f"{format_value(value)} is not known; allowed none or a mapping with duration_s"
    )


def _tare_as_written(tare: Tare | None) -> Any:
    return "none" if tare is None else tare.model_dump()


TareOrNone = Annotated[
    Tare | None, BeforeValidator(_expand_tare), PlainSerializer(_tare_as_written)
]
"""A tare, or None where the file says `none`."""
