"""The log that was kept during a test: a spreadsheet people wrote into, read as typed entries.

What the sheet says plainly becomes a value. Everything else becomes a remark that names the cell
and quotes it; nothing is filled in by guess.
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
from rig.interop.legacy.testlog.read import Log, read_log
from rig.interop.legacy.testlog.relations import Links, Repeat, links

__all__ = [
    "Activity",
    "Amplitude",
    "Bias",
    "Condition",
    "Entry",
    "Gain",
    "Links",
    "Log",
    "Remark",
    "RemarkKind",
    "Repeat",
    "Separator",
    "Spring",
    "Wave",
    "WaveKind",
    "links",
    "read_log",
]
