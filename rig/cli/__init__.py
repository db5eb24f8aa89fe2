"""The command line: one file a command; heavy imports happen inside the commands."""

import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="rig",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Run wave-energy test rigs: campaigns, rehearsals, and what comes out of them.",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
_RUN = "A run's folder or MCAP file, its id, its campaign (the newest run of it), or 'last'."
Run = Annotated[Path, typer.Argument(help=_RUN)]
Runs = Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")]
RUNS = Path("runs")

OK, FAILED, BAD_INPUT, STOPPED, FAULT, LOST = 0, 1, 2, 3, 4, 5

_CODES = """Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig
requires; 2 bad input; 3 stopped by the operator; 4 the rig tripped; 5 a process died or rows were
lost."""


@app.command(epilog=_CODES)
def run(
    campaign: Annotated[Path, typer.Argument(help="Campaign file (YAML).")],
    realtime: Annotated[
        bool, typer.Option("--realtime", help="On the real clock instead of as fast as it goes.")
    ] = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run a campaign: rehearse it on the simulated plant and make its power surfaces."""
    from rig.cli.run import main

    sys.exit(main(campaign, runs, realtime=realtime, as_json=json))


@app.command()
def check(
    campaign: Annotated[Path, typer.Argument(help="Campaign file (YAML).")], json: Json = False
) -> None:
    """Say everything that is wrong with a campaign, or what it will do and how long it takes."""
    from rig.cli.check import main

    sys.exit(main(campaign, as_json=json))


@app.command("runs")
def list_runs(runs: Runs = RUNS, json: Json = False) -> None:
    """List the runs there are, newest first."""
    from rig.cli.runs import main

    sys.exit(main(runs, as_json=json))


@app.command()
def show(
    run: Run,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Show what a run was and what came out of it."""
    from rig.cli.show import main

    sys.exit(main(run, runs, as_json=json))


@app.command()
def plot(
    run: Run,
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", "-f", help="Log field or pattern to draw over time; repeatable."),
    ] = None,
    rows: Annotated[
        list[int] | None, typer.Option("--row", "-r", help="Only this campaign row; repeatable.")
    ] = None,
    surface: Annotated[
        tuple[str, str] | None,
        typer.Option("--surface", metavar="X Y", help="Power over these two columns, sliced."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(
            help="Column to slice at each station's optimum, as all that are not named; "
            "COLUMN=VALUE (SI) holds it there; repeatable."
        ),
    ] = None,
    station: Annotated[
        list[str] | None,
        typer.Option(help="Station of a surface: mechanical, shaft, ac, dc; repeatable."),
    ] = None,
    sort: Annotated[
        str | None, typer.Option(help="Bars of all rows and settings: as 'run' or by 'power'.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="PNG to write (default: in the run).")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Draw a run again: surfaces and summary, one surface, bars, or log fields over time."""
    from rig.cli.plot import Asked, main

    asked = Asked(fields or [], rows or [], surface, left_out or [], station or [], sort, output)
    sys.exit(main(run, runs, asked, as_json=json))


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help=_RUN)],
    b: Annotated[Path, typer.Argument(help="The run to compare with it.")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): how far matched set points may be apart."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): where the picture's left-out column stands."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="PNG to write, a CSV beside it (default: in run B)."),
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Compare two runs of one matrix: settings that differ, then power point by point, B less A."""
    from rig.cli.compare import main

    sys.exit(main(a, b, runs, tolerance or [], left_out or [], output, as_json=json))
