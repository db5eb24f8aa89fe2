"""The signals of a MASK4 file as log fields on one time, whichever clock they were recorded by."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.problems import ConfigError, Problem, display_path
from rig.interop.exchange.mask4_fields import ELSEWHERE, FIELDS, NEEDED, Field
from rig.interop.legacy import matlab

Floats = npt.NDArray[np.float64]

DRIVES = {"hbmSignals.heaveDriveInP": "cots", "hbmSignals.expDriveInP": "custom"}
"""Whose DC power a channel is: the custom drive has one of its own."""


class Signals(NamedTuple):
    """What a file holds, in our words and signs."""

    time: Floats  # s, as recorded
    leaves: dict[str, Floats]  # by log field, at ``time``
    found: dict[str, Any]  # everything numeric in the file, by MATLAB's path
    drive: str  # cots or custom
    absent: tuple[str, ...]  # fields of the table that the file has not


def read_signals(path: Path, drive: str | None = None) -> Signals:
    """The signals of a file (MATLAB 5 or 7.3).

    ``drive``: `cots` or `custom`, needed where the file has DC power of both. Raises `ConfigError`
    with every problem.
    """
    try:
        found = matlab.signals(path)
    except OSError as error:
        raise _refused(path, [f"cannot be read: {error.strerror}"]) from None
    except ValueError as error:
        raise _refused(path, [str(error)]) from None
    for name, other in ELSEWHERE.items():
        if name not in found and other in found:
            found[name] = found[other]
    wrong = [f"no {name}: not the MASK4 structure" for name in NEEDED if name not in found]
    there = [kind for name, kind in DRIVES.items() if name in found]
    if drive is None and len(there) > 1:
        wrong.append("DC power of both drives is in the file; say whose run it was: cots, custom")
    if drive is not None and there and drive not in there:
        wrong.append(f"no DC power of the {drive} drive is in the file, only of {there[0]}")
    if wrong:
        raise _refused(path, wrong)
    kind = drive or (there[0] if there else "cots")
    time = np.asarray(found["heaveSignals.time"], dtype=np.float64)
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise _refused(path, ["heaveSignals.time does not rise"])
    leaves: dict[str, Floats] = {}
    for field in FIELDS:
        if field.path in found and field.drive in ("", kind) and field.leaf not in leaves:
            value, said = _on_time(field, found, time)
            wrong += said
            leaves[field.leaf] = (value - field.offset) / field.factor
    if wrong:
        raise _refused(path, wrong)
    wanted = [field.path for field in FIELDS if field.drive in ("", kind)]
    absent = tuple(name for name in wanted if name not in found)
    return Signals(time, leaves, found, kind, absent)


def _on_time(field: Field, found: dict[str, Any], time: Floats) -> tuple[Floats, list[str]]:
    """A field at the heave signals' time: its own where it has another, by straight lines."""
    value = np.asarray(found[field.path], dtype=np.float64)
    own = found.get(f"{field.bus}.time", time)
    if len(own) != len(value):
        said = f"{field.path} has {len(value)} samples, its time {len(own)}"
        return np.full(len(time), np.nan), [said]
    if len(own) == len(time) and np.array_equal(own, time):
        return value, []
    return np.interp(time, own, value, left=np.nan, right=np.nan), []


def _refused(path: Path, messages: list[str]) -> ConfigError:
    return ConfigError(Problem(display_path(path), 1, "", None, message) for message in messages)
