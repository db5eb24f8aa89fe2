"""Progress display of a running campaign."""

from rig.cli.run_panel import RunPanel, clock_text, plan_end_text
from rig.kinds.wavebot.campaign import Plan
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.processes.run_types import Snapshot
from rig.realtime.sequence import NO_ROW, Phase


def _probe_text(snapshot: Snapshot) -> str:
    levels = (snapshot.row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))


def _mean_power_text(snapshot: Snapshot) -> str:
    means = (
        f"{snapshot.row[f'power.mean_{station.name}']:+8.2f} W {station.name_in_text}"
        for station in STATIONS
        if station.running_mean
    )
    return "   ".join(means)


class Progress(RunPanel):
    """Displays the row, motion and power of a campaign."""

    def __init__(self, title: str, mode: str, plan: Plan, *, quiet: bool) -> None:
        super().__init__(title, mode, plan, quiet=quiet)
        self._plan = plan
        self._last_measured = ""  # power of the last row in its measured window

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the current state, and keep the row's mean power to show it after the row."""
        if snapshot.row and snapshot.row.get("power.samples", 0) > 0:
            power = _mean_power_text(snapshot)
            self._last_measured = f"row {int(snapshot.row['plan.row'])} when last seen {power}"
        super().__call__(snapshot)

    def detail_lines(self, snapshot: Snapshot) -> list[tuple[str, str]]:
        """Return motion and power of heave, or the probe levels of a run without the device."""
        row = snapshot.row
        if not self._plan.rows:
            return [("probes", _probe_text(snapshot))]
        motion = (
            f"x {1e3 * row['heave.estimate.position']:+7.1f} mm   "
            f"v {row['heave.estimate.velocity']:+6.3f} m/s   "
            f"F {row['heave.command.force']:+8.1f} N   "
            f"i {row['heave.command.current']:+6.2f} A"
        )
        return [("motion", motion), ("power", self._power_text(snapshot))]

    def short_text(self, snapshot: Snapshot) -> str:
        """Return the power, or the probe levels of a run without the device."""
        if not self._plan.rows:
            return f"probes {_probe_text(snapshot)}"
        return self._power_text(snapshot)

    def plan_position(self, snapshot: Snapshot) -> tuple[str, str]:
        """Return a label and the text of the position in the plan."""
        if self._plan.rows:
            return "row", self._row_text(snapshot)
        return "waves", self._waves_text(snapshot)

    def _waves_text(self, snapshot: Snapshot) -> str:
        """Return the phase of a plan without rows: lead-in or measurement, with its time."""
        phase, phases = Phase(int(snapshot.row["plan.phase"])), self._plan.phases
        if phase not in (Phase.LEAD_IN, Phase.MEASURE):
            return f"without the device   {phase.name.lower()}"
        waves = max(0.0, float(snapshot.row["plan.wave_clock"]))
        if phase is Phase.LEAD_IN:
            elapsed, total, label = waves, phases.lead_in, "building up"
        else:
            elapsed, total, label = waves - phases.lead_in, phases.measure, "measuring the probes"
        return f"without the device   {label}, {clock_text(elapsed)} of {clock_text(total)}"

    def _row_text(self, snapshot: Snapshot) -> str:
        row = int(snapshot.row["plan.row"])
        phase = Phase(int(snapshot.row["plan.phase"])).name.lower().replace("_", "-")
        count = len(self._plan.rows)
        if phase == Phase.DONE.name.lower():
            return plan_end_text(snapshot, count)
        if row == NO_ROW:
            return f"- of {count}   {phase}"
        setting = self._plan.rows[row].setting
        gains = "   ".join(
            f"{each.label} {getattr(setting, each.name):g} {each.unit.replace('*', ' ')}"
            for each in self._plan.law.columns
            if each.default is None
        )
        return (
            f"{row} ({row + 1} of {count})   {phase}   {gains}   spring {setting.spring_rate:g} N/m"
        )

    def _power_text(self, snapshot: Snapshot) -> str:
        if snapshot.row["power.samples"] == 0:
            return self._last_measured or "not measuring"
        return f"so far {_mean_power_text(snapshot)}"

    def total_duration(self, snapshot: Snapshot) -> float:
        """Return the duration of the run (s): as planned, plus the wait before the waves."""
        planned, waves = self._plan.duration, float(snapshot.row.get("plan.wave_clock", -1.0))
        if waves < 0.0:
            return planned
        wait_before_waves = float(snapshot.row["time"]) - waves
        return planned + max(0.0, wait_before_waves - (planned - self._plan.wave_seconds))
