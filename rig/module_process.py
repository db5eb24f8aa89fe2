"""Processes of this package: their command lines, and the identity of a running one."""

import os
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]  # source tree, or site-packages


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with this interpreter.

    `python -m` imports from the working directory first, where a person may keep a `signal.py`.
    The option -P prevents this, except in the source tree, whose modules come from there.
    """
    in_source_tree = Path(os.getcwd()).resolve() == _ROOT
    return [sys.executable, *([] if in_source_tree else ["-P"]), "-m", module, *arguments]


_ENDED_STATES = ("Z", "X")
_STATE, _START = 0, 19  # fields 3 and 22 of /proc/PID/stat, counted after the process name


def start_ticks(pid: int) -> int | None:
    """Return the start time of a live process in clock ticks since boot; None without one.

    Process id and start time together identify one process until the next reboot.
    """
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return None if fields[_STATE] in _ENDED_STATES else int(fields[_START])
