"""One cycle of a synchronous bus: receive the answers to the last SYNC, send commands and SYNC.

    tick k:  receive (answers to SYNC k-1) ... commands, SYNC k, our heartbeat when it is due

So a status is always one tick old when it is used, which a model can include; a delayed one is as
old as the SYNC it answers (`sync_count`). Only the tick sends our heartbeat: if the loop hangs, the
heartbeat stops, and every drive that monitors it stops by itself.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from drivers.canopen import heartbeat, sync_count
from drivers.canopen.frame_port import Frame

SYNC = 0x080
_SYNC_FRAME = (SYNC, b"")
_NEVER = -1e9  # s, earlier than any clock reading


class FrameLink(Protocol):
    """A transport of frames: `drivers.canopen.link.Link`, or a test link that injects faults."""

    has_backlog: bool  # True: the last `drain` left frames in the bus's queue

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        ...

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        """Send frames in their order, without waiting; return the indices of those not accepted."""
        ...

    def drain(self) -> list[Frame]:
        """Return the frames received since the last call; never wait."""
        ...

    def close(self) -> None:
        """Close the bus; cannot raise."""
        ...


class Node(Protocol):
    """The part of a device's conversation that the bus cycle uses."""

    @property
    def sync_dividers(self) -> Mapping[int, int]:
        """Return the SYNC divider of each COB-ID it receives; 0: independent of SYNC."""
        ...

    def receive(self, cob_id: int, data: bytes, sync_time: float) -> None:
        """Process one of its frames; ``sync_time``: send time (s) of the SYNC that it answers."""
        ...


class BusCycle:
    """Exchanges the frames of all synchronous devices of one bus, once a tick."""

    def __init__(
        self, link: FrameLink, nodes: Iterable[Node], own_node: int, heartbeat_period: float
    ) -> None:
        """``own_node``: our node number; ``heartbeat_period``: seconds between our heartbeats."""
        self._link = link
        self._receivers = {
            cob_id: (node.receive, divider)
            for node in nodes
            for cob_id, divider in node.sync_dividers.items()
        }
        self._answers = dict.fromkeys(self._receivers, sync_count.start())
        self._heartbeat = (
            heartbeat.BASE + own_node,
            heartbeat.encode(heartbeat.NmtState.OPERATIONAL),
        )
        self._heartbeat_period = heartbeat_period
        self._heartbeat_sent = self._sync_sent = _NEVER  # s, when last sent
        self._sync_times = [_NEVER] * sync_count.MAX_OPEN  # s, of the last SYNCs, by their number
        self._syncs = 0  # sent so far: the number of the last one
        self._answered = 0  # number of the latest SYNC that the next frame may answer
        self.unexpected = 0  # frames with a COB-ID of no node

    @property
    def last_sync_time(self) -> float:
        """Return when the last SYNC that the bus accepted was sent, s."""
        return self._sync_sent

    def receive(self) -> float:
        """Process the received frames and return the time (s) afterwards.

        While the link has a backlog, its frames may be older than the last SYNC; they then get the
        oldest possible age.
        """
        frames = self._link.drain()
        if not self._link.has_backlog:
            self._answered = self._syncs
        receivers, answers, latest = self._receivers, self._answers, self._answered
        for cob_id, data in frames:
            if cob_id not in receivers:
                self.unexpected += 1
                continue
            receive, divider = receivers[cob_id]
            number = latest
            if divider > 0:
                count = answers[cob_id] = sync_count.record_answer(answers[cob_id], divider, latest)
                number = count.answered
            receive(cob_id, data, self._sync_time(number))
        return self._link.now()

    def _sync_time(self, number: int) -> float:
        """Return when (s) the SYNC of this number was sent; `_NEVER` if no longer stored."""
        if number == 0 or self._syncs - number >= sync_count.MAX_OPEN:
            return _NEVER
        return self._sync_times[number % sync_count.MAX_OPEN]

    def now(self) -> float:
        """Return the time of the link's clock, s."""
        return self._link.now()

    def send(self, frames: Iterable[tuple[int, bytes]]) -> None:
        """Send the commands, then the SYNC on which they act, then the heartbeat when due."""
        # The time before the call, so that no status looks younger than it is.
        now = self._link.now()
        sent = [*frames, _SYNC_FRAME]
        sync_at = len(sent) - 1
        beats = now - self._heartbeat_sent >= self._heartbeat_period
        if beats:
            sent.append(self._heartbeat)
        refused = self._link.send(sent)
        if sync_at not in refused:
            self._sync_sent = now
            self._syncs += 1
            self._sync_times[self._syncs % sync_count.MAX_OPEN] = now
        if beats and sync_at + 1 not in refused:
            self._heartbeat_sent = now

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        self._link.close()
