"""`rig twin RUNS`: the plant file of a device as measured."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Runs

_RUNS = (
    "A run's folder, MCAP file, id, campaign, or 'last': one in calm water with an open-loop "
    "reference; then, where there are any, runs in waves and wave calibrations."
)
PLANT_HELP = "Plant file to take from what no run tells (default: the one the first run names)."
PROBE_HELP = "Probe of a wave calibration that stood at the device's place."


def command(
    named: Annotated[list[Path], typer.Argument(metavar="RUNS...", help=_RUNS)],
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
    """Turn what runs have measured into a plant file for rehearsals, checks and sweeps.

    A campaign runs on it with the key `plant: TWIN/plant.yaml`.
    """
    sys.exit(main(named, runs, output, plant, probe, incomplete_rows=incomplete_rows, as_json=json))


def main(
    named: list[Path],
    runs: Path,
    output: Path | None,
    plant: Path | None,
    probe: str,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Identify, write the twin, say what it is made of."""
    from rig import cli
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.identification.twin import plant_file
    from rig.identification.twin.estimate import twin

    try:
        paths = [find_run(each, runs) for each in named]
        found = twin(paths, plant, probe, incomplete_rows=incomplete_rows)
        first = paths[0] if paths[0].is_dir() else paths[0].parent
        written = plant_file.write(found, output or first / plant_file.FOLDER)
    except REFUSED as error:
        return refuse("twin", error, as_json=as_json)
    told = plant_file.as_dict(found)
    if as_json:
        print(json.dumps({**told, "written": [str(path) for path in written]}))
        return cli.OK
    rows = [("estimate", "value", "±1 s.d.", "from")]
    rows += [
        (name, f"{one['value']:.6g}", f"{one['deviation']:.2g}", one["source"])
        for name, one in told["estimates"].items()
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    for name, value, deviation, source in rows:
        print(f"{name:{widths[0]}}  {value:>{widths[1]}}  {deviation:>{widths[2]}}  {source}")
    print(f"hull: worst line {100.0 * told['worst_line_of_hull']:.2g} % off")
    for note in told["notes"]:
        print(f"!! {note}")
    print("\n" + "\n".join(str(path) for path in written))
    return cli.OK
