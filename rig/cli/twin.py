"""`rig twin RUNS`: a plant file from measurements of a device."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Runs

_RUNS = (
    "A run's folder, MCAP file, id, campaign, or 'last': first a run in calm water with an "
    "open-loop reference, then any runs in waves and wave calibrations."
)
PLANT_HELP = "Plant file for values that no run measures (default: the first run's plant file)."
PROBE_HELP = "Probe of a wave calibration at the position of the device."


def command(
    run_names: Annotated[list[Path], typer.Argument(metavar="RUNS...", help=_RUNS)],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder to write to (default: twin in the first run)."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help=PLANT_HELP)] = None,
    probe: Annotated[str, typer.Option(help=PROBE_HELP)] = "",
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Write a plant file, identified from runs, for rehearsals, checks and sweeps.

    A campaign uses it with the key `plant: TWIN/plant.yaml`.
    """
    sys.exit(
        main(run_names, runs, output, plant, probe, incomplete_rows=incomplete_rows, as_json=json)
    )


def main(
    run_names: list[Path],
    runs: Path,
    output: Path | None,
    plant: Path | None,
    probe: str,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Identify the device, write its twin, print the estimates, and return the exit code."""
    from rig import cli
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.kinds.wavebot.twin import plant_file
    from rig.kinds.wavebot.twin.estimate import identify_twin

    try:
        paths = [find_run(name, runs) for name in run_names]
        estimate = identify_twin(paths, plant, probe, incomplete_rows=incomplete_rows)
        first_run = paths[0] if paths[0].is_dir() else paths[0].parent
        written = plant_file.write(estimate, output or first_run / plant_file.FOLDER)
    except INPUT_ERRORS as error:
        return refuse("twin", error, as_json=as_json)
    summary = plant_file.as_dict(estimate)
    if as_json:
        print(json.dumps({**summary, "written": [str(path) for path in written]}))
        return cli.OK
    rows = [("estimate", "value", "±1 s.d.", "from")]
    rows += [
        (name, f"{item['value']:.6g}", f"{item['deviation']:.2g}", item["source"])
        for name, item in summary["estimates"].items()
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    for name, value, deviation, source in rows:
        print(f"{name:{widths[0]}}  {value:>{widths[1]}}  {deviation:>{widths[2]}}  {source}")
    print(f"hull: largest error of a line {100.0 * summary['worst_line_of_hull']:.2g} %")
    for note in summary["notes"]:
        print(f"!! {note}")
    print("\n" + "\n".join(str(path) for path in written))
    return cli.OK
