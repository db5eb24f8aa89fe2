"""Calibrations: versioned corrections of recorded values, each with its range of validity.

A record is never rewritten. Its values are corrected when they are read with a calibration, and
every product names the version of the calibration that was used.
"""

from rig.config.calibration_file import CalibrationFile
from rig.recording.calibration.correction import (
    CalibratedValue,
    RecordingTime,
    ValidityError,
    apply_calibration,
    apply_correction,
)
from rig.recording.calibration.history import (
    CalibrationHistory,
    CalibrationVersion,
    open_calibration,
    open_history,
)

__all__ = [
    "CalibratedValue",
    "CalibrationFile",
    "CalibrationHistory",
    "CalibrationVersion",
    "RecordingTime",
    "ValidityError",
    "apply_calibration",
    "apply_correction",
    "open_calibration",
    "open_history",
]
