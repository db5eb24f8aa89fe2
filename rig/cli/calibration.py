"""`rig calibration list|show|apply|diff`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import CALIBRATIONS, Calibrations

app = typer.Typer(
    name="calibration",
    no_args_is_help=True,
    help="List, show, apply and compare versioned corrections of recorded values.",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
CalibrationName = Annotated[str, typer.Argument(help="NAME, NAME@VERSION, or a calibration file.")]
TestLog = Annotated[Path | None, typer.Option("--testlog", help="Test log (xlsx).")]


@app.command("list")
def list_command(folder: Calibrations = CALIBRATIONS, json: Json = False) -> None:
    """List all calibrations with their versions; commands use the newest version by default."""
    from rig.cli.calibration_commands import list_all

    sys.exit(list_all(folder, as_json=json))


@app.command()
def show(name: CalibrationName, folder: Calibrations = CALIBRATIONS, json: Json = False) -> None:
    """Show one version of a calibration and the versions before it."""
    from rig.cli.calibration_commands import show as main

    sys.exit(main(name, folder, as_json=json))


@app.command()
def apply(
    name: CalibrationName,
    values: Annotated[
        list[float] | None, typer.Option("--value", "-x", help="Recorded value; repeatable.")
    ] = None,
    run: Annotated[
        str | None,
        typer.Option("--run", help="Run in which the values were recorded: 24 or MASK4_024."),
    ] = None,
    date: Annotated[
        str | None,
        typer.Option("--date", help="Day (UTC) on which the values were recorded: 2023-09-26."),
    ] = None,
    invert: Annotated[
        bool, typer.Option("--invert", help="Convert corrected values back to recorded ones.")
    ] = False,
    testlog: TestLog = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="CSV to write with --testlog.")
    ] = None,
    folder: Calibrations = CALIBRATIONS,
    json: Json = False,
) -> None:
    """Correct values, or all values of a test log; the command never changes the record."""
    from rig.cli.calibration_commands import apply_to_log, apply_to_values

    if testlog is not None:
        sys.exit(apply_to_log(name, folder, testlog, output, as_json=json))
    recorded_in = (run, date)
    sys.exit(apply_to_values(name, folder, values or [], recorded_in, invert=invert, as_json=json))


@app.command()
def diff(
    old: CalibrationName,
    new: CalibrationName,
    testlog: TestLog = None,
    runs: Annotated[Path | None, typer.Option("--runs", help="Folder of runs to search.")] = None,
    folder: Calibrations = CALIBRATIONS,
    json: Json = False,
) -> None:
    """List what a new calibration version changes: runs, rows, values, and outdated products."""
    from rig.cli.calibration_commands import diff as main

    sys.exit(main(old, new, testlog, runs, folder, as_json=json))
