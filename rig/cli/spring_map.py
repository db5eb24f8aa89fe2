"""`rig spring-map RUN`: the magnetic spring's map and the calibration that the positioner uses."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Run, Runs

if TYPE_CHECKING:
    import xarray

_HEAD = "stator %   rate N/m     ±95 %   column    small  Tp N·m   f Hz  reverses at m"


def command(
    run: Run,
    name: Annotated[
        str, typer.Option(help="Name of the calibration; a known one gets its next version.")
    ] = "spring_map",
    calibrations: Annotated[
        Path, typer.Option("--calibrations", help="Folder of the calibrations there are.")
    ] = Path("configs/calibrations"),
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
    ] = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Map the magnetic spring from a hoist campaign, and write the calibration that a rig can name.

    The rig file takes it with `spring_map: FILE`, in place of its own `spring.map`.
    """
    incomplete = incomplete_rows
    sys.exit(main(run, runs, name, calibrations, output, incomplete_rows=incomplete, as_json=json))


def main(
    named: Path,
    runs: Path,
    name: str,
    calibrations: Path,
    output: Path | None,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Make the map, its pictures and its calibration; gives the exit code."""
    from rig import cli
    from rig.analysis.spring_map.files import write_calibration, write_map
    from rig.analysis.spring_map.pictures import write_pictures
    from rig.analysis.spring_map.result import findings, spring_map
    from rig.cli.command_error import fail
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.recording.runs import RunError

    try:
        run = find_run(named, runs)
        before = _newest(name, calibrations)
        table = spring_map(run, incomplete_rows=incomplete_rows)
        folder = output or (run if run.is_dir() else run.parent)
        folder.mkdir(parents=True, exist_ok=True)
        written = [*write_map(table, folder), *write_pictures(table, folder)]
    except (*REFUSED, RunError) as error:
        return refuse("spring-map", error, as_json=as_json)
    if not as_json:
        print(_table(table))
        print("\n" + "\n".join(findings(table)))
    path = folder / f"{name}_v{1 if before is None else before + 1}.yaml"
    try:
        known = write_calibration(table, path, name, before)
    except (*REFUSED, RunError) as error:
        return fail("spring-map", error, as_json=as_json, code=cli.FAILED)
    written.append(path)
    if as_json:
        print(json.dumps(_plain(table, findings(table), known.file.title, written)))
    else:
        print("\n" + "\n".join(str(one) for one in written))
        print(f"a rig file uses it with   spring_map: {path.name}")
    return cli.OK


def _newest(name: str, folder: Path) -> int | None:
    """The newest version of a calibration of that name; None if there is none yet."""
    from rig.recording.calibration import open_history

    if not folder.is_dir():
        return None
    chain = open_history(folder).chain(name)
    return chain[-1].file.version if chain else None


def _table(table: "xarray.Dataset") -> str:
    lines = [_HEAD]
    for i in range(table.sizes["station"]):
        one = table.isel(station=i)
        stroke = float(one["reversal_stroke"])
        lines.append(
            f"{float(one['station']):+8.1f} {float(one['rate']):+10.1f} "
            f"{float(one['rate_interval']):9.2g} {float(one['rate_column']):+8.0f} "
            f"{float(one['rate_small']):+8.0f} {float(one['peak']):+7.1f} "
            f"{float(one['natural_frequency']):6.3f}  {stroke:.3f}"
        )
    return "\n".join(lines).replace("inf", "  -").replace("nan", "  -")


def _plain(
    table: "xarray.Dataset", told: list[str], calibration: str, written: list[Path]
) -> dict[str, Any]:
    from rig.analysis.spring_map.files import strokes

    def numbers(name: str) -> list[float | None]:
        return [one if abs(one) < float("inf") else None for one in table[name].values.tolist()]

    names = ("station", "rate", "rate_interval", "rate_column", "rate_small", "peak",
             "natural_frequency", "reversal_stroke")  # fmt: skip
    return {
        "stations": {name: numbers(name) for name in names} | {"stroke_m": strokes(table)},
        "findings": told,
        "calibration": calibration,
        "written": [str(path) for path in written],
    }
