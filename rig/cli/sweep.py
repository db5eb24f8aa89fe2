"""`rig sweep CAMPAIGN --over KEY=V1,V2,...`."""

import os
import re
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import CAMPAIGN_HELP, RUNS, Json, Runs

EXIT_CODES = """\
Exit codes: 0 every case gave its rows; 1 some cases could not run, or the result could not be \
written; 2 bad input; 3 interrupted (run the same command again to continue)."""
_ADDRESS = r"(tcp|tls)://[^/\s]+:\d{1,5}"


def command(
    campaign: Annotated[Path, typer.Argument(help=CAMPAIGN_HELP)],
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=V1,V2,...",
            help="Values of a campaign key (sea.hs_m), or of rig.KEY, plant.KEY, limits.KEY; "
            "repeatable.",
        ),
    ] = None,
    sequential: Annotated[
        bool, typer.Option("--sequential", help="Run the rows in sequence, as in the basin.")
    ] = False,
    lead_in: Annotated[
        float | None,
        typer.Option("--lead-in", min=5, max=3600, help="Waves before each row, s (default: 15)."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", min=1, max=1024, help="Threads (default: one per core)."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="Run on a Dask cluster."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="NetCDF to write (default: sweep.nc in its folder)."),
    ] = None,
    measured: Annotated[
        Path | None, typer.Option("--measured", metavar="RUN", help="Run to draw over the result.")
    ] = None,
    sweeps: Annotated[Path, typer.Option("--sweeps", help="Folder that holds the sweeps.")] = Path(
        "sweeps"
    ),
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Simulate a campaign's rows for all values of some parameters, with the compiled plant.

    Each row is a case of its own, on all cores or on a cluster. The command
    keeps finished cases and never runs them again.
    """
    # The cases use all cores; further threads of BLAS would spin and slow them down.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from rig.cli.sweep_run import SweepOptions, main  # numpy

    if jobs is not None and scheduler is not None:
        raise typer.BadParameter(
            "--jobs sets the threads of this machine; leave it out with --scheduler"
        )
    if scheduler is not None and not re.fullmatch(_ADDRESS, scheduler):
        raise typer.BadParameter(f"--scheduler {scheduler}: no address; write tcp://HOST:PORT")
    if out is not None:
        _check_out(out)
    options = SweepOptions(
        over or [], sequential, lead_in, jobs, scheduler, out, measured, sweeps, runs
    )
    return main(campaign, options, as_json=as_json)


def _check_out(out: Path) -> None:
    """Check that the result can be written to ``out``, before hours of work instead of after."""
    if out.suffix != ".nc":
        raise typer.BadParameter(f"--out {out}: the result is NetCDF; give a name ending in .nc")
    if out.is_dir():
        raise typer.BadParameter(f"--out {out}: is a folder; name a file in it")
    if not out.parent.is_dir():
        raise typer.BadParameter(f"--out {out}: there is no folder {out.parent}; make it first")
