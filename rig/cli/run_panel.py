"""What an operator sees while something runs, whatever it is."""

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

from rig.realtime.safety import STOP_2, Mode, Reason
from rig.realtime.sequence import NO_ROW

if TYPE_CHECKING:
    from rig.processes.run_types import Snapshot

_EVERY = 10.0  # s between lines where there is no terminal
_STAMP = {"rehearsal": "REHEARSAL, simulated plant", "hil": "HIL, emulated devices"}


def clock_text(seconds: float) -> str:
    """Seconds as h:mm:ss or m:ss."""
    whole = max(0, round(seconds))
    hours, rest = divmod(whole, 3600)
    minutes, left = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{left:02d}" if hours else f"{minutes}:{left:02d}"


def walked_words(snapshot: "Snapshot", rows: int) -> str:
    """How a plan of so many rows ended that is done."""
    ended = Reason(int(snapshot.row["safety.reason"])) in (Reason.NONE, Reason.PLAN_END)
    return f"all {rows} walked" if ended else f"stopped before all {rows} were walked"


def _losses(snapshot: "Snapshot") -> str:
    return f"{int(snapshot.row['timing.skipped'])} ticks skipped, {snapshot.dropped} rows dropped"


class Planned(Protocol):
    """What is shown of a plan, whatever it is for."""

    @property
    def duration(self) -> float:
        """Planned seconds."""
        ...


class RunPanel(ABC):
    """Draws snapshots: a live panel on a terminal, a line now and then elsewhere.

    What is shown of the rig itself, a subclass says: `at`, `scene` and `told`.
    """

    def __init__(self, title: str, mode: str, plan: Planned, *, quiet: bool) -> None:
        self._title, self._mode, self._planned = title, mode, plan.duration
        self._quiet = quiet
        self._console = Console(stderr=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._drawn = self._console.is_terminal and not quiet
        self._began = time.monotonic()
        self._said = self._began
        self._last_row = NO_ROW
        self._noticed = ""
        self.notice = ""  # what was asked of the run, e.g. after Ctrl-C

    def __enter__(self) -> "RunPanel":
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

    def __call__(self, snapshot: "Snapshot") -> None:
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

    def _panel(self, snapshot: "Snapshot") -> Group:
        row = snapshot.row
        done, whole = float(row["time"]), self.whole(snapshot)
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", min_width=8)
        table.add_column()
        table.add_row(*self.at(snapshot))
        mode = Mode(int(row["safety.mode"]))
        reason = Reason(int(row["safety.reason"]))
        state = Text(mode.name, style="green" if mode < STOP_2 else "bold red")
        if reason is not Reason.NONE:
            state.append(f"  {reason.name}", style="bold red")
        table.add_row("mode", state)
        for label, text in self.scene(snapshot):
            table.add_row(label, text)
        table.add_row("time", self._time_words(snapshot))
        health = f"{_losses(snapshot)}, {snapshot.behind} rows not yet on disk"
        table.add_row("health", health)
        stamp = Text(f"{self._title}   ", style="bold")
        stamp.append(_STAMP.get(self._mode, self._mode.upper()), style="black on yellow")
        bar = Table.grid()
        bar.add_row(ProgressBar(total=whole, completed=min(done, whole), width=72))
        parts: list[Text | Table] = [stamp, bar, table]
        for text in (snapshot.trouble, self.notice):
            if text:
                parts.append(Text(text, style="bold red"))
        return Group(*parts)

    @abstractmethod
    def at(self, snapshot: "Snapshot") -> tuple[str, str]:
        """Where in the plan the run is: a label and words."""

    @abstractmethod
    def scene(self, snapshot: "Snapshot") -> list[tuple[str, str]]:
        """The rig as it moves: labels and words, for the panel."""

    @abstractmethod
    def told(self, snapshot: "Snapshot") -> str:
        """The same in short, for a line."""

    def whole(self, snapshot: "Snapshot") -> float:
        """Seconds of the whole run."""
        return self._planned

    def _time_words(self, snapshot: "Snapshot") -> str:
        done = float(snapshot.row["time"])
        whole = max(done, self.whole(snapshot))  # the stop at the end is not in the plan
        speed = done / max(time.monotonic() - self._began, 1e-3)
        return (
            f"{clock_text(done)} of {clock_text(whole)} rig time, "
            f"{clock_text((whole - done) / max(speed, 1e-6))} left at {speed:.1f} x real time"
        )

    def _line(self, snapshot: "Snapshot") -> str:
        return (
            f"{self._time_words(snapshot)}  {' '.join(self.at(snapshot))}  "
            f"{self.told(snapshot)}  {_losses(snapshot)}"
            + (f"  {snapshot.trouble}" if snapshot.trouble else "")
        )
