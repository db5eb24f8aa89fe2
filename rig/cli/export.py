"""`rig export RUN --as mat|netcdf|csv`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.input_files import find_run, run_folder
from rig.cli.options import RUNS, Json, Run, Runs
from rig.cli.output import OK, input_errors, print_json
from rig.interop import tables
from rig.kinds.registry import optional_rooms
from rig.recording.runs import run_info


class ExportFormat(StrEnum):
    """File format of an exported run."""

    MAT = "mat"
    NETCDF = "netcdf"
    CSV = "csv"


SUFFIX = {ExportFormat.MAT: ".mat", ExportFormat.NETCDF: ".nc", ExportFormat.CSV: ".csv"}


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
            help="Rate, Hz; must divide the run's rate (default for mat: 200; else every tick).",
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write (default: in the run).")
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Export a run for other tools."""
    remarks: tuple[str, ...] = ()
    with input_errors("export", as_json=as_json):
        record = find_run(run, runs)
        path = output or run_folder(record) / f"{run_info(record).run}{SUFFIX[form]}"
        if form is ExportFormat.MAT:
            if fields or rows:
                raise ValueError(
                    "--field and --row work with netcdf and csv only; a format of a kind holds all "
                    "fields and rows"
                )
            remarks = _format_of_a_kind(form)(record, rate, path)
        else:
            selected = fields or (tables.csv_fields(record) if form is ExportFormat.CSV else ())
            table = tables.export_table(record, selected, rows or (), rate)
            write = tables.write_csv if form is ExportFormat.CSV else tables.write_netcdf
            write(table, path)
            remarks = tuple(filter(None, [table.attrs.get(tables.INCOMPLETE_ATTRIBUTE, "")]))
    if as_json:
        return print_json({"written": str(path), "remarks": remarks})
    print(path)
    for remark in remarks:
        print(f"  {remark}")
    return OK


def _format_of_a_kind(form: ExportFormat) -> Any:
    """Return the function of the first kind with a format; ValueError without one."""
    for room in optional_rooms("exports"):
        if form in room.FORMATS:
            return room.FORMATS[form]
    raise ValueError(f"--as {form}: no kind of rig on this host has this format")
