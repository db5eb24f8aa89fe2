"""`rig.open`: a run as a Python object."""

import json
import os
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rig.analysis.certificate import CERTIFICATE, read_certificate
from rig.analysis.report import has_excitation
from rig.analysis.stop_reason import describe_ending, find_stop
from rig.api import run_view
from rig.api.errors import RigError, public_errors
from rig.api.export import ExportFormat, export_run
from rig.api.run_lookup import find_run, products_of, run_folder
from rig.api.section import Section, Summary
from rig.presentation.phrases import mode_stamp
from rig.recording.runs import RunInfo, reader, run_info
from rig.recording.runs.folder import is_supervised, mcap_files
from rig.recording.runs.state import RecordState
from rig.spectra.wave_calibration import is_calibration

if TYPE_CHECKING:
    import pandas
    import xarray

    from rig.api.log import LogFields
    from rig.api.pictures import Pictures

_ROWS = "rows.nc"
_SUMMARY = "summary.json"
_ABANDONED = "abandoned"


class RunOutcome(NamedTuple):
    """The end of a run; as text (`str`) it is a sentence for people.

    Attributes:
        status: `complete`, `stopped` (by people), `fault` (a trip), `crashed`, `refused`,
            `running`, or `abandoned` (its processes are gone and wrote no end).
        reason: Name of the reason of the stop, such as `PLAN_END` or `POSITION`; empty if unknown.
        text: Title and reason for people, with ticks that the host lost before a trip.
    """

    status: str
    reason: str
    text: str

    @property
    def complete(self) -> bool:
        """Whether the plan ran to its end."""
        return self.status == "complete"

    def __str__(self) -> str:
        return self.text


