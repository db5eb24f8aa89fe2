"""The panel of a run on a terminal, and its lines where there is no terminal."""

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rig.presentation.phrases import clock_text, state_text, unit_text
from rig.realtime.reasons import Reason
from rig.realtime.safety import OFF, STOP_2, Mode
from rig.realtime.sequence import NO_ROW, STANDBY

if TYPE_CHECKING:
    from rig.kinds.interface import Display
    from rig.processes.run_types import Snapshot

_MODE_LABELS = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def _loss_text(snapshot: "Snapshot") -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


def _without_operator(people: dict[str, Any]) -> str:
    limit = people.get("dead_man_s")
    stops = "" if limit is None else f"; without one the rig holds, and stops after {limit:g} s"
    return f"nobody{stops}"


class RunPanel:
    """Draws snapshots: a live panel on a terminal; elsewhere a line for each finished row.

    The rig's position, motion and power are those of its kind's room `display`. In manual mode the
    lines are those of set points, and of what the run waits for.
    """

    def __init__(
        self,
        title: str,
        mode: str,
        plan: Any,
        display: "Display",
        on_start: Callable[[], None] = lambda: None,
        *,
        quiet: bool,
    ) -> None:
        """``on_start`` is called with the first row of the run; ``quiet``: draw nothing."""
        self._title, self._mode, self._plan, self._display = title, mode, plan, display
        self._on_start, self._started, self._quiet = on_start, False, quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live_display = self._console.is_terminal and not quiet
        self._start_time = time.monotonic()
        self._last: dict[str, float | int] = {}  # newest row but one
        self._last_lines: list[tuple[str, str]] = []  # of people, where there is no terminal
        self.columns: list[dict[str, Any]] = []  # of set points that people choose
        self.part = ""  # of the campaign that the plan is; empty: all of it
        self._measured: dict[str, float | int] = {}  # newest row in a measured window
        self._printed_notice = ""
        self.notice = ""  # the pending request to the run, e.g. after Ctrl-C

    def __enter__(self) -> "RunPanel":
        if self._live_display:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live_display:
            self._live.stop()

    def __call__(self, snapshot: "Snapshot") -> None:
        """Draw the current state of the run."""
        if snapshot.row and not self._started:
            self._started = True
            self._on_start()
        if self._quiet:
            return
        last, self._last = self._last, snapshot.row or self._last
        measured = self._measured  # before this snapshot, which may be of the next row
        if snapshot.row.get("power.samples", 0) > 0:
            self._measured = snapshot.row
        if not self._live_display and self.notice != self._printed_notice:
            self._printed_notice = self.notice
            print(self.notice, file=sys.stderr, flush=True)
        if not snapshot.row:
            return
        if self._live_display:
            self._live.update(self._panel(snapshot), refresh=True)
            return
        phase_changed = last.get("plan.phase") != snapshot.row["plan.phase"]
        if not self._plan.rows and phase_changed:
            self._print_position(snapshot, snapshot.row, self._measured)
        elif last and last["plan.row"] not in (NO_ROW, snapshot.row["plan.row"]):
            same_row = measured.get("plan.row") == last["plan.row"]
            self._print_position(snapshot, last, measured if same_row else {})
        if self._waits_for_people(snapshot) or snapshot.people.get("set_number"):
            lines = self._people_lines(snapshot)
            if lines != self._last_lines:
                self._last_lines = lines
                motion = self._display.short_text(self._plan, snapshot.row, self._measured)
                self._print(snapshot, "  ".join(" ".join(line) for line in lines), motion)

    def _print_position(
        self, snapshot: "Snapshot", row: dict[str, Any], measured: dict[str, Any]
    ) -> None:
        """Print position and powers of one row of the log; ``measured``: its set point, as seen."""
        position = " ".join(self._display.plan_position(self._plan, row))
        self._print(snapshot, position, self._display.short_text(self._plan, row, measured))

    def _print(self, snapshot: "Snapshot", *texts: str) -> None:
        parts = [self._time_text(snapshot), *texts, _loss_text(snapshot), snapshot.problem]
        print("  ".join(filter(None, parts)), file=sys.stderr, flush=True)

    def _waits_for_people(self, snapshot: "Snapshot") -> bool:
        """Return whether the end of the run depends on people: manual mode, or standby."""
        return bool(snapshot.people.get("manual")) or snapshot.row["plan.phase"] == STANDBY

    def _people_lines(self, snapshot: "Snapshot") -> list[tuple[str, str]]:
        """Return labels and texts of operator, arming and set point."""
        people, lines = snapshot.people, list[tuple[str, str]]()
        if people.get("manual") or people.get("operator"):
            lines.append(("operator", people["operator"] or _without_operator(people)))
        if snapshot.row["plan.phase"] == STANDBY:
            ask = "confirm" if people.get("arming") else "arm"
            lines.append(("standby", f"power off; to go on: rig request {ask}"))
        elif snapshot.row["safety.mode"] > OFF and people.get("must_arm"):
            lines.append(("armed", "power on"))
        if people.get("set"):
            values, signal = people["set"]["values"], people["set"]["signal"]
            text = self._columns_text("values", values)
            if signal.get("kind", "none") != "none":
                text += "   " + self._columns_text("signal", signal)
            number = int(snapshot.row["plan.live"])
            state = "in force" if number == people["set_number"] != 0 else "not yet in force"
            lines.append(("set point", f"{people['set_number'] or '-'} {state}   {text}"))
        lines += [("notice", each["text"]) for each in people.get("notices", [])[-1:]]
        return lines

    def _columns_text(self, part: str, values: dict[str, Any]) -> str:
        """Return the values of a set point with the labels and units of their columns."""
        return "   ".join(
            f"{each['label']} {values[each['key']]} {unit_text(each.get('unit', ''))}".strip()
            for each in self.columns
            if each["part"] == part and each["key"] in values
        )

    def _panel(self, snapshot: "Snapshot") -> Group:
        row = snapshot.row
        elapsed, total = float(row["time"]), self._display.total_duration(self._plan, row)
        people = self._people_lines(snapshot) if snapshot.people else []
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self._display.plan_position(self._plan, row))
        mode = Mode(int(row["safety.mode"]))
        state = Text(state_text(mode), style="green" if mode < STOP_2 else "bold red")
        if int(row["safety.reason"]) != Reason.NONE:
            state.append(f"  {snapshot.reason}", style="bold red")
        table.add_row("state", state)
        for label, text in people:
            table.add_row(label, text)
        for label, text in self._display.detail_lines(self._plan, row, self._measured):
            table.add_row(label, text)
        table.add_row("time", self._time_text(snapshot))
        health = f"{_loss_text(snapshot)}, {snapshot.unsaved_rows} rows not yet on disk"
        table.add_row("health", health)
        heading = Text(f"{self._title}   ", style="bold")
        heading.append(_MODE_LABELS.get(self._mode, self._mode.upper()), style="black on yellow")
        bar = Table.grid()
        bar.add_row(ProgressBar(total=total, completed=min(elapsed, total), width=72))
        ends = not self._waits_for_people(snapshot)
        parts: list[Text | Table] = [heading, bar, table] if ends else [heading, table]
        for text in (snapshot.problem, self.notice):
            if text:
                parts.append(Text(text, style="bold red"))
        return Group(*parts)

    def _time_text(self, snapshot: "Snapshot") -> str:
        """Return elapsed and remaining time, and whether the tick is not compiled yet."""
        text = self._remaining_text(snapshot)
        return f"{text} (interpreted, compiling)" if snapshot.compiling else text

    def _remaining_text(self, snapshot: "Snapshot") -> str:
        elapsed = float(snapshot.row["time"])
        if self._waits_for_people(snapshot):
            return f"{clock_text(elapsed)} rig time"
        planned = self._display.total_duration(self._plan, snapshot.row)
        total = max(elapsed, planned)  # the stop at the end is not in the plan
        speed = elapsed / max(time.monotonic() - self._start_time, 1e-3)
        # Rows may end as measured, before their longest time.
        least = getattr(self._plan, "least_duration", planned)
        most = "at most " if least < self._plan.duration else ""
        return (
            f"{clock_text(elapsed)} of {most}{clock_text(total)} rig time{self.part}, "
            f"{most}{clock_text((total - elapsed) / max(speed, 1e-6))} left at "
            f"{speed:.1f} x real time"
        )
