"""`rig plot RUN`."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rig import cli
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.find_run import find_calibrations, find_run

if TYPE_CHECKING:
    import xarray

STATIONS = {
    "mechanical": "mechanical_1",
    "shaft": "mechanical_2",
    "ac": "ac",
    "dc": "dc",
}
"""What people call the power stations."""


class PlotOptions(NamedTuple):
    """What is to be drawn; nothing of it: everything anew."""

    fields: list[str]
    rows: list[int]
    surface: tuple[str, str] | None  # columns along x and y
    left_out: list[str]  # columns, or column=value
    stations: list[str]
    sort: str | None
    output: Path | None
    calibrations: list[str]  # to read the run by
    incomplete_rows: bool = False


def main(named: Path, runs: Path, asked: PlotOptions, *, as_json: bool) -> int:
    """Write surfaces and summary anew, or what is asked for; print what was written."""
    try:
        written = _draw(find_run(named, runs), asked)
    except REFUSED as error:
        return refuse("plot", error, as_json=as_json)
    if as_json:
        print(json.dumps([str(path) for path in written]))
    else:
        print("\n".join(str(path) for path in written))
    return cli.OK


def _draw(run: Path, asked: PlotOptions) -> list[Path]:
    from rig.analysis.report import products_folder, write_products
    from rig.analysis.rows import MEAN_POSITION_ALARM, row_table
    from rig.analysis.traces import DEFAULT_FIELDS, write_traces

    traces = bool(asked.fields or asked.rows)
    surface = bool(asked.surface or asked.left_out or asked.stations)
    if traces + surface + bool(asked.sort) > 1:
        raise ValueError("fields over time, a surface or bars: one picture at a time")
    if asked.sort not in (None, "run", "power"):
        raise ValueError(f"--sort {asked.sort}: allowed run, power")
    read_by = find_calibrations(asked.calibrations)
    folder = run if run.is_dir() else run.parent
    if surface or asked.sort:
        table = row_table(run, MEAN_POSITION_ALARM, read_by, incomplete_rows=asked.incomplete_rows)
        folder = products_folder(folder, read_by)
        if asked.output is None:
            folder.mkdir(exist_ok=True)
        return [_surface(table, folder, asked) if surface else _bars(table, folder, asked)]
    if traces or asked.output:
        if read_by:
            raise ValueError("fields over time are drawn as recorded; leave out --calibration")
        picture = asked.output or folder / "traces.png"
        return [write_traces(run, picture, asked.fields or DEFAULT_FIELDS, asked.rows or None)]
    incomplete = asked.incomplete_rows
    return write_products(run, MEAN_POSITION_ALARM, read_by, incomplete_rows=incomplete)


def _bars(table: "xarray.Dataset", folder: Path, asked: PlotOptions) -> Path:
    from rig.analysis.bars import write_bars

    if asked.sort == "run":
        return write_bars(table, asked.output or folder / "bars.png")
    return write_bars(table, asked.output or folder / "bars_by_power.png", "power")


def _surface(table: "xarray.Dataset", folder: Path, asked: PlotOptions) -> Path:
    from rig.analysis.labels import column
    from rig.analysis.points import matrix, varied
    from rig.analysis.surfaces import KINDS, write_sliced
    from rig.config.columns import REQUIRED_COLUMNS

    names = asked.surface or ("ki", "kp")
    x, y = column(names[0]), column(names[1])
    varying = varied(matrix(table))
    for axis in (x, y):
        if axis not in (*varying, *REQUIRED_COLUMNS):
            there = ", ".join(c.name for c in varying) or "nothing"
            raise ValueError(f"{axis.name} does not vary in this run; what varies: {there}")
    free = [c for c in varying if c not in (x, y)]
    held = {}
    for words in asked.left_out:
        name, _, value = words.partition("=")
        left = column(name)
        if left not in free:
            there = ", ".join(c.name for c in free) or "none"
            raise ValueError(f"{name} cannot be left out; what varies beside the axes: {there}")
        if value:
            held[left.name] = _number(words, value)
    kinds = tuple(dict.fromkeys(_station(name) for name in asked.stations)) or KINDS
    picture = asked.output or folder / f"surface_{x.name}_{y.name}.png"
    return write_sliced(table, picture, x, y, held, kinds)


def _number(words: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{words}: {value!r} is no number; write column=value in SI units")
    return number


def _station(name: str) -> str:
    if name not in STATIONS:
        raise ValueError(f"no station {name!r}; there are {', '.join(STATIONS)}")
    return STATIONS[name]
