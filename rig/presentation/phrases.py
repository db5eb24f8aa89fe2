"""Names and phrases shared by pictures and reports."""

import math
from datetime import UTC, datetime

from rig.realtime.safety import Reason

_MODE_STAMPS = {
    "batch": "BATCH: simulated plant, no clock",
    "rehearsal": "REHEARSAL: simulated plant",
    "hil": "HIL: emulated devices on real wires",
    "hardware": "HARDWARE",
    "imported": "IMPORTED: recorded by another system",
}

REASONS = {
    Reason.NONE: "no reason recorded",
    Reason.PLAN_END: "the plan ran to its end",
    Reason.OPERATOR_STOP: "the operator stopped the run",
    Reason.OPERATOR_ABORT: "the operator aborted the run (power off at once)",
    Reason.SUPERVISOR_LOST: (
        "`rig run` stopped sending its heartbeat: killed, suspended, or delayed by a busy host"
    ),
    Reason.LOGGER_LOST: "the record could not be written: logger, disk or folder was lost",
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
    Reason.BRAKE_LOST: "the brake's current was not the commanded one",
    Reason.STALE_BRAKE: "the brake's current was too old",
    Reason.COUPLING_SLIP: "motor and shaft differed by more than the possible driveline twist",
    Reason.LOAD_CELL_OVERLOAD: "the load cell was loaded beyond its range",
    Reason.SHAFT_ENCODER_JUMP: "the shaft's encoder jumped: it slipped or lost counts",
    Reason.CURRENT_DISAGREES: "the drive's current was not the commanded one",
    Reason.SURGE_CURRENT_DISAGREES: "the surge drive's current was not the commanded one",
    Reason.VELOCITY_DISAGREES: "the motor did not turn at the commanded velocity",
    Reason.FORCE_DISAGREES: "motor current and the force sensor at the motor shaft disagreed",
    Reason.POWER_SIGN: "the motor fed energy into the body, under a law that can only absorb",
    Reason.POWER_BALANCE: "two stations reported powers that no loss between them explains",
}


def mode_stamp(mode: str) -> str:
    """Return the stamp of an execution mode, which names the kind of plant."""
    return _MODE_STAMPS.get(mode, mode.upper() if mode else "MODE NOT RECORDED")


def reason_text(reason: str) -> str:
    """Return the description of a stop reason given by name; an unknown name unchanged."""
    try:
        return REASONS[Reason[reason]]
    except KeyError:
        return reason or REASONS[Reason.NONE]


def format_signed(value: float, digits: int = 0) -> str:
    """Return a number with its sign and a typographic minus; zero has no sign."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        return text[1:]
    return text.replace("-", "\N{MINUS SIGN}")


def format_power(value: float, error: float = float("nan")) -> str:
    """Return a power (W) with its standard error if known, both with the same decimals."""
    if not math.isfinite(error):
        return f"{format_signed(value, 1 if abs(value) < 100.0 else 0)} W"
    digits = 0 if error >= 9.5 else 1 if error >= 0.095 else 2
    size = f"{error:.{digits}f}" if error >= 0.005 else "<0.01"
    return f"{format_signed(value, digits)} ± {size} W"  # plus: consumed


def format_utc(text: str) -> str:
    """Return an ISO 8601 time as readable UTC to the second; other text unchanged."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return text
    return f"{moment.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


def spring_text(rate: float, stator: float) -> str:
    """Return spring rate (N/m) and stator position (%) as the title of a panel."""
    return f"spring {format_signed(rate)} N/m, stator {format_signed(stator)} %"
