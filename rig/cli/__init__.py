"""The command line: one file a command; heavy imports happen inside the commands."""

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
from rig.cli.interrupts import Interruptible
from rig.cli.options import RUNS, IncompleteRows, Json, ReadBy, Rig, Run, Runs, Sim

OK, FAILED, BAD_INPUT, STOPPED, FAULT, LOST = options.CODES

__all__ = ["BAD_INPUT", "FAILED", "FAULT", "LOST", "OK", "STOPPED", "app"]


app = typer.Typer(
    name="rig",
    cls=Interruptible,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Run wave-energy test rigs: campaigns, rehearsals, and what comes out of them.",
)

_CODES = """\
Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig \
requires; 2 bad input; 3 stopped by the operator; 4 the rig tripped; 5 a process died or rows \
were lost."""


@app.command(epilog=_CODES)
def run(
    campaign: Annotated[Path, typer.Argument(help="Campaign file (YAML).")],
    realtime: Annotated[
        bool, typer.Option("--realtime", help="On the real clock instead of as fast as it goes.")
    ] = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run a campaign and make its power surfaces.

    A rig without wiring is rehearsed on the simulated plant; one with wiring is run on its devices.
    """
    from rig.cli.run import RunOptions, main

    sys.exit(main(campaign, runs, RunOptions(rig, realtime, sim), as_json=json))


@app.command(epilog=_CODES)
def bench(
    session: Annotated[Path, typer.Argument(help="Session file (YAML).")],
    realtime: Annotated[
        bool, typer.Option("--realtime", help="On the real clock instead of as fast as it goes.")
    ] = False,
    rig: Rig = None,
    sim: Sim = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Run a session of the OSWEC bench, analyse it, and write its report and calibration file.

    A bench without wiring is rehearsed; one with wiring is run on its devices.
    """
    from rig.cli.bench import BenchOptions, main

    sys.exit(main(session, runs, BenchOptions(rig, realtime, sim), as_json=json))


@app.command()
def check(
    campaign: Annotated[Path, typer.Argument(help="Campaign or session file (YAML).")],
    rows: Annotated[
        bool, typer.Option("--rows", help="Every row, not only those nearest to a limit.")
    ] = False,
    rig: Rig = None,
    json: Json = False,
) -> None:
    """Say everything that is wrong with a campaign or session, or what it will do.

    Of a campaign also what each of its rows is predicted to do.
    """
    from rig.cli.check import main

    sys.exit(main(campaign, rig, every_row=rows, as_json=json))


_SIM = """\
Exit codes: 0 ended by Ctrl-C; 1 an address is taken, or the devices failed; 2 bad input."""


@app.command(epilog=_SIM)
def sim(
    rig: Annotated[Path, typer.Argument(help="Rig file (YAML) with wiring.")],
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="Campaign whose sea it is; else calm water.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="One line of JSON when ready.")] = False,
) -> None:
    """Be the devices of a wired rig, emulated, at the addresses of its rig file, until Ctrl-C."""
    from rig.cli.sim import main

    sys.exit(main(rig, campaign, as_json=json))


_DEVICES = """\
Exit codes: 0 all answer and agree with the rig file; 1 something does not, or one of its wires is \
in use; 2 bad input."""


@app.command(epilog=_DEVICES)
def devices(
    rig: Annotated[Path, typer.Argument(help="Rig file (YAML) with wiring.")],
    objects: Annotated[
        bool, typer.Option("--objects", help="Also every object that a run will set.")
    ] = False,
    listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; also while a run has the rig.")
    ] = False,
    json: Json = False,
) -> None:
    """Say who answers on a rig's wires, and whether what must stand there does. It only reads."""
    from rig.cli.devices import main

    sys.exit(main(rig, only_listen=listen, objects=objects, as_json=json))


_DOCTOR = """\
Exit codes: 0 fit for real time on a rig (with --rehearsal: for a rehearsal); 1 not fit, the \
verdict says why; 2 bad input."""


@app.command(epilog=_DOCTOR)
def doctor(
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=3600, help="How long to measure wake-ups.")
    ] = 35.0,
    rehearsal: Annotated[
        bool, typer.Option("--rehearsal", help="The exit code is about rehearsals only.")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option("--rate", min=10, max=10_000, help="Rate of the loop, Hz (the rig's, 1000)."),
    ] = None,
    hours: Annotated[
        float, typer.Option("--hours", min=0, max=1000, help="Hours of log to have room for.")
    ] = 8.0,
    rig: Annotated[
        Path | None, typer.Option("--rig", help="Rig file: also what its wires need.")
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Say whether this host is fit for real time on a rig, and what to do about it if not."""
    from rig.cli.doctor import main

    sys.exit(main(runs, seconds, rate, hours, rehearsal=rehearsal, as_json=json, rig=rig))


_RECOVER = """\
Exit codes: 0 the record is finished and holds every tick that was executed; 5 it is finished, \
but ticks are lost or damaged, or nobody saw whether more followed; 1 not done: the run is still \
being written, the disk is full, or what was written could not be read back; 2 no such run, or \
nothing in it is readable."""


@app.command(epilog=_RECOVER)
def recover(
    run: Annotated[Path, typer.Argument(help="A run's folder or MCAP file, its id, or 'last'.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write (default: run.mcap in the run)."),
    ] = None,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Finish the record of a run that was killed, and say exactly what is missing.

    What the crash left stays as it is; the new file is read back with the stock MCAP library.
    """
    from rig.cli.recover import main

    sys.exit(main(run, runs, output, as_json=json))


@app.command("runs")
def list_runs(runs: Runs = RUNS, json: Json = False) -> None:
    """List the runs there are, newest first."""
    from rig.cli.runs import main

    sys.exit(main(runs, as_json=json))


@app.command()
def show(
    run: Run,
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Show what a run was and what came out of it."""
    from rig.cli.show import main

    read_by = calibration or []
    sys.exit(main(run, runs, read_by, incomplete_rows=incomplete_rows, as_json=json))


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
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Draw a run again: surfaces and summary, one surface, bars, or log fields over time."""
    from rig.cli.plot import PlotOptions, main

    asked = PlotOptions(
        fields or [], rows or [], surface, left_out or [], station or [], sort, output,
        calibration or [], incomplete_rows,
    )  # fmt: skip
    sys.exit(main(run, runs, asked, as_json=json))


app.command("compare")(compare.command)
app.command("identify")(identify.command)
app.command("matrix")(matrix.command)
app.command("recommend")(recommend.command)
app.command("replay", epilog=replay.CODES)(replay.command)
app.command("spring-map")(spring_map.command)
app.command("surge-damping", epilog=surge_damping.CODES)(surge_damping.command)
app.command("sweep", epilog=sweep.CODES)(sweep.command)
app.command("testlog")(testlog.command)
app.command("twin")(twin.command)
app.command("twoport")(twoport.command)
app.command("export")(export.command)
app.command("import")(import_run.command)
app.command("merge", epilog=merge.CODES)(merge.command)
app.add_typer(calibration.app)
app.add_typer(scan.app)
