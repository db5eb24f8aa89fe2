"""Names and phrases that pictures and pages share."""

import math
from datetime import UTC, datetime

from rig.realtime.safety import Reason

POWER_NAMES = {
    "mechanical_1": "mechanical (column load cell)",
    "mechanical_2": "mechanical (shaft torque sensor)",
    "ac": "electrical AC",
    "dc": "electrical DC",
}

STATION_ABBREVIATIONS = {
    "mechanical_1": "mechanical",
    "mechanical_2": "mechanical (shaft)",
    "ac": "electrical AC",
    "dc": "electrical DC",
}

_MODES = {
    "batch": "BATCH: simulated plant, no clock",
    "rehearsal": "REHEARSAL: simulated plant",
    "hil": "HIL: emulated devices on real wires",
    "hardware": "HARDWARE",
    "imported": "IMPORTED: recorded by another system",
}

REASONS = {
    Reason.NONE: "no reason recorded",
    Reason.PLAN_END: "the plan was walked to its end",
    Reason.OPERATOR_STOP: "the operator stopped the run",
    Reason.OPERATOR_ABORT: "the operator aborted the run (power off at once)",
    Reason.SUPERVISOR_LOST: (
        "`rig run` gave no sign of life: killed, suspended, or held up by a busy host"
    ),
    Reason.LOGGER_LOST: "the record could not be kept: logger, disk or folder was lost",
    Reason.NOT_FINITE: "a value was NaN or infinite",
    Reason.STALE_ENCODER: "the encoder's value was too old",
    Reason.STALE_DRIVE: "the drive's values were too old",
    Reason.STALE_LOAD_CELL: "the load cells' values were too old",
    Reason.STALE_ANALYSER: "the power analyser's values were too old",
    Reason.STALE_STATOR: "the stator's position was too old",
    Reason.LOST_TICKS: "too many ticks were lost in one gap",
    Reason.DRIVE_FAULT: "the drive reported a fault",
    Reason.DRIVE_DROPPED: "the drive switched its power off by itself",
    Reason.DRIVE_NOT_ON: "the drive did not come up in time",
    Reason.POSITION: "the position limit was reached",
    Reason.VELOCITY: "the velocity limit was reached",
    Reason.ROTOR_TRAVEL: "the magnetic spring's rotor reached its travel limit",
    Reason.POSITION_DISAGREES: "encoder and string pot disagreed",
    Reason.STATOR_LATE: "the stator (or the drive) was not ready in time",
    Reason.NOT_CALM: "the body moved during the tare",
    Reason.EXCEPTION: "the loop's own code failed",
    Reason.ENCODER_JUMP: "the encoder jumped: it slipped or lost counts",
    Reason.SPRING_STROKE: "the stroke at which the magnetic spring's stator force reverses",
    Reason.BUS_UNDERVOLTAGE: "the drive's DC bus ran out of energy",
    Reason.BUS_OVERVOLTAGE: "the drive's DC bus took more than the dump resistors burn",
    Reason.SURGE_STALE_ENCODER: "the surge encoder's value was too old",
    Reason.SURGE_STALE_DRIVE: "the surge drive's values were too old",
    Reason.SURGE_DRIVE_FAULT: "the surge drive reported a fault",
    Reason.SURGE_DRIVE_DROPPED: "the surge drive switched its power off by itself",
    Reason.SURGE_POSITION: "the position limit of surge was reached",
    Reason.SURGE_VELOCITY: "the velocity limit of surge was reached",
    Reason.SURGE_ENCODER_JUMP: "the surge encoder jumped: it slipped or lost counts",
    Reason.EMERGENCY_STOP: "the emergency stop was pressed",
    Reason.LIMIT_SWITCH: "a limit switch was hit",
    Reason.STALE_PANEL: "the emergency stop could not be read any more",
    Reason.BRAKE_LOST: "the brake's current was not what it was told to be",
    Reason.STALE_BRAKE: "the brake's current was too old",
    Reason.COUPLING_SLIP: "motor and shaft were further apart than the driveline can twist",
    Reason.LOAD_CELL_OVERLOAD: "the load cell was loaded beyond its range",
    Reason.SHAFT_ENCODER_JUMP: "the shaft's encoder jumped: it slipped or lost counts",
    Reason.CURRENT_DISAGREES: "the drive's current was not the commanded one",
    Reason.SURGE_CURRENT_DISAGREES: "the surge drive's current was not the commanded one",
    Reason.VELOCITY_DISAGREES: "the motor did not turn at the commanded velocity",
    Reason.FORCE_DISAGREES: "motor current and the force sensor at its shaft did not go together",
    Reason.POWER_SIGN: "the motor fed energy into the body, under a law that can only absorb",
    Reason.POWER_BALANCE: "two stations reported powers that no loss between them explains",
}


def mode_stamp(mode: str) -> str:
    """What every picture says about who played the plant."""
    return _MODES.get(mode, mode.upper() if mode else "MODE NOT RECORDED")


def reason_text(reason: str) -> str:
    """A stop reason, given by name, in plain words; an unknown one as it is."""
    try:
        return REASONS[Reason[reason]]
    except KeyError:
        return reason or REASONS[Reason.NONE]


def signed(value: float, digits: int = 0) -> str:
    """A number with its sign and a true minus; zero has no sign."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        return text[1:]
    return text.replace("-", "\N{MINUS SIGN}")


def watts(value: float, error: float = float("nan")) -> str:
    """A power with its standard error where that is known, W: both to the same decimals."""
    if not math.isfinite(error):
        return f"{signed(value, 1 if abs(value) < 100.0 else 0)} W"
    digits = 0 if error >= 9.5 else 1 if error >= 0.095 else 2
    size = f"{error:.{digits}f}" if error >= 0.005 else "<0.01"
    return f"{signed(value, digits)} ± {size} W"  # a plus says that power is consumed


def utc(text: str) -> str:
    """An ISO 8601 time in UTC as people write it, to the second; other text as it is."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return text
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


def spring_text(rate: float, stator: float) -> str:
    """Spring rate and stator position of a panel's title."""
    return f"spring {signed(rate)} N/m, stator {signed(stator)} %"
