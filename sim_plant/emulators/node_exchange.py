"""When an emulated node's PDOs go and come: with SYNC, by event, by timer."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators import node_errors
from sim_plant.emulators.node_errors import Errors
from sim_plant.emulators.node_guard import Deadlines
from sim_plant.emulators.node_pdos import Map, Pdos
from sim_plant.emulators.schedule import Schedule
from sim_plant.units import Second

SYNCHRONOUS = 240  # the largest type that goes with SYNC


class Exchange:
    """PDO traffic of a node while it is OPERATIONAL."""

    def __init__(
        self, pdos: Pdos, errors: Errors, schedule: Schedule, send: Callable[[int, bytes], None]
    ) -> None:
        self.delay: Second = 0.0  # from SYNC to the TPDOs
        self.shorter = 0  # octets missing from every TPDO: a fault
        self.deadlines = Deadlines()
        self.eventful = False  # some TPDO goes by event
        self._pdos, self._errors = pdos, errors
        self._schedule, self._send = schedule, send
        self._pending: dict[int, tuple[Map, bytes]] = {}
        self._syncs: dict[int, int] = {}  # since the last TPDO, by number
        self._sent: dict[int, tuple[bytes, Second]] = {}  # last data and time, by number

    def start(self) -> None:
        """Begin anew, as on entering OPERATIONAL: nothing pends, events count as changes."""
        self._pending.clear()
        self._syncs.clear()
        self._sent.clear()
        self.deadlines.forget()

    def configure(self) -> None:
        """Take over a changed configuration."""
        if self._pdos.refresh():
            self.eventful = any(map_.type > SYNCHRONOUS for map_ in self._pdos.transmit)
            maps = self._pdos.receive.values()
            self.deadlines.set({map_.number: map_.timer for map_ in maps})

    def arrived(self, map_: Map, data: bytes, now: Second) -> None:
        """Take an RPDO: at once, or with the next SYNC. A wrong length is an EMCY (CiA 301)."""
        if len(data) < map_.octets:
            self._errors.pass_by(node_errors.PDO_TOO_SHORT)
            return
        if len(data) > map_.octets:
            self._errors.pass_by(node_errors.PDO_TOO_LONG)  # and its first bytes are used
        self.deadlines.hear(map_.number, now)
        if map_.type <= SYNCHRONOUS:
            self._pending[map_.number] = map_, data[: map_.octets]
        else:
            self._pdos.unpack(map_, data[: map_.octets])

    def apply(self) -> bool:
        """Let the RPDOs act that came before this SYNC; say whether there were any."""
        if not self._pending:
            return False
        pending = list(self._pending.values())
        self._pending.clear()
        for map_, data in pending:
            self._pdos.unpack(map_, data)
        return True

    def sampled(self, now: Second) -> None:
        """Send the TPDOs that are due with a SYNC, sampled now."""
        for map_ in self._pdos.transmit:
            if map_.type > SYNCHRONOUS:
                continue
            count = self._syncs.get(map_.number, 0) + 1
            self._syncs[map_.number] = count
            if map_.type == 0:
                data = self._pdos.packed(map_)
                if self._sent.get(map_.number, (b"", 0.0))[0] != data:
                    self._put(map_, data, now)
            elif count >= map_.type:
                self._syncs[map_.number] = 0
                self._put(map_, self._pdos.packed(map_), now)

    def events(self, now: Second) -> None:
        """Send the TPDOs of types 254 and 255 that changed or whose timer ran out."""
        for map_ in self._pdos.transmit:
            if map_.type <= SYNCHRONOUS:
                continue
            last, at = self._sent.get(map_.number, (b"", float("-inf")))
            data = self._pdos.packed(map_)
            timed = map_.timer > 0.0 and now - at >= map_.timer
            if timed or (data != last and now - at >= map_.inhibit):
                self._put(map_, data, now)

    def _put(self, map_: Map, data: bytes, now: Second) -> None:
        self._sent[map_.number] = data, now
        data = data[: max(0, len(data) - self.shorter)]
        if self.delay > 0.0 and map_.type <= SYNCHRONOUS:
            self._schedule.call_at(now + self.delay, self._send, map_.cob_id, data)
        else:
            self._send(map_.cob_id, data)
