"""Signals that ask a command to stop; caught where it has something to put away first."""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from types import FrameType
from typing import Any

_REPEAT_S = 0.01


@contextmanager
def repeated_interrupts() -> Iterator[None]:
    """Repeat a Ctrl-C that came within a destructor or a callback of the interpreter.

    No exception leaves these, so that the interpreter would print a traceback and go on.
    """
    before = sys.unraisablehook

    def repeat(error: Any) -> None:
        if not issubclass(error.exc_type, KeyboardInterrupt):
            before(error)
            return
        timer = Timer(_REPEAT_S, os.kill, (os.getpid(), signal.SIGINT))
        timer.daemon = True  # a command that ends before needs no Ctrl-C
        timer.start()

    sys.unraisablehook = repeat
    try:
        yield
    finally:
        sys.unraisablehook = before


@contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Catch SIGINT, SIGTERM and SIGHUP; yield a function that returns whether one came."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield lambda: count > 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
