"""The room `products` (`rig.kinds.interface`) of kinds whose campaigns run gain matrices.

A kind with campaigns of a further sort gives its own function for `rig.analysis.report.analyse`.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import xarray

from rig.analysis import report, summary
from rig.analysis.bars import write_bars
from rig.analysis.points import gain_matrix, varied_columns
from rig.analysis.report import Analyse
from rig.analysis.rows import row_table
from rig.analysis.run_products import DrawOptions, RunProducts, RunSummary
from rig.analysis.slices import law_axes
from rig.analysis.surfaces import write_sliced
from rig.config.problems import error_text
from rig.processes.run_types import Outcome
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import RunError
from rig.row_contents import find_column, main_columns

PROGRESS = "drawing surfaces and summary"
NO_PRODUCTS = RunProducts((), {"optima": []})


def after_run(folder: Path, outcome: Outcome, analyse: Analyse = report.analyse) -> RunProducts:
    """Write rows, pictures and summary of a finished run, also of one that ended early."""
    files: list[Path] = []
    products = NO_PRODUCTS
    try:
        files = report.write_products(folder, analyse=analyse)
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
    analyse: Analyse = report.analyse,
) -> RunSummary:
    """Return the summary of a recorded run, computed from its record."""
    found = analyse(run, calibrations, incomplete_rows=incomplete_rows).summary
    return RunSummary(summary.as_text(found).rstrip(), summary.as_json(found))


def draw(run: Path, options: DrawOptions, analyse: Analyse = report.analyse) -> list[Path]:
    """Draw one surface, bars of all rows, or write all products; return the paths."""
    calibrations, incomplete = options.calibrations, options.incomplete_rows
    if not (options.selects_surface or options.sort):
        return report.write_products(run, calibrations, incomplete_rows=incomplete, analyse=analyse)
    table = row_table(run, calibrations, incomplete_rows=incomplete)
    folder = report.products_folder(run, calibrations)
    if options.output is None:
        folder.mkdir(exist_ok=True)
    if options.selects_surface:
        return [_draw_surface(table, folder, options)]
    if options.sort == "run":
        return [write_bars(table, options.output or folder / "bars.png")]
    return [write_bars(table, options.output or folder / "bars_by_power.png", "power")]


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
            fixed_values[left_out_column.name] = _parse_value(argument, value)
    picture = options.output or folder / f"surface_{x.name}_{y.name}.png"
    return write_sliced(table, picture, (x, y), fixed_values, options.stations)


def _parse_value(argument: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{argument}: {value!r} is not a number; write column=value in SI units")
    return number
