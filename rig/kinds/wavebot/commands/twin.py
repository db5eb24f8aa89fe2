"""`rig twin RUNS`: a plant file from measurements of a device."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import find_run_of_kind, run_folder
from rig.cli.options import RUNS, IncompleteRows, Json, Runs
from rig.cli.output import input_errors, print_result
from rig.kinds.wavebot.commands import KIND
from rig.kinds.wavebot.twin import plant_file
from rig.kinds.wavebot.twin.estimate import identify_twin
from rig.presentation.phrases import aligned

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
    as_json: Json = False,
) -> int:
    """Write a plant file, identified from runs, for rehearsals, checks and sweeps.

    A campaign uses it with the key `plant: TWIN/plant.yaml`.
    """
    with input_errors("twin", as_json=as_json):
        paths = [find_run_of_kind(KIND, name, runs) for name in run_names]
        estimate = identify_twin(paths, plant, probe, incomplete_rows=incomplete_rows)
        written = plant_file.write(estimate, output or run_folder(paths[0]) / plant_file.FOLDER)
    summary = plant_file.as_dict(estimate)
    rows = [("estimate", "value", "±1 s.d.", "from")]
    rows += [
        (name, f"{item['value']:.6g}", f"{item['deviation']:.2g}", item["source"])
        for name, item in summary["estimates"].items()
    ]
    lines = [line[2:] for line in aligned(rows, lambda column, cell: column in (1, 2))]
    lines.append(f"hull: largest error of a line {100.0 * summary['worst_line_of_hull']:.2g} %")
    lines += [f"!! {note}" for note in summary["notes"]]
    return print_result(summary, "\n".join(lines), written, as_json=as_json)
