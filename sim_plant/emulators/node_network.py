"""Network object for `canopen` in an emulated node: no bus, no threads."""

from __future__ import annotations

from collections.abc import Callable

import canopen

from sim_plant.emulators.schedule import Schedule, ScheduledCall
from sim_plant.units import Second


class NodeNetwork(canopen.Network):
    """A network that passes every frame to a function and sends periodic frames by a schedule."""

    def __init__(self, send: Callable[[int, bytes], None], schedule: Schedule) -> None:
        super().__init__()
        self._send = send
        self._schedule = schedule

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Pass a frame on; `data` may be any bytes-like object."""
        self._send(can_id, bytes(data))

    def send_periodic(  # type: ignore[override]  # the library's own type needs a bus
        self, can_id: int, data: bytes, period: Second, remote: bool = False
    ) -> PeriodicFrame:
        """Send a frame every `period`, first after one period."""
        return PeriodicFrame(self._send, self._schedule, can_id, data, period)


class PeriodicFrame:
    """A periodic frame, sent at absolute times; times that have passed are skipped."""

    def __init__(
        self,
        send: Callable[[int, bytes], None],
        schedule: Schedule,
        can_id: int,
        data: bytes,
        period: Second,
    ) -> None:
        self._send, self._schedule = send, schedule
        self._can_id, self._data, self._period = can_id, bytes(data), period
        self._due = schedule.time()
        self._next: ScheduledCall
        self._arm()

    def stop(self) -> None:
        """Stop sending."""
        self._next.cancel()

    def update(self, data: bytes) -> None:
        """Send other data from now on."""
        self._data = bytes(data)

    def _arm(self) -> None:
        self._due = max(self._due + self._period, self._schedule.time())
        self._next = self._schedule.call_at(self._due, self._fire)

    def _fire(self) -> None:
        self._arm()
        self._send(self._can_id, self._data)
