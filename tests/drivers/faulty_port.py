"""A port between a conversation and a peer, with a clock of its own, that injects faults."""

from __future__ import annotations

import random
from collections import deque

from device_peers import Peer

STEP = 0.001  # s per step


class FaultyPort:
    """`fault` is one of: none, silent, garbage, babble, split, late, half."""

    def __init__(self, peer: Peer, datagrams: bool = False, seed: int = 1) -> None:
        self.peer, self.datagrams = peer, datagrams
        self.time = 0.0
        self.open_count = 1
        self.is_open = True
        self.fault, self.delay = "none", 0.0
        self.sent: list[bytes] = []  # messages of the host
        self._random = random.Random(seed)
        self._in_transit: deque[tuple[float, bytes]] = deque()

    def now(self) -> float:
        return self.time

    def step(self) -> None:
        self.time += STEP
        self._transmit(self.peer.tick(self.time))

    def hang_up(self) -> None:
        self.is_open = False
        self._in_transit.clear()

    def reopen(self) -> None:
        self.is_open, self.open_count = True, self.open_count + 1

    def send(self, data: bytes) -> bool:
        self.sent.append(data)
        if self.fault != "silent":
            self._transmit(self.peer.receive(data, self.time))
        return True

    def receive(self) -> list[bytes]:
        if not self.is_open:
            return []
        if self.fault == "babble":
            size = self._random.randint(1, 40)
            self._in_transit.append((self.time, self._random.randbytes(size)))
        due = []
        while self._in_transit and self._in_transit[0][0] <= self.time:
            due.append(self._in_transit.popleft()[1])
        if self.datagrams or not due:
            return due
        data = b"".join(due)
        if self.fault != "split":
            return [data]
        size = self._random.randint(1, len(data))
        if size < len(data):
            self._in_transit.appendleft((self.time, data[size:]))
        return [data[at : at + 1] for at in range(size)]

    def _transmit(self, messages: list[bytes]) -> None:
        for message in messages:
            data, at = message, self.time
            if self.fault == "silent" or not self.is_open:
                continue
            if self.fault in ("garbage", "babble"):
                data = self._random.randbytes(len(message))
            elif self.fault == "split" and self.datagrams:
                self._in_transit.append((at, message[: self._random.randint(0, len(message) - 1)]))
            elif self.fault == "late":
                at += self.delay
            elif self.fault == "half":
                self._in_transit.append((at, message[: len(message) // 2]))
                self.fault = "cut"
                continue
            elif self.fault == "cut":
                continue
            self._in_transit.append((at, data))
