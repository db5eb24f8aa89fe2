"""All products of a run, written into its folder: after a run, and again whenever asked."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray

from rig.analysis import wave_calibration
from rig.analysis.bars import varies_drive, write_bars
from rig.analysis.calibration_picture import write_picture
from rig.analysis.effects_table import all_effects, write_effects
from rig.analysis.page import write_page
from rig.analysis.points import matrix
from rig.analysis.rows import MEAN_POSITION_ALARM, row_table
from rig.analysis.rows_file import write_rows
from rig.analysis.spring_map import result
from rig.analysis.spring_map.files import write_map
from rig.analysis.spring_map.pictures import write_pictures
from rig.analysis.stop_reason import stop_of
from rig.analysis.summary import Summary, summarise, write_texts
from rig.analysis.surfaces import can_be_sliced, write_sliced, write_surfaces
from rig.recording.calibration import Known
from rig.recording.runs import RunError, mcap_file, reader
from rig.recording.runs.folder import facts
from rig.recording.runs.state import RecordState

OPEN_LOOP = "Pushed by an open-loop reference"
IDENTIFY = "impedances of it: rig identify"
GAINS = ("kp", "ki", "km")


def _unfinished(contents: list[mcap_file.Contents]) -> str:
    if all(each.finished for each in contents):
        return ""
    torn = sum(each.unread for each in contents)
    said = f", {torn} torn bytes at its end" if torn else ""
    return f"the record was not finished by its writer{said}"


def _read(
    run: Path,
    mean_position_alarm: float,
    calibrations: Sequence[Known],
    incomplete_rows: bool = False,
) -> tuple[xarray.Dataset, Summary]:
    contents = list(reader.source(run).contents)
    table = row_table(run, mean_position_alarm, calibrations, incomplete_rows=incomplete_rows)
    known = facts(run, contents)
    summary = summarise(table, known, _unfinished(contents), stop_of(run, known.status))
    summary = summary._replace(record=RecordState.of(json.loads(table.attrs["record_state"])))
    if has_excitation(known.plan):
        told = (str(known.plan["reference"].get("words", "")), IDENTIFY)
        summary = summary._replace(optima=(), effects=(), findings_of=OPEN_LOOP, findings=told)
    return table, summary


def has_excitation(plan: dict[str, Any]) -> bool:
    """True for the plan of a run that was pushed to be identified: nowhere do gains differ.

    Its powers are what pushing costs; there is nothing in them to be best.
    """
    rows = plan.get("rows") or []
    gains = {tuple(row.get(name) for name in GAINS) for row in rows}
    return isinstance(plan.get("reference"), dict) and len(gains) == 1


def _read_calibration(run: Path, incomplete_rows: bool) -> tuple[xarray.Dataset | None, Summary]:
    """None in place of the calibration where no whole period was measured."""
    contents = list(reader.source(run).contents)
    known = facts(run, contents)
    try:
        found = wave_calibration.calibration(run, incomplete_rows=incomplete_rows)
        told = wave_calibration.findings(found)
    except RunError as error:
        found, told = None, [str(error)]
    none = xarray.Dataset()
    summary = summarise(none, known, _unfinished(contents), findings=tuple(told))
    return found, summary._replace(record=reader.read_through(run))


def _read_map(
    run: Path, mean_position_alarm: float, incomplete_rows: bool
) -> tuple[xarray.Dataset, xarray.Dataset | None, Summary]:
    """Row table, and None in place of the spring map where no station was walked through."""
    table, summary = _read(run, mean_position_alarm, (), incomplete_rows)
    try:
        found = result.spring_map(run, incomplete_rows=incomplete_rows)
        told = result.findings(found)
    except RunError as error:
        found, told = None, [str(error)]
    said = ("The magnetic spring, moved by a hoist", tuple(told))
    summary = summary._replace(optima=(), effects=(), findings_of=said[0], findings=said[1])
    return table, found, summary


def summary_of(
    run: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[Known] = (),
    *,
    incomplete_rows: bool = False,
) -> Summary:
    """The summary of a run, worked out from its record; nothing is written.

    ``mean_position_alarm`` in m; ``calibrations`` and ``incomplete_rows`` as of `row_table`.
    RunError if the record cannot be read, KeyError if the kind of rig has no rows and power.
    """
    if wave_calibration.is_calibration(facts(run).plan):
        _no_rows(calibrations)
        return _read_calibration(Path(run), incomplete_rows)[1]
    if result.is_hoisted(facts(run).plan):
        _no_gains(calibrations)
        return _read_map(Path(run), mean_position_alarm, incomplete_rows)[2]
    return _read(Path(run), mean_position_alarm, calibrations, incomplete_rows)[1]


def _no_rows(calibrations: Sequence[Known]) -> None:
    if calibrations:
        raise ValueError("waves without the device have no rows to be read by a calibration")


def _no_gains(calibrations: Sequence[Known]) -> None:
    if calibrations:
        raise ValueError("a spring map is what calibrations are made of; read it as recorded")


def write_products(
    run_folder: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[Known] = (),
    *,
    incomplete_rows: bool = False,
) -> list[Path]:
    """Row table, pictures, effects and summary of a run, also of one that ended early or crashed.

    A run without the device gives its wave calibration in place of rows and surfaces, one with a
    hoist its spring map in place of surfaces, one that was pushed to be identified neither.

    They go into the run's folder, or beside the MCAP file if that is given alone; those that are
    read by ``calibrations`` (as of `row_table`) into a folder of their own in it.
    ``mean_position_alarm`` in m, ``incomplete_rows`` as of `row_table`. Returns the files written.
    RunError if the record cannot be read, KeyError if the kind of rig has no rows and power.
    """
    run = Path(run_folder)
    folder = run if run.is_dir() else run.parent
    if wave_calibration.is_calibration(facts(run).plan):
        _no_rows(calibrations)
        found, summary = _read_calibration(run, incomplete_rows)
        made = (
            []
            if found is None
            else [
                *wave_calibration.write_calibration(found, folder),
                write_picture(found, folder / "wave_calibration.png"),
            ]
        )
        return [*made, *write_texts(summary, folder)]
    if result.is_hoisted(facts(run).plan):
        _no_gains(calibrations)
        return _write_hoisted(run, folder, mean_position_alarm, incomplete_rows)
    table, summary = _read(run, mean_position_alarm, calibrations, incomplete_rows)
    folder = products_folder(folder, calibrations)
    folder.mkdir(exist_ok=True)
    if summary.findings_of == OPEN_LOOP:
        return [*write_rows(table, folder), *write_texts(summary, folder)]
    return [
        *write_rows(table, folder),
        *_pictures(table, folder),
        *write_texts(summary, folder),
        *write_page(summary, table, folder),
    ]


def _write_hoisted(
    run: Path, folder: Path, mean_position_alarm: float, incomplete_rows: bool
) -> list[Path]:
    table, found, summary = _read_map(run, mean_position_alarm, incomplete_rows)
    made = write_rows(table, folder)
    if found is not None:
        made += [*write_map(found, folder), *write_pictures(found, folder)]
    return [*made, *write_texts(summary, folder)]


def products_folder(folder: Path, calibrations: Sequence[Known]) -> Path:
    """Where a run's products are: in its folder as recorded, in another one if read otherwise."""
    titles = "_".join(known.file.title.replace(" ", "_") for known in calibrations)
    return folder / f"read_by_{titles}" if titles else folder


def _pictures(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Surfaces always; slices, bars and effects where the matrix has something for them."""
    found = matrix(table)
    made = [write_surfaces(table, folder / "surfaces.png")]
    if found.points and can_be_sliced(found):
        made.append(write_sliced(table, folder / "surfaces_sliced.png"))
    if found.points and varies_drive(found):
        made.append(write_bars(table, folder / "bars.png"))
    if effects := all_effects(table):
        made.append(write_effects(effects, folder / "effects.csv"))
    return made
