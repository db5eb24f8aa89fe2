"""Progress of a rehearsal or a sweep for people and for programs that call the Python API."""

import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from rig.presentation.phrases import clock_text

_INTERVAL_S = 0.5  # between two lines for people


class Progress(NamedTuple):
    """The progress of a rehearsal or a sweep.

    Attributes:
        done: Rows or cases that are finished.
        total: All rows or cases.
        elapsed: Time since the start, s.
        text: The same for people, with what is being done.
    """

    done: int
    total: int
    elapsed: float
    text: str


ProgressOption = bool | Callable[[Progress], None]
"""True: one line on standard error that is renewed; False: nothing; or a function to call."""


class Reporter:
    """Reports progress as the caller has chosen; a line for people ends with the context."""

    def __init__(self, option: ProgressOption, name: str) -> None:
        self._call = option if callable(option) else None
        self._prints, self._name = option is True, name
        self._began, self._printed, self._width = time.monotonic(), 0.0, 0

    def __enter__(self) -> "Reporter":
        return self

    def __exit__(self, *_: object) -> None:
        if self._width:
            self._write("")

    def show(self, done: int, total: int, text: str) -> None:
        """Report the number of finished rows or cases of all, and what is being done."""
        elapsed = time.monotonic() - self._began
        if self._call is not None:
            self._call(Progress(done, total, elapsed, text))
        elif self._prints and elapsed - self._printed >= _INTERVAL_S:
            self._printed = elapsed
            self._write(f"{self._name}: {text}, {clock_text(elapsed)} elapsed")

    def notice(self, text: str) -> None:
        """Report one message that stays."""
        if self._prints:
            self._write("")
            print(text, file=sys.stderr, flush=True)

    def _write(self, text: str) -> None:
        padding = " " * max(0, self._width - len(text))
        end = "" if text else "\r"
        print(f"\r{text}{padding}", end=end, file=sys.stderr, flush=True)
        self._width = len(text)
