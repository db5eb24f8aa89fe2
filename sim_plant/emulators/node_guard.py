"""Detection of a silent master by an emulated node: heartbeats and RPDO deadlines.

CiA 301: 0x1016 lists nodes and their timeouts, monitored from their first heartbeat on; 0x140x:05
is the longest time between two RPDOs, monitored from the first on [C].
"""

from __future__ import annotations

from collections.abc import Hashable

from sim_plant.units import Second


class Deadlines:
    """Timeouts of monitored sources."""

    def __init__(self) -> None:
        self._timeouts: dict[Hashable, Second] = {}
        self._last_activity: dict[Hashable, Second] = {}

    def set(self, timeouts: dict[Hashable, Second]) -> None:
        """Set the timeouts by source; the last activity of continuing sources is kept."""
        self._timeouts = {source: timeout for source, timeout in timeouts.items() if timeout > 0.0}
        self._last_activity = {
            source: at for source, at in self._last_activity.items() if source in self._timeouts
        }

    def record_activity(self, source: Hashable, now: Second) -> None:
        """Record activity of a source."""
        if source in self._timeouts:
            self._last_activity[source] = now

    def clear(self) -> None:
        """Stop monitoring every source until its next activity."""
        self._last_activity.clear()

    def pop_expired(self, now: Second) -> list[Hashable]:
        """Return the sources whose timeout has expired, each once until its next activity."""
        if not self._last_activity:
            return []
        timeouts = self._timeouts
        expired = [
            source for source, at in self._last_activity.items() if now - at > timeouts[source]
        ]
        for source in expired:
            del self._last_activity[source]
        return expired


def parse_consumers(entries: list[int]) -> dict[Hashable, Second]:
    """Return node and timeout of the entries of 0x1016: bits 23..16 node, 15..0 ms; 0 is unused."""
    pairs = [((value >> 16) & 0x7F, (value & 0xFFFF) * 1.0e-3) for value in entries]
    return {node: time for node, time in pairs if node and time}
