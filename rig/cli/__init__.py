"""The command line: one file per command. Heavy imports happen inside the commands."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli import (  # fmt: skip
    calibration,
    compare,
    export,
    identify,
    import_run,
    matrix,
    merge,
    options,
    recommend,
    replay,
    scan,
    spring_map,
    surge_damping,
    sweep,
    testlog,
    twin,
    twoport,
)
from rig.cli.interrupts import InterruptibleGroup
from rig.cli.options import (  # fmt: skip
    CAMPAIGN_HELP,
    RUNS,
    WIRED_RIG_HELP,
    IncompleteRows,
    Json,
    ReadBy,
    Rig,
    Run,
    Runs,
    Sim,
)

OK, FAILED, BAD_INPUT, STOPPED, FAULT, LOST = options.CODES

__all__ = ["BAD_INPUT", "FAILED", "FAULT", "LOST", "OK", "STOPPED", "app"]


app = typer.Typer(
    name="rig",
    cls=InterruptibleGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Run wave-energy test rigs: campaigns, rehearsals, and the analysis of their results.",
)

_RUN_CODES = """\
Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig \
requires; 2 bad input; 3 stopped by the operator; 4 the rig tripped; 5 a process died or rows \
were lost."""


@app.command(epilog=_RUN_CODES)
def run(
    campaign: Annotated[Path, typer.Argument(help=CAMPAIGN_HELP)],
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Use the real clock, not the fastest possible pace.")
    ] = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run a campaign and draw its power surfaces.

    A rig file without wiring runs as a rehearsal on the simulated plant. A
    rig file with wiring runs on the rig's devices.
    """
    from rig.cli.run import RunOptions, main

    sys.exit(main(campaign, runs, RunOptions(rig, realtime, sim), as_json=json))


@app.command(epilog=_RUN_CODES)
def bench(
    session: Annotated[
        Path, typer.Argument(help="Session file (YAML), or the name of a shipped session.")
    ],
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Use the real clock, not the fastest possible pace.")
    ] = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run a session of the OSWEC bench, analyse it, and write its report and calibration file.

    A bench file without wiring runs as a rehearsal. A bench file with wiring
    runs on the bench's devices.
    """
    from rig.cli.bench import BenchOptions, main

    sys.exit(main(session, runs, BenchOptions(rig, realtime, sim), as_json=json))


@app.command()
def check(
    campaign: Annotated[
        Path,
        typer.Argument(help="Campaign or session: file (YAML), or the name of a shipped one."),
    ],
    rows: Annotated[
        bool, typer.Option("--rows", help="Show every row, not only those nearest to a limit.")
    ] = False,
    rig: Rig = None,
    json: Json = False,
) -> None:
    """Check a campaign or session: list every error, or describe the planned run.

    For a campaign, the report also predicts motion, current and power of
    each row.
    """
    from rig.cli.check import main

    sys.exit(main(campaign, rig, every_row=rows, as_json=json))


_SIM_CODES = """\
Exit codes: 0 ended by Ctrl-C; 1 an address is in use, or the devices failed; 2 bad input."""


@app.command(epilog=_SIM_CODES)
def sim(
    rig: Annotated[Path, typer.Argument(help=WIRED_RIG_HELP)],
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", help="Campaign that defines the sea (default: calm water)."),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one line of JSON when ready.")
    ] = False,
) -> None:
    """Emulate the devices of a wired rig, at the addresses of its rig file, until Ctrl-C."""
    from rig.cli.sim import main

    sys.exit(main(rig, campaign, as_json=json))


_DEVICES_CODES = """\
Exit codes: 0 all devices answer and agree with the rig file; 1 a device does not, or one of the \
rig's wires is in use; 2 bad input."""


@app.command(epilog=_DEVICES_CODES)
def devices(
    rig: Annotated[Path, typer.Argument(help=WIRED_RIG_HELP)],
    objects: Annotated[
        bool, typer.Option("--objects", help="Also list every object that a run will set.")
    ] = False,
    listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; works while a run uses the rig.")
    ] = False,
    json: Json = False,
) -> None:
    """List the devices that answer on a rig's wires, and check their settings. It only reads."""
    from rig.cli.devices import main

    sys.exit(main(rig, only_listen=listen, objects=objects, as_json=json))


_DOCTOR_CODES = """\
Exit codes: 0 fit for real time on a rig (with --rehearsal: for a rehearsal); 1 not fit, the \
verdict names the reasons; 2 bad input."""


