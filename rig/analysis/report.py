"""The products of a campaign's run: their files, its summary, its pictures.

This module is the room `products` (`rig.kinds.interface`) of kinds whose campaigns run gain
matrices. A kind with campaigns of a further sort gives its own function for `analyse`.
"""

import ctypes
import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import NamedTuple

import xarray

from rig.analysis import certificate
from rig.analysis import summary as summaries
from rig.analysis.bars import varies_drive, write_bars
from rig.analysis.budget_picture import write_budget
from rig.analysis.calibration_picture import write_picture
from rig.analysis.choices import choices_of
from rig.analysis.choices_picture import write_choices
from rig.analysis.effects import all_effects, write_effects
from rig.analysis.page import has_few_chosen, write_page
from rig.analysis.points import gain_matrix, varied_columns
from rig.analysis.rows import COMPLETE, record_of, rig_time, write_rows
from rig.analysis.run_products import DrawOptions, RunProducts, RunSummary
from rig.analysis.slices import law_axes
from rig.analysis.stop_reason import find_stop
from rig.analysis.stored_rows import current_table
from rig.analysis.summary import Summary, write_texts
from rig.analysis.surfaces import can_be_sliced, write_sliced, write_surfaces
from rig.analysis.uncertainty import BUDGET_ATTRIBUTE, uncertainty_texts
from rig.config.problems import error_text, parse_number
from rig.processes.run_types import Outcome
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError, RunInfo, mcap_file, reader, run_info
from rig.recording.runs.state import RecordState
from rig.recording.runs.windows import ADAPTIVE
from rig.row_contents import LAW, X, Y, find_column, main_columns
from rig.spectra import wave_calibration

PROGRESS = "drawing surfaces and summary"
NO_PRODUCTS = RunProducts((), {"optima": []})
OPEN_LOOP = "Excited by an open-loop reference"
IDENTIFY_HINT = "its impedance: rig identify"
PROFILE_HINT = "a profile excites too few lines for an impedance: use a multisine"


def _unfinished_text(contents: list[mcap_file.FileContents]) -> str:
    if all(each.finished for each in contents):
        return ""
    unread = sum(each.unread for each in contents)
    unread_text = f", {unread} torn bytes at its end" if unread else ""
    return f"the record was not finished by its writer{unread_text}"


def summarise_rows(
    run: Path, calibrations: Sequence[CalibrationVersion] = (), *, incomplete_rows: bool = False
) -> tuple[xarray.Dataset, Summary]:
    """Return the row table and the summary of a run; the arguments are those of `row_table`."""
    contents = list(reader.open_files(run).contents)
    table = current_table(run, calibrations, incomplete_rows=incomplete_rows)
    run_facts = run_info(run, contents)
    summary = summaries.summarise(
        table, run_facts, _unfinished_text(contents), find_stop(run, run_facts.status)
    )
    summary = _with_record(summary, record_of(table), run_facts)
    summary = summary._replace(uncertainty=uncertainty_texts(table))
    if Path(run).is_dir():
        summary = summary._replace(rehearsed=certificate.deviation_texts(Path(run)))
    if has_excitation(run_facts):
        reference = run_facts.plan["reference"]
        hint = PROFILE_HINT if reference.get("kind") == "profile" else IDENTIFY_HINT
        findings = (str(reference.get("words", "")), hint)
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


Write = Callable[[Path], list[Path]]
"""Writes results into a folder and returns the paths of the files."""


class Analysis(NamedTuple):
    """The summary of a run, and the functions that write its other results."""

    summary: Summary
    write_results: Write
    pictures: tuple[Write, ...] = ()  # each is called in another process


def analyse(
    run: Path, calibrations: Sequence[CalibrationVersion] = (), *, incomplete_rows: bool = False
) -> Analysis:
    """Return the analysis of a run, which may have ended early or crashed, without writing files.

    A run without the device gives a wave calibration instead of rows and surfaces, and an open-loop
    test gives neither surfaces nor best points. The arguments are those of `row_table`. Raises
    RunError if the record cannot be read, KeyError if the kind of rig has no rows and power, and
    ValueError for calibrations of a run without rows.
    """
    run_facts = run_info(run)
    if wave_calibration.is_calibration(run_facts.plan):
        if calibrations:
            raise ValueError("a wave calibration has no rows for a calibration to correct")
        return _analyse_waves(run, incomplete_rows)
    table, summary = summarise_rows(run, calibrations, incomplete_rows=incomplete_rows)
    if summary.findings_of == OPEN_LOOP:
        return Analysis(summary, partial(write_rows, table))
    page: Write = partial(write_page, summary, table)
    drawn = (
        page,
        *_pictures(table, few=has_few_chosen(summary, table)),
        *_picture_of_choices(table, run_facts),
    )
    return Analysis(summary, partial(_write_tables, run, table), drawn)


