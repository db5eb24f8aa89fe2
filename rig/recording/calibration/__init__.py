"""Calibrations: versioned corrections of what was recorded, each with its range of validity.

A record is never rewritten. What stands in it is corrected when somebody asks to read it so, and
what comes of it says which version of which calibration it was read with.
"""

from rig.config.calibration_file import CalibrationFile
from rig.recording.calibration.correction import (
    Applied,
    At,
    OutsideError,
    apply,
    corrected,
    invert,
    recorded,
)
from rig.recording.calibration.history import History, Known, open_calibration, open_history

__all__ = [
    "Applied",
    "At",
    "CalibrationFile",
    "History",
    "Known",
    "OutsideError",
    "apply",
    "corrected",
    "invert",
    "open_calibration",
    "open_history",
    "recorded",
]
