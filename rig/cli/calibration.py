"""`rig calibration list|show|apply|diff`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

FOLDER = Path("configs/calibrations")

app = typer.Typer(
    name="calibration",
    no_args_is_help=True,
    help="Versioned corrections of recorded values: what they are, what they change.",
)

Folder = Annotated[Path, typer.Option("--calibrations", help="Folder of calibration files.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Named = Annotated[str, typer.Argument(help="NAME, NAME@VERSION, or a calibration file.")]
TestLog = Annotated[Path | None, typer.Option("--testlog", help="Test log (xlsx).")]


@app.command("list")
def list_command(folder: Folder = FOLDER, json: Json = False) -> None:
    """List all calibrations with their versions; the newest of each counts."""
    from rig.cli.calibration_commands import list_all

    sys.exit(list_all(folder, as_json=json))


@app.command()
def show(named: Named, folder: Folder = FOLDER, json: Json = False) -> None:
    """Show one version of a calibration and the versions before it."""
    from rig.cli.calibration_commands import show as main

    sys.exit(main(named, folder, as_json=json))


@app.command()
def apply(
    named: Named,
    values: Annotated[
        list[float] | None, typer.Option("--value", "-x", help="Recorded value; repeatable.")
    ] = None,
    run: Annotated[
        str | None, typer.Option("--run", help="Run it was recorded in: 24 or MASK4_024.")
    ] = None,
    date: Annotated[
        str | None, typer.Option("--date", help="Day (UTC) it was recorded on: 2023-09-26.")
    ] = None,
    invert: Annotated[
        bool, typer.Option("--invert", help="From corrected to recorded values.")
    ] = False,
    testlog: TestLog = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="CSV to write with --testlog.")
    ] = None,
    folder: Folder = FOLDER,
    json: Json = False,
) -> None:
    """Correct values, or all values of a test log; the record itself is never rewritten."""
    from rig.cli.calibration_commands import apply_to_log, apply_to_values

    if testlog is not None:
        sys.exit(apply_to_log(named, folder, testlog, output, as_json=json))
    when = (run, date)
    sys.exit(apply_to_values(named, folder, values or [], when, invert=invert, as_json=json))


@app.command()
def diff(
    old: Named,
    new: Named,
    testlog: TestLog = None,
    runs: Annotated[
        Path | None, typer.Option("--runs", help="Folder of runs to look through.")
    ] = None,
    folder: Folder = FOLDER,
    json: Json = False,
) -> None:
    """Say what a changed calibration changes: runs, rows, values, and what is to be made anew."""
    from rig.cli.calibration_commands import diff as main

    sys.exit(main(old, new, testlog, runs, folder, as_json=json))
