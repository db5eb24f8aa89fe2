"""A port between a conversation and a peer, on a clock of its own, that spoils what passes."""

from __future__ import annotations

import random
from collections import deque

from device_peers import Peer

STEP = 0.001  # s of a turn


class SpoiltPort:
    """`fault` is one of: none, silent, garbage, babble, split, late, half."""

    def __init__(self, peer: Peer, datagrams: bool = False, seed: int = 1) -> None:
        self.peer, self.datagrams = peer, datagrams
        self.time = 0.0
        self.opens = 1
        self.is_open = True
        self.fault, self.delay = "none", 0.0
        self.said: list[bytes] = []  # what the host sent
        self._random = random.Random(seed)
        self._coming: deque[tuple[float, bytes]] = deque()

    def now(self) -> float:
        return self.time

    def step(self) -> None:
        self.time += STEP
        self._carry(self.peer.tick(self.time))

    def hang_up(self) -> None:
        self.is_open = False
        self._coming.clear()

    def come_back(self) -> None:
        self.is_open, self.opens = True, self.opens + 1

    def send(self, data: bytes) -> bool:
        self.said.append(data)
        if self.fault != "silent":
            self._carry(self.peer.hear(data, self.time))
        return True

    def take(self) -> list[bytes]:
        if not self.is_open:
            return []
        if self.fault == "babble":
            size = self._random.randint(1, 40)
            self._coming.append((self.time, self._random.randbytes(size)))
        due = []
        while self._coming and self._coming[0][0] <= self.time:
            due.append(self._coming.popleft()[1])
        if self.datagrams or not due:
            return due
        data = b"".join(due)
        if self.fault != "split":
            return [data]
        size = self._random.randint(1, len(data))
        if size < len(data):
            self._coming.appendleft((self.time, data[size:]))
        return [data[at : at + 1] for at in range(size)]

    def _carry(self, messages: list[bytes]) -> None:
        for message in messages:
            data, at = message, self.time
            if self.fault == "silent" or not self.is_open:
                continue
            if self.fault in ("garbage", "babble"):
                data = self._random.randbytes(len(message))
            elif self.fault == "split" and self.datagrams:
                self._coming.append((at, message[: self._random.randint(0, len(message) - 1)]))
            elif self.fault == "late":
                at += self.delay
            elif self.fault == "half":
                self._coming.append((at, message[: len(message) // 2]))
                self.fault = "cut"
                continue
            elif self.fault == "cut":
                continue
            self._coming.append((at, data))
