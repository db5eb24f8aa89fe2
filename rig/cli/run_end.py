"""The end of a run for people and for programs: exit code, last row, messages and files."""

import math
import sys
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any

from rig import cli
from rig.execution.task import RunResult
from rig.processes.run_types import Outcome
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import ReasonTable
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase

_NAMES: dict[str, type[IntEnum]] = {
    "safety.mode": Mode,
    "plan.phase": Phase,
}
_FLAGS: dict[str, type[IntFlag]] = {
    "command.limited": LimitFlag,
    "warned": WarningFlag,
}  # of every axis
_EXIT_CODES = {"complete": cli.OK, "stopped": cli.STOPPED, "fault": cli.FAULT}


def exit_code(outcome: Outcome, trouble: str) -> int:
    """Return the command's exit code; ``trouble`` is a failure after the run (empty: none)."""
    if outcome.status == "crashed" or outcome.dropped or outcome.unsaved:
        return cli.LOST
    if trouble or outcome.status == "refused" or (outcome.moved and outcome.status == "complete"):
        return cli.FAILED
    return _EXIT_CODES[outcome.status]


def row_as_json(row: dict[str, float | int], reasons: ReasonTable) -> dict[str, Any]:
    """Return a row as JSON values.

    Coded numbers become names, flags become lists of names, NaN and infinity become null.
    """
    values: dict[str, Any] = {}
    for name, value in row.items():
        if name == "safety.reason":
            values[name] = reasons.name(int(value)) if int(value) in reasons else value
        elif name in _NAMES:
            values[name] = {int(code): code.name for code in _NAMES[name]}.get(int(value), value)
        elif flags := _flag_type(name):
            values[name] = [flag.name for flag in flags if int(value) & flag]
        else:
            values[name] = value if math.isfinite(value) else None
    return values


def _flag_type(name: str) -> type[IntFlag] | None:
    endings = (flags for end, flags in _FLAGS.items() if f".{name}".endswith(f".{end}"))
    return next(endings, None)


def print_folder(ended: RunResult, products: list[Path], trouble: str) -> None:
    """Print lost rows, the messages of the run, and the paths of folder and products."""
    outcome = ended.outcome
    if outcome.dropped or outcome.unsaved:
        lost = f"{outcome.dropped} rows dropped, {outcome.unsaved} rows not saved"
        print(f"\nlost: {lost}", file=sys.stderr)
    for message in (*outcome.messages, outcome.died, outcome.moved, trouble):
        if message:
            print(f"\n{message}", file=sys.stderr)
    print(f"\n{ended.folder}/")
    for product in products:
        print(f"  {product.name}")
