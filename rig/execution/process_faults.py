"""Faults of a run's processes: killed (SIGKILL) or hung (SIGSTOP) from outside.

The supervisor is the process that runs the table, so its own death is not among these faults;
`python -m benchmarks crash` kills every process.
"""

import os
import signal
import time
from collections.abc import Iterable
from pathlib import Path

PREFIX = "process "  # of the device's name in a table
LOOP, LOGGER = "loop", "logger"
_SIGNALS = {"killed": signal.SIGKILL, "hung": signal.SIGSTOP}


def faults_by_process(io_processes: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the faults of loop, logger and I/O processes by the device names of the table.

    A hung logger is no fault before the ring is full, which takes a minute
    (`python -m benchmarks ring` suspends it for 5 s).
    """
    both = tuple(_SIGNALS)
    names = {LOOP: both, LOGGER: ("killed",), **dict.fromkeys(io_processes, both)}
    return {PREFIX + name: faults for name, faults in names.items()}


def inject(device: str, fault: str) -> float:
    """Kill or suspend a process of the run; return the time (s, monotonic)."""
    pid = child_with_stderr(f"{device.removeprefix(PREFIX)}.stderr")
    at = time.monotonic()
    os.kill(pid, _SIGNALS[fault])
    return at


def child_with_stderr(stderr: str) -> int:
    """Return the process id of the child of this process whose stderr is a file of this name."""
    for entry in Path("/proc").iterdir():
        try:
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            errors = Path(os.readlink(entry / "fd" / "2")).name
        except (OSError, ValueError, IndexError):
            continue
        if parent == os.getpid() and errors == stderr:
            return int(entry.name)
    raise LookupError(f"no child writes {stderr}")
