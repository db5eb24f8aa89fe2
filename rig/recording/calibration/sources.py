"""Recorded values of calibrated quantities in run folders."""

import csv
import io
from pathlib import Path
from typing import NamedTuple

from rig.config.calibration_file import TORQUE_CONSTANT_KEY
from rig.recording.calibration.correction import RecordingTime
from rig.recording.runs import RunError, list_runs, run_info
from rig.recording.runs.folder import RunInfo
from rig.regular_file import MAX_TABLE_BYTES, read_regular

PRODUCTS = (
    *("rows.csv", "rows.nc", "effects.csv"),
    *("surfaces.png", "surfaces_sliced.png", "bars.png"),
    *("summary.txt", "summary.json", "summary.pdf", "summary.png"),
)
"""Files of a run's folder that are computed from its record."""


class RecordedValue(NamedTuple):
    """A recorded value of a quantity, and the products computed from it."""

    where: str  # run of a log, or run folder
    field: str  # cell of the sheet, row of the campaign, or key of the configuration
    time: RecordingTime
    value: float | None  # None where this record does not contain the value
    note: str  # reason of a missing value
    products: tuple[str, ...]  # products computed from it
    is_mean: bool = False  # a mean over many recorded values


def values_in_runs(folder: Path, quantity: str) -> tuple[RecordedValue, ...]:
    """Return every record of a quantity in the runs of a folder, oldest run first.

    A run that cannot be read is listed with the reason.
    """
    found: list[RecordedValue] = []
    for run in list_runs(folder):
        try:
            info = run_info(run.path, ())  # faster: from the JSON files alone
            found += _of_run(run.path, info if info.plan else run_info(run.path), quantity)
        except (RunError, OSError, ValueError) as error:
            found.append(RecordedValue(run.run, "", RecordingTime(), None, str(error), ()))
    return tuple(found)


def _of_run(path: Path, info: RunInfo, quantity: str) -> list[RecordedValue]:
    at = RecordingTime.from_utc(info.started_utc)
    products = tuple(name for name in PRODUCTS if (path / name).is_file())
    # The spring map converts the stator's position.
    if key := {"spring_rate": "spring_rate", "spring_map": "stator"}.get(quantity):
        return [
            RecordedValue(info.run, f"row {row['row']}", at, float(row[key]), "", products)
            for row in info.plan.get("rows", [])
        ]
    if quantity != "torque_constant":
        return _in_table(path, info, at, products)
    value, name = info.config_number(*TORQUE_CONSTANT_KEY), ".".join(TORQUE_CONSTANT_KEY)
    return [] if value is None else [RecordedValue(info.run, name, at, value, "", products)]


def _in_table(
    path: Path, info: RunInfo, at: RecordingTime, products: tuple[str, ...]
) -> list[RecordedValue]:
    """Return the mean positions of a run's row table, or a note that there is none."""
    if "rows.csv" not in products:
        note = "no rows.csv; rig plot makes it"
        return [RecordedValue(info.run, "position_mean", at, None, note, products)]
    with io.StringIO(read_regular(path / "rows.csv", MAX_TABLE_BYTES).decode()) as file:
        return [
            RecordedValue(info.run, f"row {row['row']}", at, value, "", products, is_mean=True)
            for row in csv.DictReader(file)
            if (value := float(row["position_mean [m]"])) == value
        ]
