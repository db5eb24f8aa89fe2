"""What an operator sees while a run goes on."""

import sys
import time
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rig.campaign import Plan
from rig.safety import STOP_2, Mode, Reason
from rig.sequence import NO_ROW, Phase
from rig.supervisor import Snapshot

_EVERY = 10.0  # s between lines where there is no terminal
_STAMP = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def clock_text(seconds: float) -> str:
    """Seconds as h:mm:ss or m:ss."""
    whole = max(0, round(seconds))
    hours, rest = divmod(whole, 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes}:{left:02d}"


def _losses(snapshot: Snapshot) -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


def _probe_words(snapshot: Snapshot) -> str:
    levels = (snapshot.row[f"probes.probe_{number}"] for number in (1, 2, 3))
    return "   ".join(f"{n}: {1e3 * level:+6.1f} mm" for n, level in enumerate(levels, 1))


class Progress:
    """Draws snapshots: a live panel on a terminal, a line now and then elsewhere."""

    def __init__(self, title: str, rung: str, plan: Plan, *, quiet: bool) -> None:
        self._title, self._rung, self._plan = title, rung, plan
        self._quiet = quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._drawn = self._console.is_terminal and not quiet
        self._began = time.monotonic()
        self._said = self._began
        self._last_row = NO_ROW
        self._noticed = ""
        self.notice = ""  # what was asked of the run, e.g. after Ctrl-C

    def __enter__(self) -> "Progress":
        if self._drawn:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._drawn:
            self._live.stop()

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the run as it stands."""
        if self._quiet:
            return
        if not self._drawn and self.notice != self._noticed:
            self._noticed = self.notice
            print(self.notice, file=sys.stderr, flush=True)
        if not snapshot.row:
            return
        if self._drawn:
            self._live.update(self._panel(snapshot), refresh=True)
            return
        now, row = time.monotonic(), int(snapshot.row["plan.row"])
        if now - self._said >= _EVERY or (row != self._last_row and now - self._said >= 1.0):
            self._said, self._last_row = now, row
            print(self._line(snapshot), file=sys.stderr, flush=True)

    def _panel(self, snapshot: Snapshot) -> Group:
        row = snapshot.row
        done, whole = float(row["time"]), self._whole(snapshot)
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self._at(snapshot))
        mode = Mode(int(row["safety.mode"]))
        reason = Reason(int(row["safety.reason"]))
        state = Text(mode.name, style="green" if mode < STOP_2 else "bold red")
        if reason is not Reason.NONE:
            state.append(f"  {reason.name}", style="bold red")
        table.add_row("mode", state)
        if self._plan.rows:
            table.add_row(
                "motion",
                f"x {1e3 * row['heave.estimate.position']:+7.1f} mm   "
                f"v {row['heave.estimate.velocity']:+6.3f} m/s   "
                f"F {row['heave.command.force']:+8.1f} N   "
                f"i {row['heave.command.current']:+6.2f} A",
            )
            table.add_row("power", self._power_words(snapshot))
        else:
            table.add_row("probes", _probe_words(snapshot))
        table.add_row("time", self._time_words(snapshot))
        health = f"{_losses(snapshot)}, {snapshot.behind} rows not yet on disk"
        table.add_row("health", health)
        stamp = Text(f"{self._title}   ", style="bold")
        stamp.append(_STAMP.get(self._rung, self._rung.upper()), style="black on yellow")
        bar = Table.grid()
        bar.add_row(ProgressBar(total=whole, completed=min(done, whole), width=72))
        parts: list[Text | Table] = [stamp, bar, table]
        for text in (snapshot.trouble, self.notice):
            if text:
                parts.append(Text(text, style="bold red"))
        return Group(*parts)

    def _at(self, snapshot: Snapshot) -> tuple[str, str]:
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
            ended = Reason(int(snapshot.row["safety.reason"])) in (Reason.NONE, Reason.PLAN_END)
            return f"all {count} walked" if ended else f"- of {count}   stopped"
        if row == NO_ROW:
            return f"- of {count}   {phase}"
        point = self._plan.rows[row].setting
        return (
            f"{row} ({row + 1} of {count})   {phase}   Kp {point.kp:g} N s/m   "
            f"Ki {point.ki:g} N/m   spring {point.spring_rate:g} N/m"
        )

    def _power_words(self, snapshot: Snapshot) -> str:
        row = snapshot.row
        if row["power.samples"] == 0:
            return "not measuring"
        return (
            f"so far {row['power.mean_mechanical_1']:+8.2f} W mechanical   "
            f"{row['power.mean_ac']:+8.2f} W AC   {row['power.mean_dc']:+8.2f} W DC"
        )

    def _whole(self, snapshot: Snapshot) -> float:
        """Seconds of the whole run: as planned, and what was waited for before the waves."""
        planned, waves = self._plan.duration, float(snapshot.row.get("plan.wave_clock", -1.0))
        if waves < 0.0:
            return planned
        calm = float(snapshot.row["time"]) - waves
        return planned + max(0.0, calm - (planned - self._plan.wave_seconds))

    def _time_words(self, snapshot: Snapshot) -> str:
        done = float(snapshot.row["time"])
        whole = max(done, self._whole(snapshot))  # the stop at the end is not in the plan
        speed = done / max(time.monotonic() - self._began, 1e-3)
        return (
            f"{clock_text(done)} of {clock_text(whole)} rig time, "
            f"{clock_text((whole - done) / max(speed, 1e-6))} left at {speed:.1f} x real time"
        )

    def _line(self, snapshot: Snapshot) -> str:
        told = self._power_words(snapshot)
        if not self._plan.rows:
            told = f"probes {_probe_words(snapshot)}"
        return (
            f"{self._time_words(snapshot)}  {' '.join(self._at(snapshot))}  "
            f"{told}  {_losses(snapshot)}" + (f"  {snapshot.trouble}" if snapshot.trouble else "")
        )
