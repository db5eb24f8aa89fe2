"""`rig export RUN --as mat|netcdf|csv`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.api.export import ExportFormat, export_run
from rig.cli.input_files import find_run
from rig.cli.options import RUNS, Json, Run, Runs
from rig.cli.output import OK, input_errors, print_json


def command(
    run: Run,
    form: Annotated[
        ExportFormat,
        typer.Option(
            "--as", help="mat: MATLAB structure of a kind's test; netcdf: xarray, MHKiT; csv."
        ),
    ],
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", "-f", help="Log field or pattern (netcdf, csv); repeatable."),
    ] = None,
    rows: Annotated[
        list[int] | None,
        typer.Option("--row", "-r", help="Export only this campaign row; repeatable."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            help="Rate, Hz; must divide the run's (default for mat: 200, for csv: 100, for netcdf: "
            "every tick).",
        ),
    ] = None,
    every_tick: Annotated[
        bool, typer.Option("--every-tick", help="Export at the run's own rate.")
    ] = False,
    for_scripts: Annotated[
        bool,
        typer.Option(
            "--for-scripts", help="Add the signals that the scripts of the test look for (mat)."
        ),
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write (default: in the run).")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Write even where the disk may have too little room.")
    ] = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Export a run for other tools."""
    with input_errors("export", as_json=as_json):
        exported = export_run(
            find_run(run, runs),
            form,
            output,
            fields=fields or (),
            rows=rows or (),
            rate=rate,
            every_tick=every_tick,
            for_scripts=for_scripts,
            force=force,
            notice=lambda text: print(f"rig export: {text}", file=sys.stderr),
        )
    if as_json:
        return print_json(
            {
                "written": str(exported.path),
                "remarks": exported.remarks,
                "estimated_bytes": exported.size.bytes,
            }
        )
    print(exported.path)
    for remark in exported.remarks:
        print(f"  {remark}")
    return OK
