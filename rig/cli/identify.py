"""Options of `rig identify`; `rig.cli.identify_command` implements it."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import IncompleteRows

_RUN = (
    "A run's folder, MCAP file, id, campaign, or 'last'. Give several to combine runs in calm "
    "water, in waves, and of the waves without the device."
)
_RUNS = "Folder that holds the runs."


def command(
    run_names: Annotated[list[Path] | None, typer.Argument(metavar="[RUNS]...", help=_RUN)] = None,
    compare: Annotated[
        tuple[Path, Path] | None,
        typer.Option(metavar="A B", help="Compare two identifications: JSON files or runs."),
    ] = None,
    order: Annotated[
        int, typer.Option(help="Order of the parametric models: 2, or also 4, 6 or 8.")
    ] = 2,
    probe: Annotated[
        str, typer.Option(help="Probe of the wave calibration at the position of the device.")
    ] = "",
    bem: Annotated[
        Path | None, typer.Option(help="BEM file to compare with (.npz, or .nc of capytaine).")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="Also draw the figures and the page.")] = True,
    incomplete_rows: IncompleteRows = False,
    runs: Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")] = Path(
        "runs"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Identify impedances and wave excitation from runs with an open-loop reference."""
    from rig.cli import identify_command

    options = identify_command.IdentifyOptions(order, probe, bem, output, pictures, incomplete_rows)
    if compare is None:
        sys.exit(identify_command.main(run_names or [], runs, options, as_json=json))
    if run_names:
        raise typer.BadParameter("--compare takes two identifications; leave out RUNS")
    sys.exit(identify_command.compare(compare, runs, output, as_json=json))
