"""Where calibrated quantities stand: in the entries of a test log and in the folders of runs."""

import csv
import io
from datetime import date
from pathlib import Path
from typing import NamedTuple

from rig.config.calibration_file import TORQUE_CONSTANT_KEY
from rig.interop.legacy.testlog import Activity, Entry, Log
from rig.recording.calibration.correction import At
from rig.recording.runs import RunError, facts, list_runs
from rig.recording.runs.folder import Facts
from rig.regular_file import MAX_TABLE_BYTES, read_regular

PRODUCTS = (
    *("rows.csv", "rows.nc", "effects.csv"),
    *("surfaces.png", "surfaces_sliced.png", "bars.png"),
    *("summary.txt", "summary.json", "summary.pdf", "summary.png"),
)
"""Files of a run's folder that are worked out from its record."""

_OF_AN_ACTIVITY = {
    Activity.GAIN_MATRIX: ("row table", "power surfaces"),
    Activity.GAINS: ("row table",),
    Activity.BY_HAND: ("row table",),
    Activity.MULTISINE: ("identified impedance",),
}


class Stood(NamedTuple):
    """A recorded value of a quantity, and what was worked out from it."""

    where: str  # run of a log, or run folder
    field: str  # cell of the sheet, row of the campaign, or key of the configuration
    at: At
    value: float | None  # None where the record does not say it here
    note: str  # why there is no value
    products: tuple[str, ...]  # what rests on it
    mean: bool = False  # a mean over many recorded values


def in_log(log: Log, quantity: str) -> tuple[Stood, ...]:
    """Every place where a log says a quantity, or names a gain matrix that does."""
    if quantity != "spring_rate":
        return ()
    return tuple(stood for entry in log.entries if (stood := _of_entry(entry)) is not None)


def at_of(entry: Entry) -> At:
    """When an entry's run was, by its number and by the date in its file's name."""
    day = date.fromisoformat(entry.recorded[:10]) if entry.recorded else None
    return At(entry.series_name, entry.run, day)


def _of_entry(entry: Entry) -> Stood | None:
    products = [name for a in entry.activities for name in _OF_AN_ACTIVITY.get(a, ())]
    rests = tuple(dict.fromkeys(products))
    if entry.spring is not None:
        value = entry.spring.written_n_per_m
        return Stood(entry.name, entry.spring.cell, at_of(entry), value, "", rests)
    if not entry.matrix:
        return None
    note = f"spring rates stand in {entry.matrix}, not in the log"
    return Stood(entry.name, f"row {entry.row}", at_of(entry), None, note, rests)


def in_runs(folder: Path, quantity: str) -> tuple[Stood, ...]:
    """Every place where the runs of a folder record a quantity, oldest run first.

    A run that cannot be read is listed with the reason.
    """
    found: list[Stood] = []
    for run in list_runs(folder):
        try:
            known = facts(run.path, ())  # the texts beside the record say it sooner
            found += _of_run(run.path, known if known.plan else facts(run.path), quantity)
        except (RunError, OSError, ValueError) as error:
            found.append(Stood(run.run, "", At(), None, str(error), ()))
    return tuple(found)


def _of_run(path: Path, known: Facts, quantity: str) -> list[Stood]:
    at = At.on(known.started_utc)
    there = tuple(name for name in PRODUCTS if (path / name).is_file())
    if quantity == "spring_rate":
        return [
            Stood(known.run, f"row {row['row']}", at, float(row["spring_rate"]), "", there)
            for row in known.plan.get("rows", [])
        ]
    if quantity == "spring_map":  # a map reads the stator's position
        return [
            Stood(known.run, f"row {row['row']}", at, float(row["stator"]), "", there)
            for row in known.plan.get("rows", [])
        ]
    if quantity == "torque_constant":
        return _in_config(known, at, there)
    return _in_table(path, known, at, there)


def _in_config(known: Facts, at: At, there: tuple[str, ...]) -> list[Stood]:
    value = known.configured(*TORQUE_CONSTANT_KEY)
    if value is None:
        return []
    return [Stood(known.run, ".".join(TORQUE_CONSTANT_KEY), at, value, "", there)]


def _in_table(path: Path, known: Facts, at: At, there: tuple[str, ...]) -> list[Stood]:
    """Mean positions of a run's row table; a run without one says so."""
    if "rows.csv" not in there:
        note = "no rows.csv; rig plot makes it"
        return [Stood(known.run, "position_mean", at, None, note, there)]
    with io.StringIO(read_regular(path / "rows.csv", MAX_TABLE_BYTES).decode()) as file:
        return [
            Stood(known.run, f"row {row['row']}", at, value, "", there, mean=True)
            for row in csv.DictReader(file)
            if (value := float(row["position_mean [m]"])) == value
        ]
