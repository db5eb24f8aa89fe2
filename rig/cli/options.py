"""What the commands share: options, where runs are kept, exit codes."""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
WHICH_RUN = "A run's folder or MCAP file, its id, its campaign (the newest run of it), or 'last'."
Run = Annotated[Path, typer.Argument(help=WHICH_RUN)]
Runs = Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")]
RUNS: Path = Path("runs")
Rig = Annotated[
    Path | None, typer.Option("--rig", help="Rig file (YAML) in place of the campaign's own.")
]
Sim = Annotated[
    bool, typer.Option("--sim", help="Emulated devices on the far end of the rig's wires.")
]
_READ_BY = "Read the run by this calibration: NAME, NAME@VERSION or file; one a quantity."
ReadBy = Annotated[list[str] | None, typer.Option("--calibration", help=_READ_BY)]

CODES = OK, FAILED, BAD_INPUT, STOPPED, FAULT, LOST = 0, 1, 2, 3, 4, 5
IncompleteRows = Annotated[
    bool,
    typer.Option(
        "--incomplete-rows", help="Also the means of rows of which the record lacks ticks."
    ),
]
