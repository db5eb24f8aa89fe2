"""The panel of a run on a terminal, and its lines where there is no terminal."""

import sys
import time
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rig.presentation.phrases import clock_text
from rig.realtime.reasons import Reason
from rig.realtime.safety import STOP_2, Mode
from rig.realtime.sequence import NO_ROW

if TYPE_CHECKING:
    from rig.kinds.interface import Display
    from rig.processes.run_types import Snapshot

_LINE_INTERVAL_S = 10.0  # s between lines where there is no terminal
_MODE_LABELS = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def _loss_text(snapshot: "Snapshot") -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


class RunPanel:
    """Draws snapshots: a live panel on a terminal, a line every 10 s elsewhere.

    The rig's position, motion and power are those of its kind's room `display`.
    """

    def __init__(
        self, title: str, mode: str, plan: Any, display: "Display", *, quiet: bool
    ) -> None:
        self._title, self._mode, self._plan, self._display = title, mode, plan, display
        self._quiet = quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live_display = self._console.is_terminal and not quiet
        self._start_time = time.monotonic()
        self._last_line_time = self._start_time
        self._last_row = NO_ROW
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
        if self._quiet:
            return
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
        now, row = time.monotonic(), int(snapshot.row["plan.row"])
        if now - self._last_line_time >= _LINE_INTERVAL_S or (
            row != self._last_row and now - self._last_line_time >= 1.0
        ):
            self._last_line_time, self._last_row = now, row
            print(self._line(snapshot), file=sys.stderr, flush=True)

    def _panel(self, snapshot: "Snapshot") -> Group:
        row = snapshot.row
        elapsed, total = float(row["time"]), self._display.total_duration(self._plan, row)
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self._display.plan_position(self._plan, row))
        mode = Mode(int(row["safety.mode"]))
        state = Text(mode.name, style="green" if mode < STOP_2 else "bold red")
        if int(row["safety.reason"]) != Reason.NONE:
            state.append(f"  {snapshot.reason}", style="bold red")
        table.add_row("mode", state)
        for label, text in self._display.detail_lines(self._plan, row, self._measured):
            table.add_row(label, text)
        table.add_row("time", self._time_text(snapshot))
        health = f"{_loss_text(snapshot)}, {snapshot.unsaved_rows} rows not yet on disk"
        table.add_row("health", health)
        heading = Text(f"{self._title}   ", style="bold")
        heading.append(_MODE_LABELS.get(self._mode, self._mode.upper()), style="black on yellow")
        bar = Table.grid()
        bar.add_row(ProgressBar(total=total, completed=min(elapsed, total), width=72))
        parts: list[Text | Table] = [heading, bar, table]
        for text in (snapshot.problem, self.notice):
            if text:
                parts.append(Text(text, style="bold red"))
        return Group(*parts)

    def _time_text(self, snapshot: "Snapshot") -> str:
        elapsed = float(snapshot.row["time"])
        planned = self._display.total_duration(self._plan, snapshot.row)
        total = max(elapsed, planned)  # the stop at the end is not in the plan
        speed = elapsed / max(time.monotonic() - self._start_time, 1e-3)
        return (
            f"{clock_text(elapsed)} of {clock_text(total)} rig time, "
            f"{clock_text((total - elapsed) / max(speed, 1e-6))} left at {speed:.1f} x real time"
        )

    def _line(self, snapshot: "Snapshot") -> str:
        position = " ".join(self._display.plan_position(self._plan, snapshot.row))
        motion = self._display.short_text(self._plan, snapshot.row, self._measured)
        return f"{self._time_text(snapshot)}  {position}  {motion}  {_loss_text(snapshot)}" + (
            f"  {snapshot.problem}" if snapshot.problem else ""
        )
