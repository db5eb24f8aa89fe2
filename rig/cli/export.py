"""`rig export RUN --as mat|netcdf|csv`."""

import sys
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from rig.cli.input_files import find_run, run_folder
from rig.cli.options import RUNS, Json, Run, Runs
from rig.cli.output import OK, input_errors, print_json
from rig.interop import tables
from rig.interop.export_size import ExportSize, check_room
from rig.interop.tables import KindFormat
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
        if every_tick and rate is not None:
            raise ValueError(f"--every-tick and --rate {rate:g} exclude each other")
        record = find_run(run, runs)
        path = output or run_folder(record) / f"{run_info(record).run}{SUFFIX[form]}"
        export = Export(record, path, rate, every_tick=every_tick, force=force)
        if form is ExportFormat.MAT:
            if fields or rows:
                raise ValueError(
                    "--field and --row work with netcdf and csv only; a format of a kind holds all "
                    "fields and rows"
                )
            size, remarks = export.write_format(_format_of_a_kind(form), for_scripts=for_scripts)
        else:
            if for_scripts:
                raise ValueError(
                    f"--for-scripts works with {ExportFormat.MAT} only, the format of a kind's test"
                )
            size, remarks = export.write_table(form, fields or (), rows or ())
    if as_json:
        report = {"written": str(path), "remarks": remarks, "estimated_bytes": size.bytes}
        return print_json(report)
    print(path)
    for remark in remarks:
        print(f"  {remark}")
    return OK


class Export(NamedTuple):
    """A run, the file to write, and the options that all formats have."""

    run: Path
    path: Path
    rate: float | None  # Hz; None: that of the format
    every_tick: bool
    force: bool

    def write_format(
        self, form: KindFormat, *, for_scripts: bool
    ) -> tuple[ExportSize, tuple[str, ...]]:
        """Write a format of a kind of rig; return its estimated size and remarks."""
        rate = tables.run_rate(self.run) if self.every_tick else self.rate
        size = form.size(self.run, rate, for_scripts=for_scripts)
        self._warn(size)
        return size, form.write(self.run, rate, self.path, for_scripts=for_scripts)

    def write_table(
        self, form: ExportFormat, fields: Sequence[str], rows: Sequence[int]
    ) -> tuple[ExportSize, tuple[str, ...]]:
        """Write log fields as CSV or NetCDF; return the estimated size and remarks."""
        csv = form is ExportFormat.CSV
        selected = fields or (tables.csv_fields(self.run) if csv else ())
        max_rate = tables.CSV_RATE if csv and not self.every_tick else None
        selection = tables.select_table(self.run, selected, rows, self.rate, max_rate)
        size = selection.csv_size() if csv else selection.netcdf_size()
        self._warn(size)
        table = tables.read_table(selection)
        (tables.write_csv if csv else tables.write_netcdf)(table, self.path)
        remarks = [table.attrs.get(tables.INCOMPLETE_ATTRIBUTE, ""), selection.rate_remark]
        return size, tuple(filter(None, remarks))

    def _warn(self, size: ExportSize) -> None:
        """Print a warning of a large export on standard error; refuse one that has no room."""
        if warning := check_room(self.path, size, force=self.force):
            print(f"rig export: {warning}", file=sys.stderr)


def _format_of_a_kind(form: ExportFormat) -> KindFormat:
    """Return the format of the first kind that has it; ValueError without one."""
    for room in optional_rooms("exports"):
        if form in room.FORMATS:
            found: KindFormat = room.FORMATS[form]
            return found
    raise ValueError(f"--as {form}: no kind of rig on this host has this format")
