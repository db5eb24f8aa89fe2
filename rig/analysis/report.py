"""Writes all products of a run into its folder, after the run or on request."""

import json
from collections.abc import Sequence
from pathlib import Path

import xarray

from rig.analysis.bars import varies_drive, write_bars
from rig.analysis.calibration_picture import write_picture
from rig.analysis.effects import all_effects, write_effects
from rig.analysis.page import write_page
from rig.analysis.points import gain_matrix
from rig.analysis.rows import MEAN_POSITION_ALARM, row_table, write_rows
from rig.analysis.stop_reason import find_stop
from rig.analysis.summary import Summary, summarise, write_texts
from rig.analysis.surfaces import can_be_sliced, write_sliced, write_surfaces
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError, mcap_file, reader
from rig.recording.runs.folder import RunInfo, run_info
from rig.recording.runs.state import RecordState
from rig.row_contents import LAW, X, Y
from rig.spectra import wave_calibration

OPEN_LOOP = "Excited by an open-loop reference"
IDENTIFY_HINT = "its impedance: rig identify"


def _unfinished_text(contents: list[mcap_file.FileContents]) -> str:
    if all(each.finished for each in contents):
        return ""
    unread = sum(each.unread for each in contents)
    unread_text = f", {unread} torn bytes at its end" if unread else ""
    return f"the record was not finished by its writer{unread_text}"


def summarise_rows(
    run: Path,
    mean_position_alarm: float,
    calibrations: Sequence[CalibrationVersion],
    incomplete_rows: bool = False,
) -> tuple[xarray.Dataset, Summary]:
    """Return the row table and the summary of a run; the arguments are those of `row_table`."""
    contents = list(reader.open_files(run).contents)
    table = row_table(run, mean_position_alarm, calibrations, incomplete_rows=incomplete_rows)
    run_facts = run_info(run, contents)
    summary = summarise(
        table, run_facts, _unfinished_text(contents), find_stop(run, run_facts.status)
    )
    summary = summary._replace(
        record=RecordState.from_dict(json.loads(table.attrs["record_state"]))
    )
    if has_excitation(run_facts):
        findings = (str(run_facts.plan["reference"].get("words", "")), IDENTIFY_HINT)
        summary = summary._replace(optima=(), effects=(), findings_of=OPEN_LOOP, findings=findings)
    return table, summary


def has_excitation(run_facts: RunInfo) -> bool:
    """Return whether a run is an open-loop test: it has a reference, and its gains are constant.

    Its powers are those of the excitation, so it has no best points.
    """
    plan = run_facts.plan
    rows = plan.get("rows") or []
    columns = run_facts.row_contents.columns
    names = [column.name for column in columns if column.role in (X, Y, LAW)]
    gains = {tuple(row.get(name) for name in names) for row in rows}
    return isinstance(plan.get("reference"), dict) and len(gains) == 1


def _summarise_calibration(
    run: Path, incomplete_rows: bool
) -> tuple[xarray.Dataset | None, Summary]:
    """Return wave calibration and summary; no calibration if no whole period was measured."""
    contents = list(reader.open_files(run).contents)
    run_facts = run_info(run, contents)
    try:
        table = wave_calibration.calibrate_waves(run, incomplete_rows=incomplete_rows)
        findings = wave_calibration.findings(table)
    except RunError as error:
        table, findings = None, [str(error)]
    no_rows = xarray.Dataset()
    summary = summarise(no_rows, run_facts, _unfinished_text(contents), findings=tuple(findings))
    return table, summary._replace(record=reader.check_record(run))


def summarise_run(
    run: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> Summary:
    """Return the summary of a run from its record, without writing files.

    ``mean_position_alarm`` (m), ``calibrations`` and ``incomplete_rows`` are those of `row_table`.
    Raises RunError if the record cannot be read, and KeyError if the kind of rig has no rows and
    power.
    """
    if wave_calibration.is_calibration(run_info(run).plan):
        _refuse_for_waves(calibrations)
        return _summarise_calibration(Path(run), incomplete_rows)[1]
    return summarise_rows(Path(run), mean_position_alarm, calibrations, incomplete_rows)[1]


def _refuse_for_waves(calibrations: Sequence[CalibrationVersion]) -> None:
    if calibrations:
        raise ValueError("a wave calibration has no rows for a calibration to correct")


def write_products(
    run_folder: Path,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> list[Path]:
    """Write row table, pictures, effects and summary of a run; return the files written.

    The run may have ended early or crashed. A run without the device gives a wave calibration
    instead of rows and surfaces, and an open-loop test gives neither surfaces nor best points.

    The files go into the run's folder, or next to the MCAP file if ``run_folder`` is one. Products
    with ``calibrations`` go into a subfolder. ``mean_position_alarm`` (m), ``calibrations`` and
    ``incomplete_rows`` are those of `row_table`. Raises RunError if the record cannot be read, and
    KeyError if the kind of rig has no rows and power.
    """
    run = Path(run_folder)
    folder = run if run.is_dir() else run.parent
    if wave_calibration.is_calibration(run_info(run).plan):
        _refuse_for_waves(calibrations)
        waves, summary = _summarise_calibration(run, incomplete_rows)
        paths = (
            []
            if waves is None
            else [
                *wave_calibration.write_calibration(waves, folder),
                write_picture(waves, folder / "wave_calibration.png"),
            ]
        )
        return [*paths, *write_texts(summary, folder)]
    table, summary = summarise_rows(run, mean_position_alarm, calibrations, incomplete_rows)
    folder = products_folder(folder, calibrations)
    folder.mkdir(exist_ok=True)
    if summary.findings_of == OPEN_LOOP:
        return [*write_rows(table, folder), *write_texts(summary, folder)]
    return [
        *write_rows(table, folder),
        *_write_pictures(table, folder),
        *write_texts(summary, folder),
        *write_page(summary, table, folder),
    ]


def products_folder(folder: Path, calibrations: Sequence[CalibrationVersion]) -> Path:
    """Return the folder of a run's products: its own, or a subfolder if calibrations apply."""
    titles = "_".join(calibration.file.title.replace(" ", "_") for calibration in calibrations)
    return folder / f"read_by_{titles}" if titles else folder


def _write_pictures(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write surfaces, and slices, bars and effects if the matrix has data for them."""
    gains = gain_matrix(table)
    paths = [write_surfaces(table, folder / "surfaces.png")]
    if gains.points and can_be_sliced(gains):
        paths.append(write_sliced(table, folder / "surfaces_sliced.png"))
    if gains.points and varies_drive(gains):
        paths.append(write_bars(table, folder / "bars.png"))
    if effects := all_effects(table):
        paths.append(write_effects(effects, folder / "effects.csv"))
    return paths
