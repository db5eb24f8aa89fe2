"""Calibration files for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rig.recording.calibration import CalibrationFile, open_calibration

CALIBRATIONS = Path(__file__).parents[2] / "configs" / "calibrations"

TEXT = """\
name: {name}
version: {version}
quantity: {quantity}
unit: {unit}
correction: {correction}
valid: {valid}
outside: {outside}
{supersedes}source: a test
reason: to see
"""
UNITS = {"spring_rate": "N/m", "torque_constant": "N*m/A", "heave_position": "m"}


def write(folder: Path, **changes: Any) -> Path:
    """Write a calibration file with some keys changed; it has the name of the calibration."""
    whole = {
        "name": "one",
        "version": 1,
        "quantity": "spring_rate",
        "correction": "{kind: scale, factor: 0.5}",
        "valid": "{runs: {series: T, before: 10}}",
        "outside": "unchanged",
        "supersedes": "",
    } | changes
    whole.setdefault("unit", UNITS.get(whole["quantity"]))
    if whole["supersedes"]:
        whole["supersedes"] = f"supersedes: {whole['supersedes']}\n"
    path = folder / f"{whole['name']}_{whole['version']}.yaml"
    path.write_text(TEXT.format(**whole))
    return path


def calibration(folder: Path, **changes: Any) -> CalibrationFile:
    """Write and open a calibration file."""
    return open_calibration(write(folder, **changes)).file
