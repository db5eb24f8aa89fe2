"""Files of a spring map: dataset, table, and the calibration for a rig file."""

import math
from itertools import pairwise
from pathlib import Path

import xarray

from rig.kinds.wavebot.spring_map.result import BY_STATION
from rig.recording.calibration import CalibrationVersion, open_calibration
from rig.recording.runs import RunError
from rig.recording.table_file import write_table

STROKE_MARGIN = 0.95  # of the stroke at which the stator's force reverses
NAME = "spring_map"


def write_map(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write ``spring_map.nc`` with all data and ``spring_map.csv`` with a line for each station."""
    binary = folder / f"{NAME}.nc"
    table.to_netcdf(binary, engine="h5netcdf")
    columns = {
        f"{name} [{table[name].attrs.get('units', '1')}]": table[name].values.tolist()
        for name in ("station", *BY_STATION)
    }
    return [write_table(columns, folder / f"{NAME}.csv"), binary]


def safe_strokes(table: xarray.Dataset) -> list[float]:
    """Return the stroke (m, either direction) of each station.

    It stays below the force reversal and within the measured travel.
    """
    reversed_at, travel = table["reversal_stroke"].values, table["travel"].values
    return [
        math.floor(1000.0 * min(STROKE_MARGIN * float(stroke), float(travelled))) / 1000.0
        for stroke, travelled in zip(reversed_at, travel, strict=True)
    ]


def write_calibration(
    table: xarray.Dataset, path: Path, name: str = NAME, supersedes: int | None = None
) -> CalibrationVersion:
    """Write the map as a calibration file: stator position (%) -> spring rate (N/m), strokes.

    Returns the calibration as `rig` reads it. Raises RunError if the map cannot be inverted: a
    station has no rate, there are fewer than two, or the rate is not strictly monotone.
    """
    stations = [round(float(value), 2) for value in table["station"].values]
    rates = [round(float(value), 1) for value in table["rate"].values]
    _check_invertible(stations, rates)
    attributes = table.attrs
    version = 1 if supersedes is None else supersedes + 1
    strokes = safe_strokes(table)
    lines = [
        f"# Spring map of run {attributes.get('run', '')}; a rig file names it: spring_map: FILE",
        f"name: {name}",
        f"version: {version}",
        *([] if supersedes is None else [f"supersedes: {supersedes}"]),
        "quantity: spring_map",
        "unit: N/m",
        "correction:                    # stator position, % -> rate over ±39.27 deg, N/m",
        "  kind: table",
        f"  recorded: {stations}",
        f"  corrected: {rates}",
        f"stroke_m: {strokes}     # {STROKE_MARGIN:g} of the stroke at force reversal",
        f'valid: {{dates: {{from: "{str(attributes.get("started_utc", ""))[:10]}"}}}}',
        "outside: refuse",
        f'source: "run {attributes.get("run", "")} ({attributes.get("mode", "")})"',
        f'reason: "spring map by hoist, {len(rates)} stator positions, slew load cell"',
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return open_calibration(path)


def _check_invertible(stations: list[float], rates: list[float]) -> None:
    if len(rates) < 2:
        raise RunError(f"{len(rates)} stator position: a map needs at least 2")
    without_rate = [f"{s:g} %" for s, rate in zip(stations, rates, strict=True) if math.isnan(rate)]
    if without_rate:
        raise RunError(f"no rate at {', '.join(without_rate)}: the travel there was too short")
    steps = [after - before for before, after in pairwise(rates)]
    if not (all(step > 0.0 for step in steps) or all(step < 0.0 for step in steps)):
        shown = ", ".join(f"{s:g} %: {rate:g}" for s, rate in zip(stations, rates, strict=True))
        raise RunError(
            f"rates (N/m) neither rise nor fall strictly with stator position ({shown}): a rate "
            "would have two positions"
        )
