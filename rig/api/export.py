"""Export of a run for other tools."""

from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from rig.api.run_lookup import run_folder
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


class Exported(NamedTuple):
    """A file that was written."""

    path: Path
    size: ExportSize  # as estimated before
    remarks: tuple[str, ...]


def export_run(
    run: Path,
    form: ExportFormat,
    output: Path | None = None,
    *,
    fields: Sequence[str] = (),
    rows: Sequence[int] = (),
    rate: float | None = None,
    every_tick: bool = False,
    for_scripts: bool = False,
    force: bool = False,
    notice: Callable[[str], None] = lambda text: None,
) -> Exported:
    """Write a run's log into a file and return what was written.

    ``output``: the file; None: named after the run, in its folder. ``rate`` is in Hz; None: that of
    the format. ``notice`` is called with the warning of a large export. Raises ValueError for
    options that exclude each other, KeyError for an unknown field or row, RunError for a run or a
    rate that does not suit, or too little room on the disk.
    """
    if every_tick and rate is not None:
        raise ValueError(f"the run's own rate and {rate:g} Hz exclude each other: choose one")
    path = output or run_folder(run) / f"{run_info(run).run}{SUFFIX[form]}"
    export = Export(run, path, rate, every_tick, force, notice)
    if form is ExportFormat.MAT:
        if fields or rows:
            raise ValueError(
                "fields and rows can be chosen with netcdf and csv only; a format of a kind holds "
                "all fields and rows"
            )
        return Exported(
            path, *export.write_format(_format_of_a_kind(form), for_scripts=for_scripts)
        )
    if for_scripts:
        raise ValueError(
            f"signals for scripts work with {ExportFormat.MAT} only, the format of a kind's test"
        )
    return Exported(path, *export.write_table(form, fields, rows))


class Export(NamedTuple):
    """A run, the file to write, and the options that all formats have."""

    run: Path
    path: Path
    rate: float | None  # Hz; None: that of the format
    every_tick: bool
    force: bool
    notice: Callable[[str], None]  # of a large export

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
        """Report a large export; refuse one that has no room."""
        if warning := check_room(self.path, size, force=self.force):
            self.notice(warning)


def _format_of_a_kind(form: ExportFormat) -> KindFormat:
    """Return the format of the first kind that has it; ValueError without one."""
    for room in optional_rooms("exports"):
        if form in room.FORMATS:
            found: KindFormat = room.FORMATS[form]
            return found
    raise ValueError(f"{form}: no kind of rig on this host has this format")
