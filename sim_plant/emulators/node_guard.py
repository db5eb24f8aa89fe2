"""How an emulated node notices that its master is silent: heartbeats and RPDO deadlines.

CiA 301: 0x1016 names nodes and their times, watched from their first heartbeat on; 0x140x:05 is the
longest time between two RPDOs, watched from the first on [C].
"""

from __future__ import annotations

from collections.abc import Hashable

from sim_plant.units import Second


class Deadlines:
    """Who must be heard of within which time."""

    def __init__(self) -> None:
        self._allowed: dict[Hashable, Second] = {}
        self._heard: dict[Hashable, Second] = {}

    def set(self, allowed: dict[Hashable, Second]) -> None:
        """Set who is watched; who was heard of before stays so."""
        self._allowed = {who: time for who, time in allowed.items() if time > 0.0}
        self._heard = {who: at for who, at in self._heard.items() if who in self._allowed}

    def hear(self, who: Hashable, now: Second) -> None:
        """Note a sign of life."""
        if who in self._allowed:
            self._heard[who] = now

    def forget(self) -> None:
        """Watch nobody until heard of again."""
        self._heard.clear()

    def missed(self, now: Second) -> list[Hashable]:
        """Give who has fallen silent, each once until heard of again."""
        if not self._heard:
            return []
        allowed = self._allowed
        silent = [who for who, at in self._heard.items() if now - at > allowed[who]]
        for who in silent:
            del self._heard[who]
        return silent


def consumers(entries: list[int]) -> dict[Hashable, Second]:
    """Give node and time of the entries of 0x1016: bits 23..16 node, 15..0 ms; 0 is none."""
    pairs = [((value >> 16) & 0x7F, (value & 0xFFFF) * 1.0e-3) for value in entries]
    return {node: time for node, time in pairs if node and time}
