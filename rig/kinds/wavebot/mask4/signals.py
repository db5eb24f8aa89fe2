"""Read the signals of a MASK4 file as log fields on one common time."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.interop.legacy import matlab
from rig.interop.legacy.table import file_error
from rig.kinds.wavebot.mask4.fields import ALTERNATIVE_PATHS, FIELDS, REQUIRED, FieldMapping
from rig.spectra.periods import Floats

DRIVE_BY_CHANNEL = {"hbmSignals.heaveDriveInP": "cots", "hbmSignals.expDriveInP": "custom"}
"""Drive of each channel of DC power: the custom drive has its own channel."""


class Mask4Signals(NamedTuple):
    """The signals of a file, with log field names and house signs."""

    time: Floats  # s, as recorded
    log_fields: dict[str, Floats]  # by log field, at ``time``
    variables: dict[str, Any]  # all numeric variables of the file, by MATLAB's path
    drive: str  # cots or custom
    missing: tuple[str, ...]  # fields of the table that the file lacks


def read_signals(path: Path, drive: str | None = None) -> Mask4Signals:
    """Return the signals of a file (MATLAB 5 or 7.3).

    ``drive`` (`cots` or `custom`) is required if the file has the DC power of both drives. Raises
    `ConfigError` with every problem.
    """
    try:
        variables = matlab.load_signals(path)
    except OSError as error:
        raise file_error(path, f"cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise file_error(path, str(error)) from None
    for name, other in ALTERNATIVE_PATHS.items():
        if name not in variables and other in variables:
            variables[name] = variables[other]
    problems = [f"no {name}: not the MASK4 structure" for name in REQUIRED if name not in variables]
    drives = [kind for name, kind in DRIVE_BY_CHANNEL.items() if name in variables]
    if drive is None and len(drives) > 1:
        problems.append(
            "the file has DC power of both drives; name the drive of the run: cots, custom"
        )
    if drive is not None and drives and drive not in drives:
        problems.append(f"no DC power of the {drive} drive is in the file, only of {drives[0]}")
    if problems:
        raise file_error(path, *problems)
    kind = drive or (drives[0] if drives else "cots")
    time = np.asarray(variables["heaveSignals.time"], dtype=np.float64)
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise file_error(path, "heaveSignals.time does not rise")
    log_fields: dict[str, Floats] = {}
    for field in FIELDS:
        if (
            field.path in variables
            and field.drive in ("", kind)
            and field.log_field not in log_fields
        ):
            value, field_problems = _at_heave_time(field, variables, time)
            problems += field_problems
            log_fields[field.log_field] = (value - field.offset) / field.factor
    if problems:
        raise file_error(path, *problems)
    expected = [field.path for field in FIELDS if field.drive in ("", kind)]
    missing = tuple(name for name in expected if name not in variables)
    return Mask4Signals(time, log_fields, variables, kind, missing)


def _at_heave_time(
    field: FieldMapping, variables: dict[str, Any], time: Floats
) -> tuple[Floats, list[str]]:
    """Return a field at the heave signals' time, interpolated linearly from its bus's own time."""
    value = np.asarray(variables[field.path], dtype=np.float64)
    own_time = variables.get(f"{field.bus}.time", time)
    if len(own_time) != len(value):
        message = f"{field.path} has {len(value)} samples, its time {len(own_time)}"
        return np.full(len(time), np.nan), [message]
    if len(own_time) == len(time) and np.array_equal(own_time, time):
        return value, []
    return np.interp(time, own_time, value, left=np.nan, right=np.nan), []
