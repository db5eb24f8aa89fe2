"""Timed calls: the part of an event loop that emulated devices need."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from typing import Any, Protocol

from sim_plant.units import Second


class ScheduledCall(Protocol):
    """A scheduled call."""

    def cancel(self) -> None:
        """Cancel the call; no effect after its time."""
        ...


class Schedule(Protocol):
    """A monotonic clock (seconds) and timed calls. Every asyncio event loop is a Schedule."""

    def time(self) -> Second:
        """Return the present time."""
        ...

    def call_at(self, when: Second, callback: Callable[..., object], *args: Any) -> ScheduledCall:
        """Call once at a time, or soon if that time is past."""
        ...


def precise_loop() -> asyncio.AbstractEventLoop:
    """Return an event loop whose timers are accurate to about 0.1 ms.

    The default one (epoll) rounds every wait up to whole milliseconds: longer than a CAN frame, and
    too coarse for the bytes of a serial line. select() ends at file descriptor 1023.
    """
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
