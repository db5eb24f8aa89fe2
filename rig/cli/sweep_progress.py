"""Progress display of a sweep: cases, rate, time left."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from rig.cli.run_panel import clock_text
from rig.sweep.cases import Outcome

_LINE_INTERVAL_S = 10.0  # s between lines where there is no terminal


class SweepProgress:
    """Draws a bar on a terminal, prints a line every 10 s elsewhere."""

    def __init__(self, name: str, total: int, *, quiet: bool) -> None:
        self._total, self._quiet = total, quiet
        self._already_finished = self.done = self.failed = 0
        self.simulated = 0.0  # s
        self.elapsed = 0.0  # s, from the first case handed out to the last outcome
        console = Console(stderr=True, highlight=False)
        self._live_display = console.is_terminal and not quiet
        self._bar = Progress(
            TextColumn(name), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"),
            console=console, transient=True, disable=not self._live_display,
        )  # fmt: skip
        self._task = self._bar.add_task("", total=total, rate="")
        self._start_time = self._last_line_time = time.monotonic()

    def __enter__(self) -> "SweepProgress":
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def begin(self, already_finished: int) -> None:
        """Start the clock; ``already_finished`` cases come from an earlier start of the sweep."""
        self._already_finished = already_finished
        self._start_time = self._last_line_time = time.monotonic()
        self._bar.update(self._task, completed=already_finished)
        if already_finished and not self._quiet:
            print(
                f"{already_finished} of {self._total} cases are already finished", file=sys.stderr
            )

    @property
    def finished_text(self) -> str:
        """The number of finished cases as text."""
        return f"{self._already_finished + self.done - self.failed} of {self._total} cases"

    def update(self, outcome: Outcome) -> None:
        """Count one more case."""
        self.done += 1
        self.failed += bool(outcome.failed)
        self.simulated += outcome.seconds
        now = time.monotonic()
        self.elapsed = max(now - self._start_time, 1e-3)
        self._bar.update(
            self._task, completed=self._already_finished + self.done, rate=self._rate_text()
        )
        if (
            not self._live_display
            and not self._quiet
            and now - self._last_line_time >= _LINE_INTERVAL_S
        ):
            self._last_line_time = now
            count = f"{self._already_finished + self.done} of {self._total} cases"
            print(f"{count}, {self._rate_text()}", file=sys.stderr, flush=True)

    def _rate_text(self) -> str:
        time_left = (self._total - self._already_finished - self.done) * self.elapsed / self.done
        failed = f", {self.failed} failed" if self.failed else ""
        rate, speed_ratio = self.done / self.elapsed, self.simulated / self.elapsed
        return (
            f"{rate:.3g} a second, {speed_ratio:.0f} times real time, "
            f"{clock_text(time_left)} left{failed}"
        )
