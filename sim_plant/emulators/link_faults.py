"""Faults of a link in both directions. Seeded; time is an argument.

A piece is the unit that one end hands over: a frame, a datagram, or the bytes of one write.
"""

from __future__ import annotations

import random
from collections import Counter, deque
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sim_plant.emulators.fault_list import UP_TO_A_MINUTE, Limits
from sim_plant.units import Count, Ratio, Second

FAULTS = {
    "drop": "a share of the pieces is lost",
    "delay": "every piece arrives later, in order",
    "duplicate": "a share of the pieces arrives twice",
    "corrupt": "one bit is flipped in a share of the pieces",
    "truncate": "a share of the pieces ends early",
    "freeze": "nothing arrives; when the fault ends, all of it arrives at once",
    "disconnect": "nothing arrives, links that can disconnect do so; sent pieces are lost",
    "babble": "random bytes arrive without having been sent",
}
SHARE = Limits(0.0, 1.0)
VALUES = {  # limits of the number with which a fault is switched on: share, or s
    "drop": SHARE,
    "delay": UP_TO_A_MINUTE,
    "duplicate": SHARE,
    "corrupt": SHARE,
    "truncate": SHARE,
    "babble": Limits(1e-4, 60.0),  # between two bursts
}
MAX_FROZEN_PIECES = 1024  # most pieces that a frozen link keeps; later ones are lost

Toward = Literal["host", "device"]


class Severity(NamedTuple):
    """Severity of each fault while it is on."""

    drop: Ratio = 0.2
    delay: Second = 0.05
    jitter: Second = 0.0  # added to the delay, uniform
    duplicate: Ratio = 0.2
    corrupt: Ratio = 0.2
    truncate: Ratio = 0.2
    babble_period: Second = 0.01  # between two bursts
    babble_size: Count = 16  # bytes of one burst


@dataclass
class _SharedState:
    """State that all branches of a direction share."""

    severity: Severity
    random: random.Random
    on: set[str]
    counts: Counter[str]


