"""Delivery of pieces by callback in one direction of a link between host and device."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from sim_plant.emulators.link_faults import LinkDirection
from sim_plant.units import Second


class LinkRelay:
    """Delivers pieces through a direction's faults; at once and unchanged without faults."""

    def __init__(
        self,
        direction: LinkDirection,
        loop: asyncio.AbstractEventLoop,
        arrive: Callable[[bytes], None],
    ) -> None:
        self._direction = direction
        self._loop = loop
        self._arrive = arrive

    def send(self, data: bytes) -> None:
        """Send one piece."""
        now = self._loop.time()
        if self._direction.is_transparent(now):
            self._arrive(data)
        else:
            self._deliver(self._direction.transmit(data, now), now)

    def poll(self) -> None:
        """Deliver pieces that the faults delayed; call it often."""
        now = self._loop.time()
        if not self._direction.is_transparent(now):
            self._deliver(self._direction.due_arrivals(now), now)

    def _deliver(self, pieces: list[tuple[Second, bytes]], now: Second) -> None:
        for at, piece in pieces:
            if at <= now:
                self._arrive(piece)
            else:
                self._loop.call_at(at, self._arrive, piece)
