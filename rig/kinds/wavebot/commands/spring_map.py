"""`rig spring-map RUN`: map of the magnetic spring, and its calibration for the positioner."""

from pathlib import Path
from typing import Annotated, Any

import typer
import xarray

from rig.cli.input_files import find_run_of_kind, run_folder
from rig.cli.options import (
    CALIBRATIONS,
    RUNS,
    Calibrations,
    IncompleteRows,
    Json,
    OutputFolder,
    PictureFormat,
    PictureStyle,
    Run,
    Runs,
)  # fmt: skip
from rig.cli.output import FAILED, INPUT_ERRORS, OK, fail, input_errors, print_json
from rig.kinds.wavebot.commands import KIND
from rig.kinds.wavebot.spring_map.files import safe_strokes, write_calibration, write_map
from rig.kinds.wavebot.spring_map.pictures import write_pictures
from rig.kinds.wavebot.spring_map.result import findings, spring_map
from rig.presentation.json_values import json_value
from rig.recording.calibration import open_history

_TABLE_HEADER = "stator %   rate N/m     ±95 %   column    small  Tp N·m   f Hz  reverses at m"


def command(
    run: Run,
    name: Annotated[
        str,
        typer.Option(help="Name of the calibration; an existing one gets its next version."),
    ] = "spring_map",
    calibrations: Calibrations = CALIBRATIONS,
    output: OutputFolder = None,
    incomplete_rows: IncompleteRows = False,
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Map the magnetic spring from a hoist campaign, and write the map as a calibration file.

    A rig file uses the calibration with `spring_map: FILE`, which replaces
    its `spring.map`.
    """
    with input_errors("spring-map", as_json=as_json):
        path = find_run_of_kind(KIND, run, runs)
        newest_version = _newest_version(name, calibrations)
        table = spring_map(path, incomplete_rows=incomplete_rows)
        folder = output or run_folder(path)
        folder.mkdir(parents=True, exist_ok=True)
        written = [*write_map(table, folder), *write_pictures(table, folder)]
    if not as_json:
        print(_table_text(table))
        print("\n" + "\n".join(findings(table)))
    file = folder / f"{name}_v{1 if newest_version is None else newest_version + 1}.yaml"
    try:
        calibration = write_calibration(table, file, name, newest_version)
    except INPUT_ERRORS as error:
        return fail("spring-map", error, as_json=as_json, code=FAILED)
    written.append(file)
    if as_json:
        return print_json(_as_dict(table, calibration.file.title, written))
    print("\n" + "\n".join(str(each) for each in written))
    print(f"to use the map, write in the rig file   spring_map: {file.name}")
    return OK


def _newest_version(name: str, folder: Path) -> int | None:
    """Return the newest version of the named calibration; None if there is none yet."""
    if not folder.is_dir():
        return None
    chain = open_history(folder).chain(name)
    return chain[-1].file.version if chain else None


def _table_text(table: xarray.Dataset) -> str:
    lines = [_TABLE_HEADER]
    for i in range(table.sizes["station"]):
        station = table.isel(station=i)
        stroke = float(station["reversal_stroke"])
        lines.append(
            f"{float(station['station']):+8.1f} {float(station['rate']):+10.1f} "
            f"{float(station['rate_interval']):9.2g} {float(station['rate_column']):+8.0f} "
            f"{float(station['rate_small']):+8.0f} {float(station['peak']):+7.1f} "
            f"{float(station['natural_frequency']):6.3f}  {stroke:.3f}"
        )
    return "\n".join(lines).replace("inf", "  -").replace("nan", "  -")


def _as_dict(table: xarray.Dataset, calibration: str, written: list[Path]) -> dict[str, Any]:
    names = ("station", "rate", "rate_interval", "rate_column", "rate_small", "peak",
             "natural_frequency", "reversal_stroke")  # fmt: skip
    stations = {name: json_value(table[name].values.tolist()) for name in names}
    return {
        "stations": stations | {"stroke_m": safe_strokes(table)},
        "findings": findings(table),
        "calibration": calibration,
        "written": [str(path) for path in written],
    }
