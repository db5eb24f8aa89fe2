"""How a run ended, for people and for programs, whatever was run."""

import math
import sys
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any

from rig import cli
from rig.execution.task import Ended
from rig.processes.run_types import Outcome
from rig.realtime.limits import Limited, Warned
from rig.realtime.safety import Mode, Reason
from rig.realtime.sequence import Phase

_NAMES: dict[str, type[IntEnum]] = {
    "safety.mode": Mode,
    "safety.reason": Reason,
    "plan.phase": Phase,
}
_FLAGS: dict[str, type[IntFlag]] = {"command.limited": Limited, "warned": Warned}  # of every axis
_EXIT_CODES = {"complete": cli.OK, "stopped": cli.STOPPED, "fault": cli.FAULT}


def exit_code(outcome: Outcome, trouble: str) -> int:
    """The command's exit code; ``trouble`` is what could not be done afterwards."""
    if outcome.status == "crashed" or outcome.dropped or outcome.unsaved:
        return cli.LOST
    if trouble or outcome.status == "refused" or (outcome.moved and outcome.status == "complete"):
        return cli.FAILED
    return _EXIT_CODES[outcome.status]


def in_words(row: dict[str, float | int]) -> dict[str, Any]:
    """A row for JSON: names for coded numbers, a list of them for flags, null for NaN, infinity."""
    told: dict[str, Any] = {}
    for name, value in row.items():
        if name in _NAMES:
            told[name] = {int(code): code.name for code in _NAMES[name]}.get(int(value), value)
        elif flags := _flags_of(name):
            told[name] = [flag.name for flag in flags if int(value) & flag]
        else:
            told[name] = value if math.isfinite(value) else None
    return told


def _flags_of(name: str) -> type[IntFlag] | None:
    endings = (flags for end, flags in _FLAGS.items() if f".{name}".endswith(f".{end}"))
    return next(endings, None)


def tell_folder(ended: Ended, products: list[Path], trouble: str) -> None:
    """What was lost or said on the way, and where everything is."""
    outcome = ended.outcome
    if outcome.dropped or outcome.unsaved:
        lost = f"{outcome.dropped} rows dropped, {outcome.unsaved} rows not saved"
        print(f"\nlost: {lost}", file=sys.stderr)
    for what in (*outcome.messages, outcome.died, outcome.moved, trouble):
        if what:
            print(f"\n{what}", file=sys.stderr)
    print(f"\n{ended.folder}/")
    for product in products:
        print(f"  {product.name}")