class Run:
    """A recorded run: campaign or session, of any kind of rig, complete or not.

    `rig.open` and `rig.rehearse` return it. Results are read or computed when they are used, and
    kept. Absorbed power is negative; values are in SI units unless a name says otherwise.

    Attributes:
        path: Folder of the run, or its MCAP file where only that is known.
        info: Description of the run from its files, as the program uses it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info: RunInfo = run_info(path)

    def __repr__(self) -> str:
        return run_view.as_text(run_view.describe(self))

    def _repr_html_(self) -> str:
        return run_view.as_html(run_view.describe(self))

    @property
    def name(self) -> str:
        """The id of the run: its time of start (UTC) and its campaign or session."""
        return self.info.run

    @property
    def kind(self) -> str:
        """The kind of rig, such as `wavebot`; empty if the record does not name it."""
        return self.info.kind

    @property
    def mode(self) -> str:
        """The execution mode: `rehearsal`, `hil`, `hardware` or `imported`."""
        return self.info.mode

    @property
    def mode_text(self) -> str:
        """The execution mode for people."""
        return mode_stamp(self.mode)

    @property
    def started_utc(self) -> str:
        """UTC of run time zero, ISO 8601; empty if unknown."""
        return self.info.started_utc

    @cached_property
    def outcome(self) -> RunOutcome:
        """The end of the run."""
        status = self.info.status
        state = str(status.get("status") or "running")
        if state == "running" and is_supervised(status) is not True:
            state = _ABANDONED
        with public_errors():
            stop = find_stop(self.path, status)
        ending = describe_ending(status, stop.lost, self.info.reasons).description
        return RunOutcome(state, str(status.get("reason") or ""), ending)

    @cached_property
    def config(self) -> Section:
        """The resolved configuration with which the run began, by file: `config.rig.rate_hz`."""
        return Section(self.info.config, "config")

    @cached_property
    def campaign(self) -> Section:
        """The campaign or session file as it was resolved: `campaign.sea.amplitude_m`."""
        for role in ("campaign", "session"):
            if isinstance(values := self.info.config.get(role), Mapping):
                return Section(values, role)
        return Section({}, "campaign")

    @cached_property
    def plan(self) -> Section:
        """The plan of the run: rows, segments' durations, stations of power."""
        return Section(self.info.plan, "plan")

    @cached_property
    def table(self) -> "xarray.Dataset":
        """The row table of a campaign as a Dataset over `row`, as `rows.nc` has it.

        Means over the measured window of each row, standard errors (`power_dc_se`), and with a
        budget the expanded uncertainty; units and descriptions are attributes.

        Raises:
            RigError: For a run without the rows of a campaign.
        """
        self._require_matrix("row table")
        from rig.analysis.stored_rows import current_table

        with public_errors():
            return current_table(self.path)

    @cached_property
    def rows(self) -> "pandas.DataFrame":
        """The rows as a DataFrame, indexed by row; `rows.attrs["units"]` has the units by column.

        Of a campaign: settings, state (`complete`, `cut short`, `not run`, ...), mean powers with
        standard errors, motion, checks; values that stand for a name are that name. Of a session:
        its set points and their states; its results are in `tables`. Empty without rows.
        """
        from rig.api.row_frames import row_frame, session_frame

        with public_errors():
            if self._has_matrix:
                return row_frame(self.table)
            return session_frame(self.path, self.info)

    @cached_property
    def surfaces(self) -> "xarray.Dataset":
        """Power of each station over the columns that vary, with standard errors, W.

        A grid has one dimension for each column and NaN where nothing was measured; a scattered
        matrix has the dimension `point`. Rows of equal set points are one point.

        Raises:
            RigError: For a run without the rows of a campaign.
        """
        from rig.api.row_frames import power_surfaces

        with public_errors():
            return power_surfaces(self.table)

    @cached_property
    def best(self) -> "pandas.DataFrame":
        """The point with most absorbed power at each station; empty without best points.

        Columns: power and its standard error (W), `rows`, the settings that vary, and `caveat`,
        the reason why the true optimum may lie elsewhere.
        """
        import pandas

        from rig.analysis.labels import best_values
        from rig.analysis.points import gain_matrix, varied_columns
        from rig.analysis.slices import best_optima

        if not self._has_matrix or has_excitation(self.info):
            return pandas.DataFrame()
        with public_errors():
            varied = varied_columns(gain_matrix(self.table))
            best = best_optima(self.table)
        lines = [
            {
                "station": name,
                "label": each.station.label,
                "power": each.power,
                "standard_error": each.error,
                "rows": list(each.point.rows),
                **{c.name: value for c, value in best_values(varied, each.point) if c in varied},
                "text": each.caption,
                "caveat": each.caveat,
            }
            for name, each in best.items()
        ]
        frame = pandas.DataFrame(lines)
        return frame.set_index("station") if lines else frame

    @cached_property
    def effects(self) -> "pandas.DataFrame":
        """Main effects of the columns that vary on the power of each station, with 95 % intervals.

        One line for each station and column, as in `effects.csv`; empty where nothing varies.
        """
        import pandas

        from rig.analysis.effects import all_effects, effect_lines

        if not self._has_matrix or has_excitation(self.info):
            return pandas.DataFrame()
        with public_errors():
            return pandas.DataFrame(effect_lines(all_effects(self.table)))

    @cached_property
    def summary(self) -> Summary:
        """The summary: values by name (`summary.optima`), and a text by `print(run.summary)`.

        The values are those of `rig show --json`, the text is that of `rig show`.
        """
        with public_errors():
            found = products_of(self.path).summarise(self.path, (), incomplete_rows=False)
        return Summary(found.values, found.text)

    @cached_property
    def record(self) -> RecordState:
        """The state of the record: which executed ticks it lacks, and why."""
        with public_errors():
            if self._has_matrix:
                return RecordState.from_dict(json.loads(self.table.attrs["record_state"]))
            return reader.check_record(self.path)

    @cached_property
    def alarms(self) -> tuple[str, ...]:
        """Conditions that may invalidate results, one message each; empty without any."""
        if self._is_up_to_date(_SUMMARY):
            stored = json.loads((self._folder / _SUMMARY).read_text())
            return tuple(map(str, stored.get("alarms", ())))
        return tuple(self.summary.get("alarms", ()))

    @cached_property
    def constants(self) -> "pandas.DataFrame":
        """The constants that a session has measured: value, uncertainty (95 %), unit, method.

        Empty for a campaign.
        """
        import pandas

        measured = {} if self._has_matrix else self.summary.as_dict().get("constants", {})
        return pandas.DataFrame.from_dict(measured, orient="index").rename_axis("constant")

    @cached_property
    def tables(self) -> "dict[str, pandas.DataFrame | xarray.Dataset]":
        """The tables that the analysis wrote besides the row table, by name; units in `attrs`.

        One of more than one dimension, such as an identification, is a Dataset.
        """
        from rig.api.pictures import read_tables

        with public_errors():
            return read_tables(self._folder, leave_out=(_ROWS, f"{self.name}.nc"))  # an export

    @cached_property
    def pictures(self) -> "Pictures":
        """The pictures in the folder by name: `run.pictures.surfaces` shows one in a notebook."""
        from rig.api.pictures import Pictures

        return Pictures(self._folder)

    @cached_property
    def certificate(self) -> Section | None:
        """The certificate of a complete rehearsal: what was rehearsed, how near each limit came.

        None without one, and for one that was changed.
        """
        content = read_certificate(self._folder / CERTIFICATE)
        return None if content is None else Section(content, "certificate")

    @cached_property
    def journal(self) -> "pandas.DataFrame":
        """The requests of people to the run, who made them, and the answers."""
        from rig.api.events import journal_frame

        return journal_frame(self.info)

    @cached_property
    def events(self) -> "pandas.DataFrame":
        """Events by run time (s): changes of state and row, the stop, requests."""
        from rig.api.events import event_frame

        with public_errors():
            return event_frame(self.path, self.info, self._fields)

    @cached_property
    def fields(self) -> "pandas.DataFrame":
        """The fields of the log: label, unit, and the names of its values where it has any."""
        import pandas

        lines = []
        for name, leaf in self._fields.leaves.items():
            labels = self._fields.value_labels(name)
            lines.append(
                {
                    "field": name,
                    "label": self._fields.attributes(name)["long_name"],
                    "unit": leaf.unit,
                    "values": "" if labels is None else " ".join(labels.names.values()),
                }
            )
        return pandas.DataFrame(lines).set_index("field")

    @cached_property
    def log(self) -> "xarray.DataTree":
        """The whole log as a tree over `time` (s): `run.log.heave.command.force`.

        A field is read from the file when it is used, and kept; `run.log["power/dc"]` does the
        same. Modes, phases, reasons and faults are their names, flags are bools.
        """
        from rig.api.log import lazy_tree

        with public_errors():
            return lazy_tree(self.path, self._fields)

    def sel(
        self,
        row: int | Iterable[int] | None = None,
        *,
        phase: str = "",
        fields: str | Iterable[str] | None = None,
    ) -> "xarray.DataTree":
        """Return the log of some rows as a tree over `time` (s from the start of the run).

        Args:
            row: One row or several; all ticks without it.
            phase: Name of the phase of the plan, such as `MEASURE`, whose ticks enter the means of
                the row table; all without it.
            fields: Names, beginnings (`heave`) or patterns (`power.*`) of log fields; default all.

        Returns:
            Groups are named as the fields: `heave.command.force` is `tree.heave.command.force` and
            `tree["heave/command/force"]`. `units` and `long_name` are attributes; modes, phases,
            reasons and faults are their names, flags are bools.

        Raises:
            RigError: For an unknown row, phase or field; the message names what there is.
        """
        from rig.api.log import read_tree

        if row is None:
            rows: list[int] = []
        elif isinstance(row, Iterable):
            rows = list(row)
            if not rows:
                raise RigError("row: an empty list; name at least one row, or leave it out")
        else:
            rows = [row]
        with public_errors():
            try:
                return read_tree(self.path, self._fields, fields, rows, phase)
            except KeyError as error:
                raise RigError(f"{self.path}: {error.args[0]}") from error
            except TypeError as error:
                raise RigError(f"{self.path}: {error}") from error

    def export(
        self,
        form: str,
        path: str | os.PathLike[str] | None = None,
        *,
        fields: Iterable[str] = (),
        rows: Iterable[int] = (),
        rate: float | None = None,
        every_tick: bool = False,
        force: bool = False,
    ) -> Path:
        """Write the log for other tools, as `rig export` does, and return the file.

        Args:
            form: `netcdf` (xarray, MHKiT), `csv`, or `mat`, the MATLAB structure of MASK4.
            path: File to write; default: named after the run, in its folder.
            fields: Log fields or patterns (netcdf, csv); default: all, for csv the main ones.
            rows: Rows of the campaign (netcdf, csv); default: all ticks.
            rate: Samples per second, Hz; must divide the run's rate. Default: every tick for
                netcdf, up to 100 Hz for csv, 200 Hz for mat.
            every_tick: Keep the run's own rate.
            force: Write even where the disk may have too little room.

        Raises:
            RigError: For an unknown form, field or row, or a rate that does not divide the run's.
        """
        with public_errors():
            if form not in list(ExportFormat):
                raise RigError(f"form {form!r}: allowed {', '.join(ExportFormat)}")
            exported = export_run(
                self.path,
                ExportFormat(form),
                None if path is None else Path(path),
                fields=list(fields),
                rows=list(rows),
                rate=rate,
                every_tick=every_tick,
                force=force,
            )
            return exported.path

    @property
    def _folder(self) -> Path:
        return run_folder(self.path)

    @cached_property
    def _fields(self) -> "LogFields":
        from rig.api.log import LogFields

        return LogFields(self.info, reader.open_files(self.path).leaves)

    @property
    def _has_matrix(self) -> bool:
        """Whether the run has the rows of a campaign, and so a row table."""
        return "session" not in self.info.config and not is_calibration(self.info.plan)

    def _require_matrix(self, what: str) -> None:
        if not self._has_matrix:
            other = "session" if "session" in self.info.config else "wave calibration"
            raise RigError(f"{self.path}: a {other} has no {what}; see run.tables and run.summary")

    def _is_up_to_date(self, product: str) -> bool:
        """Return whether a product was written after the end of the record as it is now."""
        status, file = self.info.status, self._folder / product
        if "ended_utc" not in status or "recovered_utc" in status or not file.is_file():
            return False
        if not self.path.is_dir():
            return False
        sources = [each.stat().st_mtime_ns for each in mcap_files(self.path)]
        return file.stat().st_mtime_ns >= max(sources)


def open(run: str | os.PathLike[str], *, runs: str | os.PathLike[str] = "runs") -> Run:
    """Open a recorded run.

    Args:
        run: Folder of a run or its MCAP file; or, of a run in ``runs``: its id, the beginning of
            exactly one id, its campaign (the newest run), or `last`.
        runs: Folder that holds the runs.

    Returns:
        The run; complete ones, killed ones and those that still run are opened alike.

    Raises:
        RigError: If there is no such run, or nothing of its record can be read.
    """
    with public_errors():
        return Run(find_run(Path(run), Path(runs)))
