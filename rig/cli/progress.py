"""What an operator sees while a campaign runs."""

from rig.cli.run_panel import RunPanel, clock_text, walked_words
from rig.planning.campaign import Plan
from rig.processes.run_types import Snapshot
from rig.realtime.sequence import NO_ROW, Phase


def _probe_words(snapshot: Snapshot) -> str:
    levels = (snapshot.row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))


def _mean_powers(snapshot: Snapshot) -> str:
    row = snapshot.row
    return (
        f"{row['power.mean_mechanical_1']:+8.2f} W mechanical   "
        f"{row['power.mean_ac']:+8.2f} W AC   {row['power.mean_dc']:+8.2f} W DC"
    )


class Progress(RunPanel):
    """A campaign: its row, motion, and power."""

    def __init__(self, title: str, mode: str, plan: Plan, *, quiet: bool) -> None:
        super().__init__(title, mode, plan, quiet=quiet)
        self._plan = plan
        self._measured = ""  # the last row that was seen measuring, and its power

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the run as it stands, and keep what the row measured for when it is over."""
        if snapshot.row and snapshot.row.get("power.samples", 0) > 0:
            power = _mean_powers(snapshot)
            self._measured = f"row {int(snapshot.row['plan.row'])} when last seen {power}"
        super().__call__(snapshot)

    def scene(self, snapshot: Snapshot) -> list[tuple[str, str]]:
        """Motion and power of heave; without the device the probes."""
        row = snapshot.row
        if not self._plan.rows:
            return [("probes", _probe_words(snapshot))]
        motion = (
            f"x {1e3 * row['heave.estimate.position']:+7.1f} mm   "
            f"v {row['heave.estimate.velocity']:+6.3f} m/s   "
            f"F {row['heave.command.force']:+8.1f} N   "
            f"i {row['heave.command.current']:+6.2f} A"
        )
        return [("motion", motion), ("power", self._power_words(snapshot))]

    def told(self, snapshot: Snapshot) -> str:
        """Power, or the probes."""
        if not self._plan.rows:
            return f"probes {_probe_words(snapshot)}"
        return self._power_words(snapshot)

    def at(self, snapshot: Snapshot) -> tuple[str, str]:
        """Where in the plan the run is: a label and words."""
        if self._plan.rows:
            return "row", self._row_words(snapshot)
        return "waves", self._waves_words(snapshot)

    def _waves_words(self, snapshot: Snapshot) -> str:
        """Of a plan without rows: how long the sea has built up, or its probes been measured."""
        phase, phases = Phase(int(snapshot.row["plan.phase"])), self._plan.phases
        if phase not in (Phase.LEAD_IN, Phase.MEASURE):
            return f"without the device   {phase.name.lower()}"
        waves = max(0.0, float(snapshot.row["plan.wave_clock"]))
        if phase is Phase.LEAD_IN:
            done, whole, name = waves, phases.lead_in, "building up"
        else:
            done, whole, name = waves - phases.lead_in, phases.measure, "measuring the probes"
        return f"without the device   {name}, {clock_text(done)} of {clock_text(whole)}"

    def _row_words(self, snapshot: Snapshot) -> str:
        row = int(snapshot.row["plan.row"])
        phase = Phase(int(snapshot.row["plan.phase"])).name.lower().replace("_", "-")
        count = len(self._plan.rows)
        if phase == Phase.DONE.name.lower():
            return walked_words(snapshot, count)
        if row == NO_ROW:
            return f"- of {count}   {phase}"
        point = self._plan.rows[row].setting
        return (
            f"{row} ({row + 1} of {count})   {phase}   Kp {point.kp:g} N s/m   "
            f"Ki {point.ki:g} N/m   spring {point.spring_rate:g} N/m"
        )

    def _power_words(self, snapshot: Snapshot) -> str:
        if snapshot.row["power.samples"] == 0:
            return self._measured or "not measuring"
        return f"so far {_mean_powers(snapshot)}"

    def whole(self, snapshot: Snapshot) -> float:
        """Seconds of the whole run: as planned, and what was waited for before the waves."""
        planned, waves = self._plan.duration, float(snapshot.row.get("plan.wave_clock", -1.0))
        if waves < 0.0:
            return planned
        calm = float(snapshot.row["time"]) - waves
        return planned + max(0.0, calm - (planned - self._plan.wave_seconds))
