"""`rig export RUN --as mat|netcdf|csv`."""

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rig.cli import options


class Form(StrEnum):
    """What a run is written as."""

    MAT = "mat"
    NETCDF = "netcdf"
    CSV = "csv"


SUFFIX = {Form.MAT: ".mat", Form.NETCDF: ".nc", Form.CSV: ".csv"}


def command(
    run: options.Run,
    form: Annotated[
        Form,
        typer.Option("--as", help="mat: the MASK4 structure; netcdf: xarray, MHKiT; csv."),
    ],
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", "-f", help="Log field or pattern (netcdf, csv); repeatable."),
    ] = None,
    rows: Annotated[
        list[int] | None, typer.Option("--row", "-r", help="Only this campaign row; repeatable.")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(min=0.1, help="Hz; must divide the run's (mat: 200; others: every tick)."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write (default: in the run).")
    ] = None,
    runs: options.Runs = options.RUNS,
    as_json: options.Json = False,
) -> None:
    """Write a run for other tools."""
    sys.exit(main(run, runs, form, fields or [], rows or [], rate, output, as_json=as_json))


def main(
    named: Path,
    runs: Path,
    form: Form,
    fields: list[str],
    rows: list[int],
    rate: float | None,
    output: Path | None,
    *,
    as_json: bool,
) -> int:
    """Write a run as another tool's file and say which."""
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.recording.runs.folder import facts

    remarks: tuple[str, ...] = ()
    try:
        run = find_run(named, runs)
        folder = run if run.is_dir() else run.parent
        path = output or folder / f"{facts(run).run}{SUFFIX[form]}"
        if form is Form.MAT:
            remarks = _mat(run, path, fields, rows, rate)
        else:
            from rig.interop.exchange import tables

            wanted = fields or (list(tables.CSV_FIELDS) if form is Form.CSV else [])
            made = tables.table(run, wanted, rows, rate)
            write = tables.write_csv if form is Form.CSV else tables.write_netcdf
            write(made, path)
            remarks = tuple(filter(None, [made.attrs.get(tables.LACKING, "")]))
    except REFUSED as error:
        return refuse("export", error, as_json=as_json)
    if as_json:
        print(json.dumps({"written": str(path), "remarks": list(remarks)}))
    else:
        print(path)
        for remark in remarks:
            print(f"  {remark}")
    return options.OK


def _mat(
    run: Path, path: Path, fields: list[str], rows: list[int], rate: float | None
) -> tuple[str, ...]:
    from rig.interop.exchange.mask4_export import structure, write_mat
    from rig.interop.exchange.mask4_fields import RATE

    if fields or rows:
        raise ValueError("--field and --row are for netcdf and csv; the structure is whole")
    exported = structure(run, rate or RATE)
    write_mat(exported, path)
    return exported.remarks
