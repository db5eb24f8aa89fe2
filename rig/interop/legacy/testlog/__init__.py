"""Read the log of a test, a spreadsheet written by hand, as typed entries.

Unambiguous text becomes a value. Everything else becomes a remark that names the cell and quotes
it; nothing is guessed.
"""

from rig.interop.legacy.testlog.entry import Entry
from rig.interop.legacy.testlog.read import (
    RunLog,
    find_links,
    read_log,
    recording_time,
    values_in_log,
)

__all__ = ["Entry", "RunLog", "find_links", "read_log", "recording_time", "values_in_log"]
