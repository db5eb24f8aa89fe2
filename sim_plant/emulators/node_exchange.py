"""PDO exchange of an emulated node: with SYNC, by event, by timer."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators import device_errors
from sim_plant.emulators.device_errors import DeviceErrors
from sim_plant.emulators.node_guard import Deadlines
from sim_plant.emulators.node_pdos import PdoMap, Pdos
from sim_plant.emulators.schedule import Schedule
from sim_plant.units import Second

MAX_SYNCHRONOUS_TYPE = 240  # largest transmission type that is synchronous


class PdoExchange:
    """PDO traffic of a node while it is OPERATIONAL."""

    def __init__(
        self,
        pdos: Pdos,
        errors: DeviceErrors,
        schedule: Schedule,
        send: Callable[[int, bytes], None],
    ) -> None:
        self.tpdo_delay: Second = 0.0  # from SYNC to the TPDOs
        self.missing_octets = 0  # octets missing from every TPDO: a fault
        self.deadlines = Deadlines()
        self.has_event_tpdos = False  # some TPDO is event-driven
        self._pdos, self._errors = pdos, errors
        self._schedule, self._send = schedule, send
        self._pending: dict[int, tuple[PdoMap, bytes]] = {}
        self._sync_counts: dict[int, int] = {}  # since the last TPDO, by number
        self._last_sent: dict[int, tuple[bytes, Second]] = {}  # last data and time, by number

    def start(self) -> None:
        """Reset on entering OPERATIONAL: no RPDO is pending, every event TPDO counts as changed."""
        self._pending.clear()
        self._sync_counts.clear()
        self._last_sent.clear()
        self.deadlines.clear()

    def configure(self) -> None:
        """Apply a changed configuration."""
        if self._pdos.refresh():
            self.has_event_tpdos = any(
                map_.type > MAX_SYNCHRONOUS_TYPE for map_ in self._pdos.transmit
            )
            maps = self._pdos.receive.values()
            self.deadlines.set({map_.number: map_.timer for map_ in maps})

    def receive(self, map_: PdoMap, data: bytes, now: Second) -> None:
        """Apply an RPDO at once or with the next SYNC. A wrong length is an EMCY (CiA 301)."""
        if len(data) < map_.octets:
            self._errors.report_transient(device_errors.PDO_TOO_SHORT)
            return
        if len(data) > map_.octets:
            self._errors.report_transient(device_errors.PDO_TOO_LONG)  # its first bytes are used
        self.deadlines.record_activity(map_.number, now)
        if map_.type <= MAX_SYNCHRONOUS_TYPE:
            self._pending[map_.number] = map_, data[: map_.octets]
        else:
            self._pdos.unpack(map_, data[: map_.octets])

    def apply_pending(self) -> bool:
        """Apply the RPDOs that arrived before this SYNC; return whether there were any."""
        if not self._pending:
            return False
        pending = list(self._pending.values())
        self._pending.clear()
        for map_, data in pending:
            self._pdos.unpack(map_, data)
        return True

    def send_synchronous(self, now: Second) -> None:
        """Send the synchronous TPDOs that are due with this SYNC, sampled now."""
        for map_ in self._pdos.transmit:
            if map_.type > MAX_SYNCHRONOUS_TYPE:
                continue
            count = self._sync_counts.get(map_.number, 0) + 1
            self._sync_counts[map_.number] = count
            if map_.type == 0:
                data = self._pdos.pack(map_)
                if self._last_sent.get(map_.number, (b"", 0.0))[0] != data:
                    self._send_tpdo(map_, data, now)
            elif count >= map_.type:
                self._sync_counts[map_.number] = 0
                self._send_tpdo(map_, self._pdos.pack(map_), now)

    def send_events(self, now: Second) -> None:
        """Send the TPDOs of types 254 and 255 that changed or whose timer expired."""
        for map_ in self._pdos.transmit:
            if map_.type <= MAX_SYNCHRONOUS_TYPE:
                continue
            last, at = self._last_sent.get(map_.number, (b"", float("-inf")))
            data = self._pdos.pack(map_)
            timed = map_.timer > 0.0 and now - at >= map_.timer
            if timed or (data != last and now - at >= map_.inhibit):
                self._send_tpdo(map_, data, now)

    def _send_tpdo(self, map_: PdoMap, data: bytes, now: Second) -> None:
        self._last_sent[map_.number] = data, now
        data = data[: max(0, len(data) - self.missing_octets)]
        if self.tpdo_delay > 0.0 and map_.type <= MAX_SYNCHRONOUS_TYPE:
            self._schedule.call_at(now + self.tpdo_delay, self._send, map_.cob_id, data)
        else:
            self._send(map_.cob_id, data)
