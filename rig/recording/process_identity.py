"""Which process is which: a number alone may have gone to another one."""

from pathlib import Path

_ENDED = ("Z", "X")
_STATE, _START = 0, 19  # fields 3 and 22 of /proc/PID/stat, counted behind the name


def started(pid: int) -> int | None:
    """When a living process began, in clock ticks since boot; None if there is none.

    Together with its number it names one process for as long as the machine is up.
    """
    try:
        told = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return None if told[_STATE] in _ENDED else int(told[_START])
