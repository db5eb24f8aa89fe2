"""Progress display of a run, for campaigns and sessions."""

import sys
import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import TYPE_CHECKING, Protocol

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rig.realtime.reasons import Reason
from rig.realtime.safety import STOP_2, Mode
from rig.realtime.sequence import NO_ROW

if TYPE_CHECKING:
    from rig.processes.run_types import Snapshot

_LINE_INTERVAL_S = 10.0  # s between lines where there is no terminal
_MODE_LABELS = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def clock_text(seconds: float) -> str:
    """Format seconds as h:mm:ss or m:ss."""
    rounded = max(0, round(seconds))
    hours, rest = divmod(rounded, 3600)
    minutes, remaining = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{remaining:02d}" if hours else f"{minutes}:{remaining:02d}"


def plan_end_text(snapshot: "Snapshot", rows: int) -> str:
    """Return how a finished plan of ``rows`` rows ended."""
    completed = int(snapshot.row["safety.reason"]) in (Reason.NONE, Reason.PLAN_END)
    return f"all {rows} done" if completed else f"stopped before all {rows} were done"


def _loss_text(snapshot: "Snapshot") -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


class HasDuration(Protocol):
    """A plan with a duration."""

    @property
    def duration(self) -> float:
        """Planned duration, s."""
        ...


class RunPanel(ABC):
    """Draws snapshots: a live panel on a terminal, a line every 10 s elsewhere.

    A subclass describes the rig in `plan_position`, `detail_lines` and `short_text`.
    """

    def __init__(self, title: str, mode: str, plan: HasDuration, *, quiet: bool) -> None:
        self._title, self._mode, self._planned_duration = title, mode, plan.duration
        self._quiet = quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live_display = self._console.is_terminal and not quiet
        self._start_time = time.monotonic()
        self._last_line_time = self._start_time
        self._last_row = NO_ROW
        self._printed_notice = ""
        self.notice = ""  # the pending request to the run, e.g. after Ctrl-C

    def __enter__(self) -> "RunPanel":
        if self._live_display:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live_display:
            self._live.stop()

    def __call__(self, snapshot: "Snapshot") -> None:
        """Draw the current state of the run."""
        if self._quiet:
            return
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
        elapsed, total = float(row["time"]), self.total_duration(snapshot)
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self.plan_position(snapshot))
        mode = Mode(int(row["safety.mode"]))
        state = Text(mode.name, style="green" if mode < STOP_2 else "bold red")
        if int(row["safety.reason"]) != Reason.NONE:
            state.append(f"  {snapshot.reason}", style="bold red")
        table.add_row("mode", state)
        for label, text in self.detail_lines(snapshot):
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

    @abstractmethod
    def plan_position(self, snapshot: "Snapshot") -> tuple[str, str]:
        """Return a label and the text of the position in the plan."""

    @abstractmethod
    def detail_lines(self, snapshot: "Snapshot") -> list[tuple[str, str]]:
        """Return labels and texts of the rig's motion, for the panel."""

    @abstractmethod
    def short_text(self, snapshot: "Snapshot") -> str:
        """Return a short text of the rig's motion, for a line."""

    def total_duration(self, snapshot: "Snapshot") -> float:
        """Return the duration of the run, s."""
        return self._planned_duration

    def _time_text(self, snapshot: "Snapshot") -> str:
        elapsed = float(snapshot.row["time"])
        total = max(
            elapsed, self.total_duration(snapshot)
        )  # the stop at the end is not in the plan
        speed = elapsed / max(time.monotonic() - self._start_time, 1e-3)
        return (
            f"{clock_text(elapsed)} of {clock_text(total)} rig time, "
            f"{clock_text((total - elapsed) / max(speed, 1e-6))} left at {speed:.1f} x real time"
        )

    def _line(self, snapshot: "Snapshot") -> str:
        return (
            f"{self._time_text(snapshot)}  {' '.join(self.plan_position(snapshot))}  "
            f"{self.short_text(snapshot)}  {_loss_text(snapshot)}"
            + (f"  {snapshot.problem}" if snapshot.problem else "")
        )
