"""One way of a link between a host and a device, where pieces arrive by calls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from sim_plant.emulators.link_faults import Way
from sim_plant.units import Second


class Passage:
    """Hands pieces on, through the way's faults; at once and whole while it has none."""

    def __init__(
        self, way: Way, loop: asyncio.AbstractEventLoop, arrive: Callable[[bytes], None]
    ) -> None:
        self._way = way
        self._loop = loop
        self._arrive = arrive

    def hand(self, data: bytes) -> None:
        """Hand over one piece."""
        now = self._loop.time()
        if self._way.quiet(now):
            self._arrive(data)
        else:
            self._all(self._way.pass_on(data, now), now)

    def tend(self) -> None:
        """Let come what the faults held; to be called often."""
        now = self._loop.time()
        if not self._way.quiet(now):
            self._all(self._way.due(now), now)

    def _all(self, pieces: list[tuple[Second, bytes]], now: Second) -> None:
        for at, piece in pieces:
            if at <= now:
                self._arrive(piece)
            else:
                self._loop.call_at(at, self._arrive, piece)
