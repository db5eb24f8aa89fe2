"""What a person sees while a sweep goes on: cases, rate, time left."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from rig.cli.run_panel import clock_text
from rig.sweep.cases import Outcome

_EVERY = 10.0  # s between lines where there is no terminal


class SweepProgress:
    """A bar on a terminal, a line now and then elsewhere."""

    def __init__(self, name: str, total: int, *, quiet: bool) -> None:
        self._total, self._quiet = total, quiet
        self._before = self.done = self.failed = 0
        self.simulated = 0.0  # s
        self.spent = 0.0  # s, from the first case handed out to the last outcome
        console = Console(stderr=True, highlight=False)
        self._drawn = console.is_terminal and not quiet
        self._bar = Progress(
            TextColumn(name), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[said]}"),
            console=console, transient=True, disable=not self._drawn,
        )  # fmt: skip
        self._task = self._bar.add_task("", total=total, said="")
        self._began = self._said = time.monotonic()

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

    def begin(self, before: int) -> None:
        """So many cases were finished before."""
        self._before = before
        self._began = self._said = time.monotonic()
        self._bar.update(self._task, completed=before)
        if before and not self._quiet:
            print(f"{before} of {self._total} cases are finished already", file=sys.stderr)

    @property
    def kept(self) -> str:
        """What is finished, in words."""
        return f"{self._before + self.done - self.failed} of {self._total} cases"

    def see(self, outcome: Outcome) -> None:
        """One more case."""
        self.done += 1
        self.failed += bool(outcome.failed)
        self.simulated += outcome.seconds
        now = time.monotonic()
        self.spent = max(now - self._began, 1e-3)
        self._bar.update(self._task, completed=self._before + self.done, said=self._words())
        if not self._drawn and not self._quiet and now - self._said >= _EVERY:
            self._said = now
            count = f"{self._before + self.done} of {self._total} cases"
            print(f"{count}, {self._words()}", file=sys.stderr, flush=True)

    def _words(self) -> str:
        left = (self._total - self._before - self.done) * self.spent / self.done
        failed = f", {self.failed} failed" if self.failed else ""
        rate, pace = self.done / self.spent, self.simulated / self.spent
        return f"{rate:.3g} a second, {pace:.0f} times real time, {clock_text(left)} left{failed}"