@app.command(epilog=_DOCTOR_CODES)
def doctor(
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=3600, help="Time to measure wake-ups, s.")
    ] = 35.0,
    rehearsal: Annotated[
        bool, typer.Option("--rehearsal", help="Judge fitness for rehearsals only (exit code).")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate", min=10, max=10_000, help="Loop rate, Hz (default: the rig file's, or 1000)."
        ),
    ] = None,
    hours: Annotated[
        float, typer.Option("--hours", min=0, max=1000, help="Hours of log that must fit on disk.")
    ] = 8.0,
    rig: Annotated[
        Path | None, typer.Option("--rig", help="Rig file: also check what its wires need.")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Check whether this host is fit for real time on a rig; give advice where it is not."""
    from rig.cli.doctor import main

    sys.exit(main(runs, seconds, rate, hours, rehearsal=rehearsal, as_json=json, rig=rig))


_RECOVER_CODES = """\
Exit codes: 0 the record is finished and holds every executed tick; 5 it is finished, but ticks \
are lost or damaged, or no process recorded whether more ticks followed; 1 not done: the run is \
still being written, the disk is full, or the new file could not be read back; 2 no such run, or \
no readable data in it."""


@app.command(epilog=_RECOVER_CODES)
def recover(
    run: Annotated[Path, typer.Argument(help="A run's folder or MCAP file, its id, or 'last'.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write (default: run.mcap in the run)."),
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Finish the record of a run that was killed, and list exactly which ticks are missing.

    The files that the crash left stay unchanged. The command reads the new
    file back with the stock MCAP library.
    """
    from rig.cli.recover import main

    sys.exit(main(run, runs, output, as_json=json))


@app.command()
def campaigns(json: Json = False) -> None:
    """List the shipped campaigns, bench sessions and rigs, whose names stand for their files."""
    from rig.cli.campaigns import main

    sys.exit(main(as_json=json))


@app.command()
def copy(
    name: Annotated[
        str, typer.Argument(help="Shipped campaign, session or rig; see `rig campaigns`.")
    ],
    to: Annotated[Path, typer.Option("--to", help="Folder to write to.")] = Path(),
    keep_existing: Annotated[
        bool, typer.Option("--keep-existing", help="Leave files that exist as they are.")
    ] = False,
    json: Json = False,
) -> None:
    """Copy a shipped campaign, session or rig, and all files that it refers to, for editing.

    The files keep their folders (campaigns, rigs, limits, plants), so that
    they refer to each other. The command never overwrites a file.
    """
    from rig.cli.copy_command import main

    sys.exit(main(name, to, keep_existing=keep_existing, as_json=json))


@app.command("runs")
def list_runs(runs: Runs = RUNS, json: Json = False) -> None:
    """List all runs, newest first."""
    from rig.cli.runs import main

    sys.exit(main(runs, as_json=json))


@app.command()
def laws(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Files of laws (.py); default: registered laws.")
    ] = None,
    json: Json = False,
) -> None:
    """List the control laws: columns of the matrix, parameters, ranges."""
    from rig.cli.laws import main

    sys.exit(main(files or [], as_json=json))


@app.command()
def kinds(json: Json = False) -> None:
    """List the kinds of rig, with origin and version."""
    from rig.cli.kinds import main

    sys.exit(main(as_json=json))


@app.command()
def show(
    run: Run,
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Show how a run went and the summary of its results."""
    from rig.cli.show import main

    calibrations = calibration or []
    sys.exit(main(run, runs, calibrations, incomplete_rows=incomplete_rows, as_json=json))


@app.command()
def plot(
    run: Run,
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", "-f", help="Log field or pattern to draw over time; repeatable."),
    ] = None,
    rows: Annotated[
        list[int] | None,
        typer.Option("--row", "-r", help="Draw only this campaign row; repeatable."),
    ] = None,
    surface: Annotated[
        tuple[str, str] | None,
        typer.Option("--surface", metavar="X Y", help="Draw sliced power over these two columns."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(
            help="Column to slice at each station's optimum (the default for every column that is "
            "not an axis); COLUMN=VALUE (SI) slices it at that value; repeatable."
        ),
    ] = None,
    station: Annotated[
        list[str] | None,
        typer.Option(help="Station of a surface: mechanical, shaft, ac, dc; repeatable."),
    ] = None,
    sort: Annotated[
        str | None,
        typer.Option(help="Draw bars of all rows and settings, in order of 'run' or 'power'."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="PNG to write (default: in the run).")
    ] = None,
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Draw a run: surfaces and summary, one surface, bars, or log fields over time."""
    from rig.cli.plot import PlotOptions, main

    options = PlotOptions(
        fields or [], rows or [], surface, left_out or [], station or [], sort, output,
        calibration or [], incomplete_rows,
    )  # fmt: skip
    sys.exit(main(run, runs, options, as_json=json))


app.command("compare")(compare.command)
app.command("identify")(identify.command)
app.command("matrix")(matrix.command)
app.command("recommend")(recommend.command)
app.command("replay", epilog=replay.EXIT_CODES)(replay.command)
app.command("spring-map")(spring_map.command)
app.command("surge-damping", epilog=surge_damping.EXIT_CODES)(surge_damping.command)
app.command("sweep", epilog=sweep.EXIT_CODES)(sweep.command)
app.command("testlog")(testlog.command)
app.command("twin")(twin.command)
app.command("twoport")(twoport.command)
app.command("export")(export.command)
app.command("import")(import_run.command)
app.command("merge", epilog=merge.EXIT_CODES)(merge.command)
app.add_typer(calibration.app)
app.add_typer(scan.app)
