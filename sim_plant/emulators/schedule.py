"""When something is done: the part of an event loop that emulated devices need."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from typing import Any, Protocol

from sim_plant.units import Second


class Appointment(Protocol):
    """A call to come."""

    def cancel(self) -> None:
        """Take it back; harmless if it is past."""
        ...


class Schedule(Protocol):
    """A clock (seconds, never back) and calls at its times. Every asyncio event loop is one."""

    def time(self) -> Second:
        """Give the time now."""
        ...

    def call_at(self, when: Second, callback: Callable[..., object], *args: Any) -> Appointment:
        """Call once at a time, or soon if it is past."""
        ...


def precise_loop() -> asyncio.AbstractEventLoop:
    """Give an event loop whose timers are good to some 0.1 ms.

    The default one (epoll) rounds every wait up to whole milliseconds: longer than a CAN frame, and
    too coarse for the bytes of a serial line. select() ends at file descriptor 1023.
    """
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
