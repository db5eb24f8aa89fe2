"""Identity of processes: a process id alone may have been reused."""

from pathlib import Path

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
