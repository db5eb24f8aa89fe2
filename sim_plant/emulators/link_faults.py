"""What can go wrong between two ends of a link, in both directions. Seeded; time is an argument.

A piece is what one end hands over at once: a frame, a datagram, or the bytes of one write.
"""

from __future__ import annotations

import random
from collections import Counter, deque
from dataclasses import dataclass
from typing import Literal, NamedTuple

from sim_plant.units import Count, Ratio, Second

FAULTS = {
    "drop": "a share of the pieces vanishes",
    "delay": "every piece arrives later, in order",
    "duplicate": "a share of the pieces arrives twice",
    "corrupt": "one bit is flipped in a share of the pieces",
    "truncate": "a share of the pieces ends early",
    "freeze": "nothing arrives; when the fault ends, all of it arrives at once",
    "disconnect": "nothing arrives, and links that can hang up do; what was sent is lost",
    "babble": "random bytes arrive unasked",
}
HELD = 1024  # pieces a frozen link keeps; later ones are lost

Toward = Literal["host", "device"]


class Severity(NamedTuple):
    """How bad each fault is while it is on."""

    drop: Ratio = 0.2
    delay: Second = 0.05
    jitter: Second = 0.0  # added to the delay, uniform
    duplicate: Ratio = 0.2
    corrupt: Ratio = 0.2
    truncate: Ratio = 0.2
    babble_period: Second = 0.01  # between two bursts
    babble_size: Count = 16  # bytes of one burst


@dataclass
class _State:
    """What all branches of a way share."""

    severity: Severity
    random: random.Random
    on: set[str]
    counts: Counter[str]


class Way:
    """One direction of a link."""

    def __init__(self, seed: str, severity: Severity) -> None:
        """The same seed, pieces, times and switches give the same faults."""
        self._state = _State(severity, random.Random(seed), set(), Counter())
        self._held: deque[bytes] = deque()
        self._last = float("-inf")  # time of the last arrival: order is kept
        self._babbled = float("-inf")

    def branch(self) -> Way:
        """Give a way with the same faults, switches and counts, and an order of its own.

        For a link that carries several conversations: what one held comes back in that one.
        """
        way = Way("", self.severity)
        way._state = self._state
        return way

    @property
    def severity(self) -> Severity:
        """How bad the faults are."""
        return self._state.severity

    @severity.setter
    def severity(self, severity: Severity) -> None:
        self._state.severity = severity

    @property
    def counts(self) -> Counter[str]:
        """How many pieces each fault struck."""
        return self._state.counts

    def switch(self, name: str, on: bool = True) -> None:
        """Switch one fault; raises ValueError for an unknown name."""
        if name not in FAULTS:
            raise ValueError(f"no link fault {name!r}; there are {', '.join(FAULTS)}")
        if on:
            self._state.on.add(name)
        else:
            self._state.on.discard(name)

    def on(self, name: str) -> bool:
        """Say whether a fault is on."""
        return name in self._state.on

    def quiet(self, now: Second) -> bool:
        """Say whether pieces pass at once and whole: no fault is on and nothing is on its way."""
        return not self._state.on and not self._held and now >= self._last

    def pass_on(self, data: bytes, now: Second) -> list[tuple[Second, bytes]]:
        """Give what arrives of a piece handed over at `now`: times (>= now, in order), pieces."""
        self.counts["handed over"] += 1
        if "disconnect" in self._state.on:
            self.counts["disconnect"] += 1
            return []
        if "freeze" in self._state.on:
            self.counts["freeze"] += 1
            if len(self._held) < HELD:
                self._held.append(data)
            return []
        return [*self._released(now), *self._through(data, now)]

    def due(self, now: Second) -> list[tuple[Second, bytes]]:
        """Give what arrives by `now` without having just been handed over; to be asked often."""
        arrivals = [] if "freeze" in self._state.on else self._released(now)
        if "babble" in self._state.on and "disconnect" not in self._state.on:
            if now - self._babbled >= self.severity.babble_period:
                self._babbled = now
                self.counts["babble"] += 1
                arrivals.append((self._arrival(now), self._noise()))
        else:
            self._babbled = float("-inf")
        return arrivals

    def _released(self, now: Second) -> list[tuple[Second, bytes]]:
        arrivals = []
        while self._held:
            arrivals += self._through(self._held.popleft(), now)
        return arrivals

    def _through(self, data: bytes, now: Second) -> list[tuple[Second, bytes]]:
        severity = self.severity
        if self._chosen("drop", severity.drop):
            return []
        copies = 2 if self._chosen("duplicate", severity.duplicate) else 1
        arrivals = []
        for _ in range(copies):
            piece = data
            if piece and self._chosen("corrupt", severity.corrupt):
                piece = self._flipped(piece)
            if piece and self._chosen("truncate", severity.truncate):
                piece = piece[: self._state.random.randrange(len(piece))]
            if piece or not data:
                arrivals.append((self._arrival(now), piece))
        return arrivals

    def _chosen(self, name: str, share: Ratio) -> bool:
        if name not in self._state.on or self._state.random.random() >= share:
            return False
        self.counts[name] += 1
        return True

    def _arrival(self, now: Second) -> Second:
        at = now
        if "delay" in self._state.on:
            self.counts["delay"] += 1
            at += self.severity.delay + self.severity.jitter * self._state.random.random()
        self._last = max(self._last, at)
        return self._last

    def _flipped(self, data: bytes) -> bytes:
        changed = bytearray(data)
        changed[self._state.random.randrange(len(data))] ^= 1 << self._state.random.randrange(8)
        return bytes(changed)

    def _noise(self) -> bytes:
        return self._state.random.randbytes(self.severity.babble_size)


class LinkFaults:
    """The faults of one link: a way to the host (rig) and a way to the device."""

    def __init__(self, seed: int = 0, severity: Severity | None = None) -> None:
        """All faults are off at first."""
        severity = severity or Severity()
        self.to_host = Way(f"{seed} to host", severity)
        self.to_device = Way(f"{seed} to device", severity)

    @staticmethod
    def listed() -> dict[str, str]:
        """Give every fault a link can have: name and what is seen of it."""
        return dict(FAULTS)

    def switch(self, name: str, on: bool = True, *, toward: Toward | None = None) -> None:
        """Switch one fault in both directions, or only in one; ValueError for unknown names."""
        for way in self._ways(toward):
            way.switch(name, on)

    def clear(self) -> None:
        """Switch all faults off; what a frozen link held is given out next."""
        for name in FAULTS:
            self.switch(name, False)

    def set_severity(self, severity: Severity, *, toward: Toward | None = None) -> None:
        """Say how bad the faults are from now on."""
        for way in self._ways(toward):
            way.severity = severity

    @property
    def disconnected(self) -> bool:
        """The link is cut in either direction: a link that can hang up shall do so."""
        return self.to_host.on("disconnect") or self.to_device.on("disconnect")

    def counts(self) -> dict[str, int]:
        """Give how many pieces each fault struck, as `host.drop` or `device.corrupt`."""
        ways = {"host": self.to_host, "device": self.to_device}
        return {f"{name}.{what}": n for name, way in ways.items() for what, n in way.counts.items()}

    def _ways(self, toward: Toward | None) -> tuple[Way, ...]:
        if toward is None:
            return self.to_host, self.to_device
        return (self.to_host,) if toward == "host" else (self.to_device,)
