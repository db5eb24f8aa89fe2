"""Progress display of a running session of the bench."""

from math import pi

from rig.cli.run_panel import RunPanel, plan_end_text
from rig.kinds.oswec_bench.sessions import SessionPlan
from rig.processes.run_types import Snapshot
from rig.realtime.sequence import NO_ROW, Phase

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


class SessionProgress(RunPanel):
    """Displays the row of a session, and the state of motor, shaft, load cell and brake."""

    def __init__(self, title: str, mode: str, plan: SessionPlan, *, quiet: bool) -> None:
        super().__init__(title, mode, plan, quiet=quiet)
        self._plan = plan

    def plan_position(self, snapshot: Snapshot) -> tuple[str, str]:
        """Return the row and its set point."""
        row, phase = int(snapshot.row["plan.row"]), Phase(int(snapshot.row["plan.phase"]))
        count = len(self._plan.rows)
        if phase is Phase.DONE:
            return "row", plan_end_text(snapshot, count)
        if row == NO_ROW:
            return "row", f"- of {count}   {phase.name.lower()}"
        set_point = self._plan.rows[row].values
        set_point_text = "   ".join(f"{value:g} {_UNITS[key]}" for key, value in set_point.items())
        return "row", f"{row} ({row + 1} of {count})   {phase.name.lower()}   {set_point_text}"

    def detail_lines(self, snapshot: Snapshot) -> list[tuple[str, str]]:
        """Return the motion, and the commands of drive and brake."""
        row = snapshot.row
        torque = row["load.tz"] - row["tared.torque"]
        motion = (
            f"motor {_DEGREES * row['motor.angle']:+7.2f} deg   "
            f"shaft {_DEGREES * row['shaft.angle']:+7.2f} deg   "
            f"{row['shaft.velocity']:+6.3f} rad/s   {torque:+7.2f} N m"
        )
        drive = (
            f"{row['command.volts']:+6.3f} V   {row['command.current']:+6.2f} A   "
            f"brake {row['command.brake_current']:5.3f} A, "
            f"{row['command.brake_torque']:5.1f} N m"
        )
        return [("motion", motion), ("drive", drive)]

    def short_text(self, snapshot: Snapshot) -> str:
        """Return shaft angle and torque."""
        row = snapshot.row
        torque = row["load.tz"] - row["tared.torque"]
        return f"shaft {_DEGREES * row['shaft.angle']:+.2f} deg, {torque:+.2f} N m"
