"""Correction of a run's rows with calibrations other than those of the run itself.

The record does not change. A calibration of the spring rate corrects the recorded rate; a spring
map replaces it by the rate at the recorded position of the spring. The run computed current as
force over torque constant, so a corrected torque constant multiplies force and gains by the ratio
of the corrected constant to the one in use. A corrected scale of the position multiplies travel,
velocity and load cell power by that factor, and divides the gains, which acted on position, by it.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from rig.config.calibration_file import (
    POSITION,
    TORQUE_CONSTANT_KEY,
    OffsetCorrection,
    ScaleCorrection,
)
from rig.recording.calibration import (
    CalibrationVersion,
    RecordingTime,
    ValidityError,
    apply_calibration,
    apply_correction,
    is_valid,
)
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.mcap_file import Records
from rig.row_contents import LAW, PANEL, Column, X, Y, with_role

FORCES = {"force_mean", "force_rms", "force_peak", "reference_scale"}
GAIN_UNITS = ("N*s/m", "N/m", "kg")  # of a law's columns: force per motion
RECORDED = "_recorded"  # suffix of the column with the value before correction

TableRow = dict[str, Any]


class RowCorrections(NamedTuple):
    """Corrections that calibrations apply to the rows of one run."""

    rate: CalibrationVersion | None  # of the panel column
    force_factor: float
    position: ScaleCorrection | OffsetCorrection | None
    at: RecordingTime
    names: tuple[str, ...]  # name and version of each calibration
    descriptions: tuple[str, ...]  # effect and file of each calibration
    position_field: str = ""  # log field of the position
    scaled_fields: tuple[str, ...] = ()  # log fields of position, velocity and powers from it
    panel: Column | None = None  # column that `rate` corrects
    gains: tuple[str, ...] = ()  # columns with a force per motion

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the corrected dataset; empty without a calibration."""
        if not self.names:
            return {}
        return {"read_by": ", ".join(self.names), "calibration": "; ".join(self.descriptions)}


AS_RECORDED = RowCorrections(None, 1.0, None, RecordingTime(), (), ())


def build_corrections(
    calibrations: Sequence[CalibrationVersion], run_facts: RunInfo
) -> RowCorrections:
    """Return the corrections that the calibrations apply to a run.

    Raises `OutsideError` if a calibration is not valid for the run and its file says ``refuse``, if
    its validity is unknown, and for a table of positions, with which gains would depend on the
    position of the body. Raises ValueError for two calibrations of one quantity.
    """
    at, corrections = RecordingTime.from_utc(run_facts.started_utc), AS_RECORDED
    corrected_by: dict[str, str] = {}
    for calibration in calibrations:
        file = calibration.file
        quantity = "spring_rate" if file.quantity == "spring_map" else file.quantity
        if quantity in corrected_by:
            titles = f"{corrected_by[quantity]} and {file.title}"
            raise ValueError(f"{titles} both correct {quantity}: give one of them")
        corrected_by[quantity] = file.title
        try:
            inside = is_valid(file.valid, at)
        except ValidityError as error:
            raise ValidityError(f"{file.title}: {error}") from None
        if not inside and file.outside == "refuse":
            valid = file.valid.description()
            raise ValidityError(
                f"{file.title} does not hold for {at.description()}: valid for {valid}"
            )
        description = f"{calibration.description()}: {file.quantity.replace('_', ' ')}"
        description += "" if inside else f" as recorded, outside {file.valid.description()}"
        name = file.title if inside else f"{file.title} (outside its range)"
        corrections = corrections._replace(
            names=(*corrections.names, name), descriptions=(*corrections.descriptions, description)
        )
        if inside:
            corrections = _add_correction(corrections, calibration, run_facts)
    contents = run_facts.row_contents
    position, velocity = (f"{contents.axis}.estimate.{name}" for name in ("position", "velocity"))
    powers = (f"power.{s.name}" for s in contents.stations if s.uses("velocity"))
    return corrections._replace(
        at=at,
        position_field=position,
        scaled_fields=(position, velocity, *powers),
        panel=with_role(contents.columns, PANEL),
        gains=tuple(
            c.name for c in contents.columns if c.role in (X, Y, LAW) and c.unit in GAIN_UNITS
        ),
    )


def _add_correction(
    corrections: RowCorrections, calibration: CalibrationVersion, run_facts: RunInfo
) -> RowCorrections:
    correction = calibration.file.correction
    if calibration.file.quantity in ("spring_rate", "spring_map"):
        return corrections._replace(rate=calibration)
    if calibration.file.quantity == "torque_constant":
        value = run_facts.axis_number(run_facts.row_contents.axis, TORQUE_CONSTANT_KEY)
        if not value:
            raise ValidityError(
                f"{calibration.file.title}: the run's configuration lacks the torque constant"
            )
        return corrections._replace(force_factor=apply_correction(correction, value) / value)
    if calibration.file.quantity != run_facts.row_contents.axis + POSITION:
        raise ValidityError(
            f"{calibration.file.title} corrects {calibration.file.quantity}; the rows of "
            f"{run_facts.run} have {run_facts.row_contents.axis}{POSITION} only"
        )
    if not isinstance(correction, ScaleCorrection | OffsetCorrection):
        raise ValidityError(
            f"{calibration.file.title} is a table of positions: gains would depend on position, "
            "but a row has a single value of each"
        )
    return corrections._replace(position=correction)


def correct_ticks(corrections: RowCorrections, data: Records) -> Records:
    """Return the ticks of a window with corrected positions, velocities and powers, as a copy."""
    if corrections.position is None:
        return data
    corrected = data.copy()
    if isinstance(corrections.position, OffsetCorrection):
        corrected[corrections.position_field] += corrections.position.offset
        return corrected
    for name in corrections.scaled_fields:
        corrected[name] *= corrections.position.factor
    return corrected


def correct_row(corrections: RowCorrections, recorded: TableRow) -> TableRow:
    """Return a row with corrected settings and forces.

    The recorded value of a corrected setting is kept under its name with the suffix `RECORDED`.
    """
    entry = dict(recorded)

    def set_value(name: str, value: float) -> None:
        entry[name + RECORDED] = recorded[name]
        entry[name] = value

    panel = corrections.panel
    if corrections.rate is not None and panel is not None:
        rate = recorded[panel.name]
        if corrections.rate.file.quantity == "spring_map" and panel.actuator is not None:
            rate = recorded[panel.actuator.name]
        if not math.isnan(rate):  # NaN for a run without a plan that did not log it
            rate = apply_calibration(corrections.rate.file, rate, corrections.at).value
        set_value(panel.name, rate)
    scale = (
        corrections.position.factor if isinstance(corrections.position, ScaleCorrection) else 1.0
    )
    if corrections.force_factor != 1.0:
        for name in FORCES & recorded.keys():
            entry[name] = recorded[name] * corrections.force_factor
    if corrections.force_factor != 1.0 or scale != 1.0:
        for name in corrections.gains:
            set_value(name, recorded[name] * corrections.force_factor / scale)
    return entry
