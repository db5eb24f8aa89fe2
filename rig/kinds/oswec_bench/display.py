"""Texts of a session of the bench for people: the report of `rig check`, and a run in progress."""

from math import pi
from typing import Any

from rig.kinds.oswec_bench.config.session_file import SESSION_COLUMNS
from rig.kinds.oswec_bench.sessions.check import SessionReport
from rig.kinds.oswec_bench.sessions.plan import SessionPlan
from rig.kinds.oswec_bench.tick.signals import TORQUE, VELOCITY, DriveMode
from rig.kinds.oswec_bench.tick.stations import STATIONS
from rig.log_fields import RATE, FieldLimit, LogFields, age_limit, current_limits
from rig.presentation.campaign_text import ShownField, fields_text, power_text, set_point_text
from rig.presentation.phrases import phase_text, plan_end_text, unit_text
from rig.realtime.sequence import NO_ROW, Phase

LogRow = dict[str, float | int]

_DEGREES = 180.0 / pi
_LABELS = {
    "servo": "drive",
    "servo.current": "motor measured current",
    "load": "load cell",
    "tared.torque": "load cell zero",
    "command.mode": "drive mode",
    "command.velocity": "motor commanded velocity",
    "command.volts": "drive command",
    "command.torque": "motor torque",
    "command.current": "motor current",
    "command.brake_torque": "brake torque",
    "command.brake_current": "brake current",
    "brake.current": "brake measured current",
}
_MOTION = (
    ShownField("motor.angle", "+7.2f", "deg", _DEGREES),
    ShownField("shaft.angle", "+7.2f", "deg", _DEGREES),
    ShownField("shaft.velocity", "+6.3f", "rad/s"),
)
_DRIVE = (
    ShownField("command.volts", "+6.3f", "V"),
    ShownField("command.current", "+6.2f", "A"),
    ShownField("command.brake_current", "5.3f", "A"),
    ShownField("command.brake_torque", "5.1f", "N·m"),
)
_RADIANS = 1.0 / _DEGREES
_POWERED = ("command.enable", 1)
_TORQUE_LOOP = (_POWERED, ("command.mode", TORQUE))
_LIMITS = (
    FieldLimit("motor.angle_stop_deg", "motor.angle", warn="motor.angle_warn_deg", scale=_RADIANS),
    FieldLimit("motor.velocity_stop_rad_per_s", "motor.velocity"),
    FieldLimit("motor.velocity_command_rad_per_s", "command.velocity", stops=False),
    FieldLimit("motor.acceleration_rad_per_s2", "command.velocity", quantity=RATE, stops=False),
    *current_limits("motor", "command.current", "servo.current", _TORQUE_LOOP),
    FieldLimit("motor.current_slew_a_per_s", "command.current", quantity=RATE, stops=False),
    FieldLimit(
        "motor.velocity_difference_stop_rad_per_s",
        "motor.velocity",
        commanded="command.velocity",
        stops=False,
        where=(_POWERED, ("command.mode", VELOCITY)),
    ),
    FieldLimit(
        "shaft.slip_stop_deg",
        "motor.angle",
        less=("shaft.angle",),
        scale=_RADIANS,
        label="slip of the coupling",
    ),
    *(FieldLimit("load_cell.across_stop_n", f"load.{name}") for name in ("fx", "fy")),
    FieldLimit("load_cell.along_stop_n", "load.fz"),
    *(FieldLimit("load_cell.bending_stop_n_m", f"load.{name}") for name in ("tx", "ty")),
    FieldLimit("load_cell.twisting_stop_n_m", "load.tz"),
    FieldLimit(
        "brake.difference_stop_a",
        "brake.current",
        commanded="command.brake_current",
        stops=False,
        where=(_POWERED,),
    ),
    FieldLimit("authority.angle_deg", "correction.angle", stops=False, scale=_RADIANS),
    FieldLimit("authority.velocity_rad_per_s", "correction.velocity", stops=False),
    FieldLimit(
        "authority.torque_n_m",
        "demand.torque",
        less=("reference.torque",),
        stops=False,
        where=_TORQUE_LOOP,
        label="torque feedback",
    ),
    age_limit("motor.encoder_age_stop_s", "encoders.age"),
    age_limit("motor.drive_age_stop_s", "servo.age"),
    age_limit("loop.load_cell_age_stop_s", "load.age"),
    age_limit("brake.age_stop_s", "brake.age"),
)


def log_fields(rig: Any) -> LogFields:
    """Return labels and limits of the log fields, and the labels of a session's set points."""
    settings = {each.key: (each.label, unit_text(each.unit)) for each in SESSION_COLUMNS}
    return LogFields(_LABELS, _LIMITS, settings, {"command.mode": tuple(DriveMode.__members__)})


def show_report(report: SessionReport, *, every_row: bool) -> None:
    """Print the report of `rig check`; the rows of a session have no predictions to show."""
    print(report.text())


def plan_position(plan: SessionPlan, row: LogRow) -> tuple[str, str]:
    """Return the row and its set point."""
    number, phase = int(row["plan.row"]), Phase(int(row["plan.phase"]))
    count = len(plan.rows)
    if phase is Phase.DONE:
        return "row", plan_end_text(row, count)
    if phase is Phase.MANUAL:
        return "row", f"manual   set point {int(row['plan.live'])}"
    if number == NO_ROW:
        return "row", f"- of {count}   {phase_text(phase)}"
    values = plan.rows[number].values
    by_name = {each.name: values[each.key] for each in SESSION_COLUMNS if each.key in values}
    columns = (each for each in SESSION_COLUMNS if each.name in by_name)
    text = set_point_text(columns, by_name)
    return "row", f"{number} ({number + 1} of {count})   {phase_text(phase)}   {text}"


def detail_lines(plan: SessionPlan, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return the motion, the commands of drive and brake, and the mean power."""
    return [
        ("motion", f"{fields_text(row, _MOTION, _LABELS)}   {_torque_text(row)}"),
        ("drive", fields_text(row, _DRIVE, _LABELS)),
        ("power", power_text(plan, row, measured, STATIONS)),
    ]


def short_text(plan: SessionPlan, row: LogRow, measured: LogRow) -> str:
    """Return shaft angle and torque."""
    return f"{fields_text(row, _MOTION[1:2], _LABELS)}   {_torque_text(row)}"


def total_duration(plan: SessionPlan, row: LogRow) -> float:
    """Return the planned duration, s."""
    return plan.duration


def _torque_text(row: LogRow) -> str:
    return f"torque {row['load.tz'] - row['tared.torque']:+7.2f} N·m"
