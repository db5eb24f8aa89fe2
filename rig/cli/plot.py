"""`rig plot RUN`."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rig import cli
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.find_run import find_calibrations, find_run

if TYPE_CHECKING:
    import xarray


class PlotOptions(NamedTuple):
    """Options of `rig plot`; without any, the command draws all products."""

    fields: list[str]
    rows: list[int]
    surface: tuple[str, str] | None  # columns along x and y
    left_out: list[str]  # columns, or column=value
    stations: list[str]
    sort: str | None
    output: Path | None
    calibrations: list[str]  # applied to the run
    incomplete_rows: bool = False


def main(run_name: Path, runs: Path, options: PlotOptions, *, as_json: bool) -> int:
    """Write surfaces and summary, or the selected picture; print the written paths."""
    try:
        written = _draw(find_run(run_name, runs), options)
    except INPUT_ERRORS as error:
        return refuse("plot", error, as_json=as_json)
    if as_json:
        print(json.dumps([str(path) for path in written]))
    else:
        print("\n".join(str(path) for path in written))
    return cli.OK


def _draw(run: Path, options: PlotOptions) -> list[Path]:
    from rig.analysis.report import products_folder, write_products
    from rig.analysis.rows import MEAN_POSITION_ALARM, row_table
    from rig.analysis.traces import write_traces

    traces = bool(options.fields or options.rows)
    surface = bool(options.surface or options.left_out or options.stations)
    if traces + surface + bool(options.sort) > 1:
        raise ValueError("draw fields over time, a surface or bars; give options of one of them")
    if options.sort not in (None, "run", "power"):
        raise ValueError(f"--sort {options.sort}: allowed run, power")
    calibrations = find_calibrations(options.calibrations)
    folder = run if run.is_dir() else run.parent
    if surface or options.sort:
        table = row_table(
            run, MEAN_POSITION_ALARM, calibrations, incomplete_rows=options.incomplete_rows
        )
        folder = products_folder(folder, calibrations)
        if options.output is None:
            folder.mkdir(exist_ok=True)
        return [
            _draw_surface(table, folder, options) if surface else _draw_bars(table, folder, options)
        ]
    if traces or options.output:
        if calibrations:
            raise ValueError("fields over time show recorded values; leave out --calibration")
        picture = options.output or folder / "traces.png"
        return [write_traces(run, picture, options.fields, options.rows or None)]
    incomplete = options.incomplete_rows
    return write_products(run, MEAN_POSITION_ALARM, calibrations, incomplete_rows=incomplete)


def _draw_bars(table: "xarray.Dataset", folder: Path, options: PlotOptions) -> Path:
    from rig.analysis.bars import write_bars

    if options.sort == "run":
        return write_bars(table, options.output or folder / "bars.png")
    return write_bars(table, options.output or folder / "bars_by_power.png", "power")


def _draw_surface(table: "xarray.Dataset", folder: Path, options: PlotOptions) -> Path:
    from rig.analysis.points import gain_matrix, varied_columns
    from rig.analysis.slices import law_axes
    from rig.analysis.surfaces import write_sliced
    from rig.row_contents import find_column, main_columns

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
    return write_sliced(table, picture, (x, y), fixed_values, tuple(options.stations))


def _parse_value(argument: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{argument}: {value!r} is not a number; write column=value in SI units")
    return number
