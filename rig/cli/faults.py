"""`rig faults TABLE`: rehearse faults of a rig's emulated devices, and compare the reactions."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from rig.analysis.rehearsed_faults import write_rehearsed_faults
from rig.cli.input_files import input_file, rig_file
from rig.cli.options import RUNS, Interpreted, Json, Rig, Runs
from rig.cli.output import FAILED, OK, STOPPED, fail, input_errors, print_json
from rig.config.problems import display_path
from rig.config.shipped_files import FAULTS
from rig.config.wiring import WiringError
from rig.emulation.control_client import ControlError
from rig.execution.emulated_rig import EmulatedRig, check_task, emulated_rig
from rig.execution.fault_check import Faults, check_faults, known_faults
from rig.execution.fault_runs import RehearsedFault, rehearse_faults
from rig.execution.fault_table import (
    FaultRow,
    FaultTable,
    missing_rows,
    read_table,
)
from rig.kinds.interface import Tasks
from rig.presentation.console import table_console
from rig.processes.io_processes import IoProcessError
from rig.recording import provenance
from rig.recording.runs import RunError, create

EXIT_CODES = """\
Exit codes: 0 every reaction as required; 1 one is not, or the devices failed; 2 bad input; \
3 Ctrl-C: the faults before it are kept."""
_SHOWN_GAPS = 8


def command(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", help="Table of faults: file (YAML), or shipped one.")
    ],
    rig: Rig = None,
    every: Annotated[
        bool, typer.Option("--all", help="All rows of the table, not only its short selection.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="TEXT", help="Rows with this text in their names."),
    ] = None,
    listed: Annotated[
        bool, typer.Option("--list", help="Check the table and list its rows; run nothing.")
    ] = False,
    interpreted: Interpreted = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Rehearse faults on a rig's emulated devices.

    Each fault of the table is injected in a run of its own, on the real drivers
    and wires. The reaction must be the required one: reason of the stop,
    category, and time until no motor has power. The folder of the rehearsal
    holds the runs and faults.json, which certificates of campaigns name.
    """
    with input_errors("faults", as_json=as_json):
        rig = rig_file(rig)
        loaded = read_table(input_file(table, FAULTS), rig)
        chosen = loaded.selection(only or (), every=every)
        tasks: Tasks = loaded.kind.room("tasks")
        short = check_task(tasks, loaded.task, rig)
        long = check_task(tasks, loaded.long_task, rig)
        faults = known_faults(loaded, short)
        check_faults(loaded, short, loaded.rows if listed else chosen, faults)
        if listed:
            return _list_rows(loaded, chosen, as_json=as_json)
    folder = create.create_folder(runs, f"faults_{loaded.name}", datetime.now(UTC))
    rehearsal = _Rehearsal(loaded, chosen, faults, folder, quiet=as_json)
    interrupted = False
    try:
        with (
            rehearsal.kept(),
            emulated_rig(loaded.kind, short, folder, long, loaded.motion) as devices,
        ):
            rehearsal.run(devices._replace(interpreted=interpreted))
    except KeyboardInterrupt:
        interrupted = True
    except (ValueError, WiringError) as error:
        return fail("faults", error, as_json=as_json)
    except (ControlError, IoProcessError, create.BusyError, RunError, OSError) as error:
        return fail("faults", error, as_json=as_json, code=FAILED)
    rehearsal.show_end(interrupted=interrupted, as_json=as_json)
    if interrupted:
        return STOPPED
    return FAILED if rehearsal.wrong else OK


