"""Texts of a session of the bench for people: the report of `rig check`, and a run in progress."""

from math import pi

from rig.kinds.oswec_bench.sessions.check import SessionReport
from rig.kinds.oswec_bench.sessions.plan import SessionPlan
from rig.kinds.oswec_bench.tick.stations import STATIONS
from rig.presentation.campaign_text import power_text
from rig.presentation.phrases import plan_end_text
from rig.realtime.sequence import NO_ROW, Phase

LogRow = dict[str, float | int]

_DEGREES = 180.0 / pi
_UNITS = {
    "amplitude_deg": "deg",
    "torque_amplitude_n_m": "N m",
    "current_amplitude_a": "A",
    "period_s": "s",
    "damping_n_m_s_per_rad": "N m s",
    "brake_current_a": "A on the brake",
    "release_deg": "deg let go",
    "wave_amplitude_m": "m waves",
    "pto_damping_n_m_s_per_rad": "N m s of the motor",
}


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
        return "row", f"- of {count}   {phase.name.lower()}"
    set_point = plan.rows[number].values
    set_point_text = "   ".join(f"{value:g} {_UNITS[key]}" for key, value in set_point.items())
    return "row", f"{number} ({number + 1} of {count})   {phase.name.lower()}   {set_point_text}"


def detail_lines(plan: SessionPlan, row: LogRow, measured: LogRow) -> list[tuple[str, str]]:
    """Return the motion, the commands of drive and brake, and the mean power."""
    motion = (
        f"motor {_DEGREES * row['motor.angle']:+7.2f} deg   "
        f"shaft {_DEGREES * row['shaft.angle']:+7.2f} deg   "
        f"{row['shaft.velocity']:+6.3f} rad/s   {_torque(row):+7.2f} N m"
    )
    drive = (
        f"{row['command.volts']:+6.3f} V   {row['command.current']:+6.2f} A   "
        f"brake {row['command.brake_current']:5.3f} A, "
        f"{row['command.brake_torque']:5.1f} N m"
    )
    power = power_text(row, measured, STATIONS)
    return [("motion", motion), ("drive", drive), ("power", power)]


def short_text(plan: SessionPlan, row: LogRow, measured: LogRow) -> str:
    """Return shaft angle and torque."""
    return f"shaft {_DEGREES * row['shaft.angle']:+.2f} deg, {_torque(row):+.2f} N m"


def total_duration(plan: SessionPlan, row: LogRow) -> float:
    """Return the planned duration, s."""
    return plan.duration


def _torque(row: LogRow) -> float:
    """Return the torque of the load cell, tared, N*m."""
    return row["load.tz"] - row["tared.torque"]
