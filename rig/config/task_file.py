"""Parts that the files of campaigns and sessions share."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer

from rig.config.model import FileModel, RuleViolation, WholeNumber, rule_error
from rig.config.problems import format_number, format_value


class Timing(FileModel):
    """Duration of a row; `rig.planning.windows` derives missing values from the sea."""

    scheme: Literal["default", "mask4"] = "default"
    settle_s: float | None = Field(default=None, ge=0, le=3600)
    interval_s: float | None = Field(default=None, ge=1, le=7200)
    periods: WholeNumber | None = Field(default=None, ge=1, le=10_000)  # whole periods to measure

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

    duration_s: float = Field(default=5.0, ge=0.5, le=600)


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
