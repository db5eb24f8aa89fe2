"""`rig sweep CAMPAIGN --over KEY=V1,V2,...`."""

import os
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

CODES = """\
Exit codes: 0 every case gave its rows; 1 some could not be run, or the result could not be \
written; 2 bad input; 3 interrupted, the same command goes on where it was."""
_ADDRESS = r"(tcp|tls)://[^/\s]+:\d{1,5}"


def command(
    campaign: Annotated[Path, typer.Argument(help="Campaign file (YAML).")],
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="KEY=V1,V2,...",
            help="A key of the campaign (sea.hs_m), or rig.KEY, plant.KEY, limits.KEY; repeatable.",
        ),
    ] = None,
    sequential: Annotated[
        bool, typer.Option("--sequential", help="The campaign row after row, as in the basin.")
    ] = False,
    lead_in: Annotated[
        float | None,
        typer.Option("--lead-in", min=5, max=3600, help="Waves before each row, s (15)."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, max=1024, help="Threads (one a core).")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="Run them on a Dask cluster."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="NetCDF to write (sweep.nc in the folder).")
    ] = None,
    measured: Annotated[
        Path | None, typer.Option("--measured", metavar="RUN", help="Run to draw on top.")
    ] = None,
    sweeps: Annotated[Path, typer.Option("--sweeps", help="Folder that holds the sweeps.")] = Path(
        "sweeps"
    ),
    runs: Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")] = Path(
        "runs"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Run a campaign's rows on the simulated plant, compiled, for all values of some parameters.

    Rows are cases of their own, on all cores, or on a cluster. What is finished is kept and never
    run again.
    """
    # The cases have the cores; threads of BLAS beside them wait for each other, busily.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from rig.cli.sweep_run import SweepOptions, main

    if jobs is not None and scheduler is not None:
        raise typer.BadParameter("--jobs is about this machine; with --scheduler its workers count")
    if scheduler is not None and not re.fullmatch(_ADDRESS, scheduler):
        raise typer.BadParameter(f"--scheduler {scheduler}: no address; allowed tcp://HOST:PORT")
    if out is not None:
        _check_out(out)
    wanted = SweepOptions(
        over or [], sequential, lead_in, jobs, scheduler, out, measured, sweeps, runs
    )
    sys.exit(main(campaign, wanted, as_json=json))


def _check_out(out: Path) -> None:
    """That the result can be written there is said before hours of work, not after."""
    if out.suffix != ".nc":
        raise typer.BadParameter(f"--out {out}: the result is NetCDF; allowed a name ending in .nc")
    if out.is_dir():
        raise typer.BadParameter(f"--out {out}: is a folder; allowed a file in it")
    if not out.parent.is_dir():
        raise typer.BadParameter(f"--out {out}: there is no folder {out.parent}")
