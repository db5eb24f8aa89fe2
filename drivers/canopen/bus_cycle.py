"""One cycle of a synchronous bus: take in what the last SYNC brought, send commands and SYNC.

    tick k:  receive (answers to SYNC k-1) ... commands, SYNC k, our heartbeat when it is due

So a status is one tick old when it is used, always, and a model can contain that; one that was held
up is as old as the SYNC it answers (`answers`). Our heartbeat comes from the tick and from nowhere
else: a loop that hangs falls silent, and every drive that watches it stops by itself.
"""

from collections.abc import Iterable, Mapping
from typing import Protocol

from drivers.canopen import heartbeat, sync_count
from drivers.canopen.link import Frame

SYNC = 0x080
_NEVER = -1e9  # s, before any clock began


class Line(Protocol):
    """What moves frames: `drivers.canopen.link.Link`, or one that spoils them on the way."""

    behind: bool  # the last `drain` left something behind

    def now(self) -> float:
        """Seconds on the monotonic clock."""
        ...

    def send(self, cob_id: int, data: bytes) -> bool:
        """Send a frame now or not at all; False if it was not taken."""
        ...

    def drain(self) -> list[Frame]:
        """What has come since the last call; never waits."""
        ...

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        ...


class Node(Protocol):
    """One device's conversation, as far as the bus needs it."""

    @property
    def each_sync(self) -> Mapping[int, int]:
        """COB-IDs of the frames it takes, and on every how many SYNCs one comes; 0: on none."""
        ...

    def take(self, cob_id: int, data: bytes, sampled: float) -> None:
        """A frame of its own, and when (s) the SYNC was sent that it answers."""
        ...


class BusCycle:
    """All synchronous devices of one bus, seen from the tick."""

    def __init__(self, line: Line, nodes: Iterable[Node], own_node: int, beat: float) -> None:
        """``own_node``: our node number; ``beat``: seconds between our heartbeats."""
        self._line = line
        self._takers = {
            cob_id: (node, each) for node in nodes for cob_id, each in node.each_sync.items()
        }
        self._answers = dict.fromkeys(self._takers, sync_count.start())
        self._beat_id = heartbeat.BASE + own_node
        self._beat = heartbeat.encode(heartbeat.Nmt.OPERATIONAL)
        self._every = beat
        self._beaten = self._synced = _NEVER  # s, when last sent
        self._moments = [_NEVER] * sync_count.OPEN  # s, of the last SYNCs, by their number
        self._syncs = 0  # sent so far: the number of the last one
        self._answered = 0  # number of the SYNC that the newest frame to come may answer
        self.strange = 0  # frames that nobody here takes

    @property
    def synced(self) -> float:
        """When the last SYNC went out, s; one that the bus did not take did not."""
        return self._synced

    def receive(self) -> float:
        """Take in what has come; gives the time (s) at which it is known.

        As long as the line is not emptied its frames are older than the last SYNC, and count as
        old as they may be.
        """
        frames = self._line.drain()
        if not self._line.behind:
            self._answered = self._syncs
        latest = self._answered
        for cob_id, data in frames:
            found = self._takers.get(cob_id)
            if found is None:
                self.strange += 1
                continue
            taker, each = found
            number = latest
            if each > 0:
                one = self._answers[cob_id] = sync_count.take(self._answers[cob_id], each, latest)
                number = one.answered
            taker.take(cob_id, data, self._moment(number))
        return self._line.now()

    def _moment(self, number: int) -> float:
        """When (s) the SYNC of this number was sent; very long ago if nobody knows any more."""
        if number == 0 or self._syncs - number >= sync_count.OPEN:
            return _NEVER
        return self._moments[number % sync_count.OPEN]

    def send(self, frames: Iterable[tuple[int, bytes]]) -> None:
        """Commands, then the SYNC on which they act."""
        send = self._line.send
        for cob_id, data in frames:
            send(cob_id, data)
        synced = send(SYNC, b"")
        now = self._line.now()
        if synced:
            self._synced = now
            self._syncs += 1
            self._moments[self._syncs % sync_count.OPEN] = now
        if now - self._beaten >= self._every and send(self._beat_id, self._beat):
            self._beaten = now

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        self._line.close()
