"""`rig export RUN --as mat|netcdf|csv`."""

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rig.cli import options


class ExportFormat(StrEnum):
    """File format of an exported run."""

    MAT = "mat"
    NETCDF = "netcdf"
    CSV = "csv"


SUFFIX = {ExportFormat.MAT: ".mat", ExportFormat.NETCDF: ".nc", ExportFormat.CSV: ".csv"}


def command(
    run: options.Run,
    form: Annotated[
        ExportFormat,
        typer.Option("--as", help="mat: the MASK4 structure; netcdf: xarray, MHKiT; csv."),
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
    runs: options.Runs = options.RUNS,
    as_json: options.Json = False,
) -> None:
    """Export a run for other tools."""
    sys.exit(main(run, runs, form, fields or [], rows or [], rate, output, as_json=as_json))


def main(
    run_name: Path,
    runs: Path,
    form: ExportFormat,
    fields: list[str],
    rows: list[int],
    rate: float | None,
    output: Path | None,
    *,
    as_json: bool,
) -> int:
    """Write a run in the given format, and print the file's path and any remarks."""
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.recording.runs.folder import run_info

    remarks: tuple[str, ...] = ()
    try:
        record = find_run(run_name, runs)
        folder = record if record.is_dir() else record.parent
        output_path = output or folder / f"{run_info(record).run}{SUFFIX[form]}"
        if form is ExportFormat.MAT:
            remarks = _write_mat(record, output_path, fields, rows, rate)
        else:
            from rig.interop import tables

            selected = fields or (list(tables.CSV_FIELDS) if form is ExportFormat.CSV else [])
            table = tables.export_table(record, selected, rows, rate)
            write = tables.write_csv if form is ExportFormat.CSV else tables.write_netcdf
            write(table, output_path)
            remarks = tuple(filter(None, [table.attrs.get(tables.INCOMPLETE_ATTRIBUTE, "")]))
    except INPUT_ERRORS as error:
        return refuse("export", error, as_json=as_json)
    if as_json:
        print(json.dumps({"written": str(output_path), "remarks": list(remarks)}))
    else:
        print(output_path)
        for remark in remarks:
            print(f"  {remark}")
    return options.OK


def _write_mat(
    run: Path, path: Path, fields: list[str], rows: list[int], rate: float | None
) -> tuple[str, ...]:
    from rig.kinds.wavebot.mask4.export import export_structure, write_mat
    from rig.kinds.wavebot.mask4.fields import SAMPLE_RATE

    if fields or rows:
        raise ValueError(
            "--field and --row work with netcdf and csv only; the MASK4 structure holds all "
            "fields and rows"
        )
    exported = export_structure(run, rate or SAMPLE_RATE)
    write_mat(exported, path)
    return exported.remarks
