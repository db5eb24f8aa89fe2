"""Check of a table of faults against the emulated devices of its rig, none of which is started."""

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rig.config.problems import ConfigError, Problem, format_number
from rig.emulation.process import faults_of_devices
from rig.execution import process_faults
from rig.execution.emulated_rig import CheckedTask, emulator_process
from rig.execution.fault_table import FaultRow, FaultTable
from rig.kinds.interface import Emulation, Tasks
from rig.recording.row_layout import leaves

Faults = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""By device, link or process and fault: `limits` and unit (`value`), empty without a value."""


def known_faults(table: FaultTable, task: CheckedTask) -> Faults:
    """Return the faults of the rig's emulated devices, wires and processes.

    Raises WiringError if the wires must not be powered.
    """
    tasks: Tasks = table.kind.room("tasks")
    emulation: Emulation = table.kind.room("rehearsal.emulation")
    config = emulator_process(tasks, task).config
    devices = faults_of_devices(emulation.build_devices, task.checked.rig, config)
    mode = tasks.wired_mode(task.checked, emulated=False)
    processes = process_faults.faults_by_process(each.name for each in mode.io_processes)
    return devices | {name: {each: {} for each in names} for name, names in processes.items()}


def check_faults(
    table: FaultTable, task: CheckedTask, rows: Iterable[FaultRow], faults: Faults
) -> None:
    """Raise `ConfigError` with all problems of ``rows``, and those of the table's other keys."""
    tasks: Tasks = table.kind.room("tasks")
    fields = [leaf.name for leaf in leaves(tasks.execution_task(*task).kind.row_type)]
    problems = [
        *table.problems,
        *_motion_problems(table, fields),
        *fault_problems(table, rows, faults),
    ]
    if problems:
        raise ConfigError(problems)


def fault_problems(
    table: FaultTable, rows: Iterable[FaultRow], faults: Faults
) -> Iterator[Problem]:
    """Yield devices and faults that do not exist, and values outside the limits of the fault."""
    checked, places = set(rows), Counter[str]()
    for row in table.rows:
        key = ("faults", row.device, places[row.device])
        places[row.device] += 1
        if row not in checked:
            continue
        if row.device not in faults:
            message = f"is none of the emulated devices of this rig; allowed {', '.join(faults)}"
            yield table.locate.problem(key[:2], row.device, f"{row.device} {message}")
        elif row.fault not in faults[row.device]:
            allowed = ", ".join(faults[row.device])
            message = f"{row.fault} is no fault of {row.device}; allowed {allowed}"
            yield table.locate.problem((*key, "fault"), row.fault, message)
        elif row.value is not None and (
            refusal := _refusal(row.value, faults[row.device][row.fault])
        ):
            yield table.locate.problem((*key, "value"), row.value, refusal)


def _refusal(value: float, fault: Mapping[str, Any]) -> str:
    """Return why a fault cannot have a value; empty if it can."""
    limits = fault.get("limits", ())
    if not limits:
        return f"{format_number(value)} is refused; this fault has no value"
    if limits[0] <= value <= limits[1]:
        return ""
    allowed = f"{limits[0]:g} .. {limits[1]:g} {fault['value'].rpartition(', ')[2]}"
    return f"{format_number(value)} is out of range; allowed {allowed}"


def _motion_problems(table: FaultTable, fields: list[str]) -> Iterator[Problem]:
    if table.motion is not None and (field := table.motion.field) not in fields:
        similar = difflib.get_close_matches(field, fields, 5, 0.3) or fields[:5]
        message = f"the log has no {field}; allowed its fields, for example {', '.join(similar)}"
        yield table.locate.problem(("motion", "field"), field, message)