def _analyse_waves(run: Path, incomplete_rows: bool) -> Analysis:
    """Return the wave calibration of a run; without files if no whole period was measured."""
    contents = list(reader.open_files(run).contents)
    run_facts = run_info(run, contents)
    waves = None
    try:
        waves = wave_calibration.calibrate_waves(run, incomplete_rows=incomplete_rows)
        findings = wave_calibration.findings(waves)
    except RunError as error:
        findings = [str(error)]
    no_rows, unfinished = xarray.Dataset(), _unfinished_text(contents)
    summary = summaries.summarise(no_rows, run_facts, unfinished, findings=tuple(findings))
    summary = _with_record(summary, reader.check_record(run), run_facts)
    return Analysis(summary, partial(_write_waves, waves))


def _with_record(summary: Summary, record: RecordState, run_facts: RunInfo) -> Summary:
    return summary._replace(record=record, rig_time_s=rig_time(record, run_facts))


def _write_waves(waves: xarray.Dataset | None, folder: Path) -> list[Path]:
    if waves is None:
        return []
    written = wave_calibration.write_calibration(waves, folder)
    return [*written, write_picture(waves, folder / "wave_calibration.png")]


_PR_SET_PDEATHSIG = 1  # prctl: the signal that a process gets when its parent ends

Analyse = Callable[..., Analysis]
"""Analyses a run, as `analyse`; a kind of rig may know further sorts of runs."""


def write_products(
    run: Path,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
    analyse: Analyse = analyse,
) -> list[Path]:
    """Write summary, row table, pictures and effects of a run; return the files written.

    The files go into the run's folder, or next to the MCAP file if ``run`` is one. Products with
    ``calibrations`` go into a subfolder. The errors are those of `analyse`.
    """
    found = analyse(run, calibrations, incomplete_rows=incomplete_rows)
    folder = products_folder(run, calibrations)
    folder.mkdir(exist_ok=True)
    if not found.pictures:
        return [*found.write_results(folder), *write_texts(found.summary, folder)]
    if threading.active_count() > 1:  # forked, their locks would never be released (a notebook)
        written = [*found.write_results(folder), *write_texts(found.summary, folder)]
        return [*written, *(path for draw in found.pictures for path in draw(folder))]
    # Drawing takes longer than the rest. Forked processes need no time to import matplotlib.
    count = min(len(found.pictures), len(os.sched_getaffinity(0)))
    with ProcessPoolExecutor(count, get_context("fork"), initializer=_begin_drawing) as pool:
        try:
            with _ctrl_c_waits():  # until the processes are there, which inherit that
                drawn = [pool.submit(draw, folder) for draw in found.pictures]
            written = [*found.write_results(folder), *write_texts(found.summary, folder)]
            return [*written, *(path for each in drawn for path in each.result())]
        except BrokenProcessPool as error:
            raise ChildProcessError("a process that drew pictures was killed") from error
        except KeyboardInterrupt:  # do not wait for the pictures
            for child in active_children():
                child.kill()
            raise


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Hold Ctrl-C back until the end of the context, and from processes that begin in it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_drawing() -> None:
    """Leave Ctrl-C to the parent, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def products_folder(run: Path, calibrations: Sequence[CalibrationVersion]) -> Path:
    """Return the folder of a run's products: its own, or a subfolder if calibrations apply."""
    folder = run if run.is_dir() else run.parent
    titles = "_".join(calibration.file.title.replace(" ", "_") for calibration in calibrations)
    return folder / f"read_by_{titles}" if titles else folder


