"""Results of the analysis of a run, as types that are the same for every kind of rig."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.recording.calibration import CalibrationVersion


class RunProducts(NamedTuple):
    """Products of a run that has just ended."""

    files: tuple[Path, ...]
    results: dict[str, Any]  # JSON values: the kind's key, e.g. "optima", with its value
    text: str = ""  # summary for people
    rows_done: int | None = None  # None: unknown
    trouble: str = ""  # why products are missing; empty: none is
    interrupted: str = ""  # the command for what Ctrl-C left out; empty: there was no Ctrl-C


class RunSummary(NamedTuple):
    """Summary of a recorded run."""

    text: str  # for people
    values: dict[str, Any]  # for programs, as JSON values


class DrawOptions(NamedTuple):
    """Selection of the pictures of a run; without any option, all its products."""

    surface: tuple[str, str] | None = None  # columns along x and y
    left_out: tuple[str, ...] = ()  # columns, or column=value
    stations: tuple[str, ...] = ()
    sort: str | None = None  # bars of all rows, in the order "run" or "power"
    output: Path | None = None
    calibrations: tuple[CalibrationVersion, ...] = ()  # applied to the run
    incomplete_rows: bool = False

    @property
    def selects_surface(self) -> bool:
        """Whether the options are those of one surface."""
        return bool(self.surface or self.left_out or (self.stations and not self.sort))