class _Rehearsal:
    """The faults rehearsed so far, on the terminal and in the folder's file."""

    def __init__(
        self, table: FaultTable, rows: list[FaultRow], faults: Faults, folder: Path, *, quiet: bool
    ) -> None:
        self._table, self._rows, self._folder, self._quiet = table, rows, folder, quiet
        self._records: list[dict[str, Any]] = []
        self._began = datetime.now(UTC)
        self._missing = missing_rows(table.rows, faults)

    @property
    def wrong(self) -> list[str]:
        """Names of the faults whose reaction is not as required."""
        return [row["name"] for row in self._records if not row["as_required"]]

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Remove the folder at the end if no run began in it."""
        try:
            yield
        finally:
            if not self._records:
                _remove_without_runs(self._folder)

    def run(self, rig: EmulatedRig) -> None:
        """Rehearse all faults."""
        config = json.loads(rig.task.config)
        head = {
            "table": self._table.name,
            "rows_of_table": len(self._table.rows),
            "task": rig.task.name,
            "code": provenance.describe_code(),
            "rehearsed_utc": self._began.isoformat(timespec="seconds"),
        }
        write_rehearsed_faults(self._folder, config, head, ())
        count = len(self._rows)
        self._print(f"{'1 fault' if count == 1 else f'{count} faults, each'} in a run of its own\n")
        for each in rehearse_faults(rig, self._rows):
            self._records.append(_record(each))
            write_rehearsed_faults(self._folder, config, head, self._records)
            self._print(_line(each, len(self._records), len(self._rows)))

    def show_end(self, *, interrupted: bool, as_json: bool) -> None:
        """Print the result: JSON, or a line for people."""
        if as_json:
            status = "stopped" if interrupted else "failed" if self.wrong else "complete"
            print_json(
                {
                    "status": status,
                    "folder": str(self._folder),
                    "faults": self._records,
                    "planned": len(self._rows),
                    "rows_of_table": len(self._table.rows),
                    "without_row": self._missing,
                }
            )
            return
        right = len(self._records) - len(self.wrong)
        text = f"{right} of {len(self._records)} reactions as required"
        if interrupted:
            text += f"; Ctrl-C left {len(self._rows) - len(self._records)} faults out"
        self._print(f"\n{text}")
        for name in self.wrong:
            self._print(f"  not as required: {name}")
        if self._missing:
            names = ", ".join(self._missing[:_SHOWN_GAPS])
            more = len(self._missing) - _SHOWN_GAPS
            names += f" and {more} more (--json lists all)" if more > 0 else ""
            self._print(f"faults of the devices without a row in the table: {names}")
        if self._records:
            print(f"{self._folder}/")

    def _print(self, text: str) -> None:
        if not self._quiet:
            print(text, flush=True)


def _record(each: RehearsedFault) -> dict[str, Any]:
    row, finding = each.row, each.finding
    return {
        "name": row.name,
        "required": " or ".join((row.expected, *row.alternatives)),
        "reaction": finding.verdict,
        "category": finding.category,
        "seconds": None if finding.seconds is None else round(finding.seconds, 3),
        "allowed_seconds": row.max_seconds or None,
        "as_required": not each.mismatches,
        "differences": list(each.mismatches),
        "first_try": list(each.at_first),
        "message": finding.message,
        "run": finding.run_result.folder.name,
    }


def _line(each: RehearsedFault, number: int, planned: int) -> str:
    row, finding = each.row, each.finding
    mark = "NOT AS REQUIRED" if each.mismatches else "ok"
    time = ""
    if finding.seconds is not None:
        limit = f" (allowed {row.max_seconds:g} s)" if row.max_seconds else ""
        time = f", no power after {finding.seconds:.3f} s{limit}"
    lines = [
        f"{number:>{len(str(planned))}}/{planned}  {row.name}: {finding.verdict}{time}  {mark}"
    ]
    lines += [f"      {text}" for text in each.mismatches]
    if each.at_first and not each.mismatches:
        lines.append(f"      on the second try; at first {'; '.join(each.at_first)}")
    return "\n".join(lines)


def _list_rows(table: FaultTable, rows: list[FaultRow], *, as_json: bool) -> int:
    if as_json:
        named = [{"name": row.name, **row._asdict()} for row in rows]
        return print_json({"table": str(table.path), "task": str(table.task), "rows": named})
    shown = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("fault", "required reaction", "category", "within, s"):
        shown.add_column(heading)
    for row in rows:
        reaction = " or ".join((row.expected, *row.alternatives))
        category = "" if row.category is None else str(row.category)
        within = f"{row.max_seconds:g}" if row.max_seconds else ""
        shown.add_row(escape(row.name), escape(reaction), category, within)
    table_console().print(shown)
    table_path, task = display_path(table.path), display_path(table.task)
    print(f"\n{len(rows)} of {len(table.rows)} rows of {table_path}; each in a run of {task}")
    return OK


def _remove_without_runs(folder: Path) -> None:
    """Remove the folder of a rehearsal in which no run began; its error is printed."""
    if not any(path.is_dir() for path in folder.iterdir()):
        shutil.rmtree(folder)