def _write_tables(run: Path, table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write the row table, the rows beside a rehearsal, and effects if there are data for them."""
    paths = [*write_rows(table, folder), *certificate.write_deviations(run, folder)]
    if effects := all_effects(table):
        paths.append(write_effects(effects, folder / "effects.csv"))
    return paths


def _pictures(table: xarray.Dataset, *, few: bool) -> list[Write]:
    """Return the functions that draw surfaces, and slices and bars if the matrix has their data.

    ``few``: an adaptive campaign measured too few of its candidates for surfaces.
    """
    gains, pictures = gain_matrix(table), list[Write]()
    if not few:
        pictures.append(partial(_draw, write_surfaces, table, "surfaces.png"))
    if gains.points and not few and can_be_sliced(gains):
        pictures.append(partial(_draw, write_sliced, table, "surfaces_sliced.png"))
    if gains.points and varies_drive(gains):
        pictures.append(partial(_draw, write_bars, table, "bars.png"))
    if gains.points and BUDGET_ATTRIBUTE in table.attrs:
        pictures.append(partial(_draw, write_budget, table, "uncertainty.png"))
    return pictures


def _picture_of_choices(table: xarray.Dataset, run_facts: RunInfo) -> Iterator[Write]:
    """Yield the function that draws the choices of an adaptive campaign."""
    choices, adaptive = choices_of(run_facts), run_facts.plan.get(ADAPTIVE, {})
    if not choices or not (table["state"].values == COMPLETE).any():
        return
    write = partial(write_choices, choices, adaptive["station"], adaptive["precision_w"])
    yield partial(_draw, write, table, "choices.png")


def _draw(
    write: Callable[[xarray.Dataset, Path], Path], table: xarray.Dataset, name: str, folder: Path
) -> list[Path]:
    return [write(table, folder / name)]


def after_run(folder: Path, outcome: Outcome, analyse: Analyse = analyse) -> RunProducts:
    """Write rows, pictures and summary of a finished run, also of one that ended early."""
    files: list[Path] = []
    products = NO_PRODUCTS
    try:
        files = write_products(folder, analyse=analyse)
        values = json.loads((folder / "summary.json").read_text())
        products = RunProducts(
            tuple(files), {"optima": values["optima"]}, rows_done=values["rows_done"]
        )
    except (RunError, OSError, ValueError) as error:
        trouble = (
            error_text(error) if files else f"could not make all products: {error_text(error)}"
        )
        products = products._replace(files=tuple(files), trouble=trouble)
    text = folder / "summary.txt"
    return products._replace(text=text.read_text().rstrip()) if text.exists() else products


def summarise(
    run: Path,
    calibrations: Sequence[CalibrationVersion],
    *,
    incomplete_rows: bool,
    analyse: Analyse = analyse,
) -> RunSummary:
    """Return the summary of a recorded run, computed from its record."""
    found = analyse(run, calibrations, incomplete_rows=incomplete_rows).summary
    return RunSummary(summaries.as_text(found).rstrip(), summaries.as_json(found))


def draw(run: Path, options: DrawOptions, analyse: Analyse = analyse) -> list[Path]:
    """Draw one surface, bars of all rows, or write all products; return the paths."""
    calibrations, incomplete = options.calibrations, options.incomplete_rows
    if not (options.selects_surface or options.sort):
        return write_products(run, calibrations, incomplete_rows=incomplete, analyse=analyse)
    table = current_table(run, calibrations, incomplete_rows=incomplete)
    folder = products_folder(run, calibrations)
    if options.output is None:
        folder.mkdir(exist_ok=True)
    if options.selects_surface:
        return [_draw_surface(table, folder, options)]
    if options.sort == "run":
        return [write_bars(table, options.output or folder / "bars.png", names=options.stations)]
    path = options.output or folder / "bars_by_power.png"
    return [write_bars(table, path, "power", options.stations)]


def _draw_surface(table: xarray.Dataset, folder: Path, options: DrawOptions) -> Path:
    matrix = gain_matrix(table)
    x, y = law_axes(matrix)
    if options.surface is not None:
        x, y = (find_column(matrix.columns, name) for name in options.surface)
    varying = varied_columns(matrix)
    for axis in (x, y):
        if axis not in (*varying, *main_columns(matrix.columns)):
            available = ", ".join(c.name for c in varying) or "nothing"
            raise ValueError(f"{axis.name} does not vary in this run; these vary: {available}")
    other_columns = [c for c in varying if c not in (x, y)]
    fixed_values = {}
    for argument in options.left_out:
        name, _, value = argument.partition("=")
        left_out_column = find_column(matrix.columns, name)
        if left_out_column not in other_columns:
            available = ", ".join(c.name for c in other_columns) or "none"
            raise ValueError(f"{name} cannot be left out; besides the axes these vary: {available}")
        if value:
            number = parse_number(value)
            if number is None:
                hint = "write column=value in SI units"
                raise ValueError(f"{argument}: {value!r} is not a number; {hint}")
            fixed_values[left_out_column.name] = number
    picture = options.output or folder / f"surface_{x.name}_{y.name}.png"
    return write_sliced(table, picture, (x, y), fixed_values, options.stations)
