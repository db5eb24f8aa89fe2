"""Options and default folders that the commands share."""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
WHICH_RUN = "A run's folder or MCAP file, its id, its campaign (the newest run of it), or 'last'."
Run = Annotated[Path, typer.Argument(help=WHICH_RUN)]
Runs = Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")]
RUNS: Path = Path("runs")
TASK_HELP = "Campaign or session: file (YAML), or the name of a shipped one."
WIRED_RIG_HELP = "Rig with wiring: file (YAML), or the name of a shipped rig."
Rig = Annotated[
    Path | None,
    typer.Option("--rig", help="Rig file (YAML) or shipped rig, replaces that of the file."),
]
Realtime = Annotated[
    bool, typer.Option("--realtime", help="Use the real clock, not the fastest possible pace.")
]
Sim = Annotated[
    bool, typer.Option("--sim", help="Emulate the devices at the far end of the rig's wires.")
]
Interpreted = Annotated[
    bool, typer.Option("--interpreted", help="Run the tick as plain Python, never compiled.")
]
WithPage = Annotated[
    bool, typer.Option("--page", help="Serve the operator's page, too, and print its address.")
]
CALIBRATIONS = Path("configs/calibrations")


def calibrations_folder(folder: Path) -> Path:
    """Return the folder of calibration files; the shipped one where the default does not exist."""
    if folder != CALIBRATIONS or folder.exists():
        return folder
    from rig.config.shipped_files import shipped_folder

    return shipped_folder() / "calibrations"


Calibrations = Annotated[
    Path,
    typer.Option(
        "--calibrations",
        callback=calibrations_folder,
        help="Folder of calibration files; where the default does not exist, the shipped ones.",
    ),
]
OutputFolder = Annotated[
    Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
]
_READ_BY = "Apply this calibration: NAME, NAME@VERSION or a file; one per quantity."
ReadBy = Annotated[list[str] | None, typer.Option("--calibration", help=_READ_BY)]

IncompleteRows = Annotated[
    bool,
    typer.Option("--incomplete-rows", help="Include means of rows whose record lacks ticks."),
]
