"""Effects of a changed calibration: the recorded values in run folders that it corrects, affected
runs and rows, differences, and outdated products.
"""

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.calibration_file import (
    POSITION,
    TORQUE_CONSTANT_KEY,
    CalibrationFile,
    OffsetCorrection,
    ScaleCorrection,
    TableCorrection,
)
from rig.recording.calibration import RecordingTime, ValidityError, apply_calibration, is_valid
from rig.recording.runs import RunError, list_runs, run_info
from rig.recording.runs.folder import RunInfo
from rig.regular_file import MAX_TABLE_BYTES, read_regular
from rig.row_contents import PANEL, with_role

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
    contents = info.row_contents
    if quantity in ("spring_rate", "spring_map"):
        # A spring map converts the position of the device that realises the rate.
        panel = with_role(contents.columns, PANEL)
        column = panel if panel is None or quantity == "spring_rate" else panel.actuator
        return [
            RecordedValue(info.run, f"row {row['row']}", at, float(row[column.name]), "", products)
            for row in info.plan.get("rows", [])
            if column is not None
        ]
    if quantity == "torque_constant":
        value = info.axis_number(contents.axis, TORQUE_CONSTANT_KEY)
        name = f"rig.{contents.axis}.{TORQUE_CONSTANT_KEY}"
        return [] if value is None else [RecordedValue(info.run, name, at, value, "", products)]
    return _in_table(path, info, at, products) if quantity == contents.axis + POSITION else []


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


class ChangedValue(NamedTuple):
    """A value that reads differently with the new version."""

    where: str
    field: str
    recorded: float | None  # None where the record does not contain the value itself
    old: float | None  # None where the old version rejects it
    new: float | None
    note: str
    stale: tuple[str, ...]  # products computed from the old value


class CalibrationDifference(NamedTuple):
    """Effects of a new version of a calibration."""

    old: str  # name and version
    new: str
    keys: tuple[tuple[str, object, object], ...]  # changed keys of the file: key, old, new
    changed: tuple[ChangedValue, ...]
    unchanged: int  # number of values that read as before
    undetermined: tuple[tuple[str, str], ...]  # place and reason where the effect is unknown

    @property
    def stale(self) -> dict[str, tuple[str, ...]]:
        """Products to compute anew: run -> products."""
        found: dict[str, dict[str, None]] = {}
        for change in self.changed:
            found.setdefault(change.where, {}).update(dict.fromkeys(change.stale))
        return {where: tuple(names) for where, names in found.items() if names}


class IncomparableError(ValueError):
    """Two calibrations that do not correct the same quantity."""


def compare_calibrations(
    old: CalibrationFile, new: CalibrationFile, recorded_values: Iterable[RecordedValue]
) -> CalibrationDifference:
    """Return the effects of reading recorded values with ``new`` instead of ``old``.

    Raise `IncomparableError` unless both have the same name and quantity.
    """
    if (old.name, old.quantity) != (new.name, new.quantity):
        message = f"{old.title} ({old.quantity}) and {new.title} ({new.quantity})"
        raise IncomparableError(f"{message} do not correct the same thing")
    changed = []
    unchanged = 0
    undetermined: dict[str, str] = {}
    for entry in recorded_values:
        try:
            rules = _rule(old, entry.time), _rule(new, entry.time)
        except ValidityError as error:
            undetermined.setdefault(entry.where, entry.note or str(error))
            continue
        differ = rules[0] != rules[1]
        if entry.is_mean and differ and any(isinstance(r, TableCorrection) for r in rules):
            message = "a mean cannot be corrected by a table; read the record"
            undetermined.setdefault(entry.where, message)
            continue
        before, after = _read(old, entry), _read(new, entry)
        if before == after and not (entry.value is None and differ):
            unchanged += 1
            continue
        changed.append(
            ChangedValue(
                entry.where, entry.field, entry.value, before, after, entry.note, entry.products
            )
        )
    return CalibrationDifference(
        old.title,
        new.title,
        _keys(old, new),
        tuple(changed),
        unchanged,
        tuple(undetermined.items()),
    )


def _rule(calibration: CalibrationFile, at: RecordingTime) -> object:
    """Return what a calibration does to values recorded at a time; equal rules do the same."""
    if not is_valid(calibration.valid, at):
        return calibration.outside
    correction = calibration.correction
    is_identity = (isinstance(correction, ScaleCorrection) and correction.factor == 1.0) or (
        isinstance(correction, OffsetCorrection) and correction.offset == 0.0
    )
    return "unchanged" if is_identity else correction


def _read(calibration: CalibrationFile, entry: RecordedValue) -> float | None:
    if entry.value is None:
        return None
    try:
        return apply_calibration(calibration, entry.value, entry.time).value
    except ValidityError:
        return None


def _keys(old: CalibrationFile, new: CalibrationFile) -> tuple[tuple[str, object, object], ...]:
    """Return the keys in which the two files differ, leaf by leaf."""
    before, after = (
        _leaves(file.model_dump(mode="json", by_alias=True, exclude_none=True))
        for file in (old, new)
    )
    return tuple(
        (name, before.get(name), after.get(name))
        for name in dict.fromkeys((*before, *after))
        if before.get(name) != after.get(name)
    )


def _leaves(mapping: dict[str, Any], prefix: str = "") -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in mapping.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            found |= _leaves(value, name)
        else:
            found[name] = value
    return found
