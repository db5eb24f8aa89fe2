"""Read the log of a test, a spreadsheet written by hand, as typed entries.

Unambiguous text becomes a value. Everything else becomes a remark that names the cell and quotes
it; nothing is guessed.
"""

from rig.interop.legacy.testlog.entry import (
    Activity,
    Amplitude,
    Bias,
    Condition,
    Entry,
    Gain,
    Remark,
    RemarkKind,
    Separator,
    Spring,
    Wave,
    WaveKind,
)
from rig.interop.legacy.testlog.read import RunLog, read_log
from rig.interop.legacy.testlog.recorded_values import recording_time, values_in_log
from rig.interop.legacy.testlog.relations import Links, Repeat, find_links

__all__ = [
    "Activity",
    "Amplitude",
    "Bias",
    "Condition",
    "Entry",
    "Gain",
    "Links",
    "Remark",
    "RemarkKind",
    "Repeat",
    "RunLog",
    "Separator",
    "Spring",
    "Wave",
    "WaveKind",
    "find_links",
    "read_log",
    "recording_time",
    "values_in_log",
]
