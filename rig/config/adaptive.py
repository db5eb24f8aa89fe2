"""The key `adaptive` of a campaign file: rows of the matrix are chosen while the campaign runs."""

from typing import Literal

from pydantic import Field

from rig.config.model import FileModel, WholeNumber


class AdaptiveRows(FileModel):
    """The choice of the next row by what has been measured, until the best row is known.

    `rig.design.surrogate` has the method.
    """

    station: str = Field(default="dc", min_length=1)  # by id or label: the power to minimise
    precision_w: float = Field(gt=0, le=1e6)  # expected loss of the best row, at which it ends
    first_rows: WholeNumber = Field(default=4, ge=2, le=100)  # measured in any case
    max_rows: WholeNumber = Field(default=30, ge=2, le=1000)
    """Greatest number of rows that are measured."""
    max_minutes: float | None = Field(default=None, gt=0, le=100_000)  # from the first choice
    start: Literal["predicted", "nothing"] = "predicted"
    """Knowledge before the first row: the predicted powers, or none."""