class LinkDirection:
    """One direction of a link."""

    def __init__(self, seed: str, severity: Severity) -> None:
        """The same seed, pieces, times and switches give the same faults."""
        self._state = _SharedState(severity, random.Random(seed), set(), Counter())
        self._frozen: deque[bytes] = deque()
        self._last_arrival = float("-inf")  # time of the last arrival: keeps the order
        self._last_babble = float("-inf")

    def branch(self) -> LinkDirection:
        """Return a direction with the same faults, switches and counts, and an order of its own.

        Use it for a link with several connections: pieces that one froze are released there.
        """
        branch = LinkDirection("", self.severity)
        branch._state = self._state
        return branch

    @property
    def severity(self) -> Severity:
        """Severity of the faults."""
        return self._state.severity

    @severity.setter
    def severity(self, severity: Severity) -> None:
        self._state.severity = severity

    @property
    def counts(self) -> Counter[str]:
        """Number of pieces that each fault affected."""
        return self._state.counts

    def switch(self, name: str, on: bool = True) -> None:
        """Switch one fault; raises ValueError for an unknown name."""
        if name not in FAULTS:
            raise ValueError(f"no link fault {name!r}; there are {', '.join(FAULTS)}")
        if on:
            self._state.on.add(name)
        else:
            self._state.on.discard(name)

    def is_on(self, name: str) -> bool:
        """Return whether a fault is on."""
        return name in self._state.on

    def is_transparent(self, now: Second) -> bool:
        """Return whether pieces pass at once and unchanged: no active fault, no piece under way."""
        return not self._state.on and not self._frozen and now >= self._last_arrival

    def transmit(self, data: bytes, now: Second) -> list[tuple[Second, bytes]]:
        """Return the arrivals of a piece handed over at `now`: ordered times >= now, and pieces."""
        self.counts["handed over"] += 1
        if "disconnect" in self._state.on:
            self.counts["disconnect"] += 1
            return []
        if "freeze" in self._state.on:
            self.counts["freeze"] += 1
            if len(self._frozen) < MAX_FROZEN_PIECES:
                self._frozen.append(data)
            return []
        return [*self._release_frozen(now), *self._apply_faults(data, now)]

    def due_arrivals(self, now: Second) -> list[tuple[Second, bytes]]:
        """Return the arrivals by `now` of delayed pieces and babble; call it often."""
        arrivals = [] if "freeze" in self._state.on else self._release_frozen(now)
        if "babble" in self._state.on and "disconnect" not in self._state.on:
            if now - self._last_babble >= self.severity.babble_period:
                self._last_babble = now
                self.counts["babble"] += 1
                arrivals.append((self._arrival_time(now), self._random_bytes()))
        else:
            self._last_babble = float("-inf")
        return arrivals

    def _release_frozen(self, now: Second) -> list[tuple[Second, bytes]]:
        arrivals = []
        while self._frozen:
            arrivals += self._apply_faults(self._frozen.popleft(), now)
        return arrivals

    def _apply_faults(self, data: bytes, now: Second) -> list[tuple[Second, bytes]]:
        severity = self.severity
        if self._strikes("drop", severity.drop):
            return []
        copies = 2 if self._strikes("duplicate", severity.duplicate) else 1
        arrivals = []
        for _ in range(copies):
            piece = data
            if piece and self._strikes("corrupt", severity.corrupt):
                piece = self._flip_bit(piece)
            if piece and self._strikes("truncate", severity.truncate):
                piece = piece[: self._state.random.randrange(len(piece))]
            if piece or not data:
                arrivals.append((self._arrival_time(now), piece))
        return arrivals

    def _strikes(self, name: str, share: Ratio) -> bool:
        if name not in self._state.on or self._state.random.random() >= share:
            return False
        self.counts[name] += 1
        return True

    def _arrival_time(self, now: Second) -> Second:
        at = now
        if "delay" in self._state.on:
            self.counts["delay"] += 1
            at += self.severity.delay + self.severity.jitter * self._state.random.random()
        self._last_arrival = max(self._last_arrival, at)
        return self._last_arrival

    def _flip_bit(self, data: bytes) -> bytes:
        changed = bytearray(data)
        changed[self._state.random.randrange(len(data))] ^= 1 << self._state.random.randrange(8)
        return bytes(changed)

    def _random_bytes(self) -> bytes:
        return self._state.random.randbytes(self.severity.babble_size)


class LinkFaults:
    """The faults of one link: one direction to the host (rig), one to the device."""

    def __init__(self, seed: int = 0, severity: Severity | None = None) -> None:
        """Create the link with all faults off."""
        severity = severity or Severity()
        self.to_host = LinkDirection(f"{seed} to host", severity)
        self.to_device = LinkDirection(f"{seed} to device", severity)

    @staticmethod
    def descriptions() -> dict[str, str]:
        """Return every fault of a link: name and visible effect."""
        return dict(FAULTS)

    def switch(self, name: str, on: bool = True, *, toward: Toward | None = None) -> None:
        """Switch one fault in both directions, or only in one; ValueError for unknown names."""
        for direction in self._directions(toward):
            direction.switch(name, on)

    def clear(self) -> None:
        """Switch all faults off; pieces of a frozen link are released next."""
        for name in FAULTS:
            self.switch(name, False)

    def set_severity(self, severity: Severity, *, toward: Toward | None = None) -> None:
        """Set the severity of the faults from now on."""
        for direction in self._directions(toward):
            direction.severity = severity

    @property
    def disconnected(self) -> bool:
        """Whether the link is cut in either direction; a link that can disconnect then does so."""
        return self.to_host.is_on("disconnect") or self.to_device.is_on("disconnect")

    def counts(self) -> dict[str, int]:
        """Return the number of pieces affected by each fault, as `host.drop`, `device.corrupt`."""
        directions = {"host": self.to_host, "device": self.to_device}
        return {
            f"{name}.{fault}": count
            for name, direction in directions.items()
            for fault, count in direction.counts.items()
        }

    def _directions(self, toward: Toward | None) -> tuple[LinkDirection, ...]:
        if toward is None:
            return self.to_host, self.to_device
        return (self.to_host,) if toward == "host" else (self.to_device,)
