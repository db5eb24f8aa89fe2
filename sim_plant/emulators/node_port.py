"""Sending side of an emulated node: its NMT state and active faults filter the frames."""

from __future__ import annotations

from enum import IntEnum

from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import Station
from sim_plant.emulators.device_objects import Objects
from sim_plant.emulators.schedule import Schedule

INVALID = 1 << 31  # of a COB-ID
BABBLE_ID = 0x07F  # identifier of meaningless frames


class NmtState(IntEnum):
    """NMT states with their codes in a heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class Port:
    """The sending side of a node."""

    def __init__(
        self, station: Station, schedule: Schedule, active: dict[str, float], objects: Objects
    ) -> None:
        self.nmt = NmtState.INITIALISING
        self._station = station
        self._schedule = schedule
        self._active = active
        self._objects = objects
        self._inhibit_end = 0.0

    @property
    def is_off_bus(self) -> bool:
        """Whether the node is off the bus."""
        return "bus_off" in self._active or "powered_off" in self._active

    def send_basic(self, can_id: int, data: bytes) -> None:
        """Send SDO answers, boot-up and heartbeats."""
        active = self._active
        if can_id & 0x780 == 0x580:
            suppressed = "sdo_lost" in active
        else:
            suppressed = "silent" in active or "heartbeat_lost" in active
        if not suppressed:
            self._put(can_id, data)

    def report_emergency(self, data: bytes) -> None:
        """Send an EMCY with the COB-ID of 0x1014, after the inhibit time of 0x1015."""
        cob_id = self._objects.get(0x1014)
        if cob_id & INVALID:
            return
        now = self._schedule.time()
        inhibit = self._objects.get(0x1015) * 1.0e-4
        if now >= self._inhibit_end:
            self._inhibit_end = now + inhibit
            self._send_emergency(cob_id & 0x7FF, data)
        else:
            self._schedule.call_at(self._inhibit_end, self._send_emergency, cob_id & 0x7FF, data)
            self._inhibit_end += inhibit

    def _send_emergency(self, can_id: int, data: bytes) -> None:
        """Send an EMCY, not while STOPPED or booting."""
        if (
            self.nmt in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL)
            and "silent" not in self._active
        ):
            self._put(can_id, data)

    def send_pdo(self, can_id: int, data: bytes) -> None:
        """Send a PDO, in OPERATIONAL only."""
        active = self._active
        if self.nmt is NmtState.OPERATIONAL and not ("silent" in active or "pdo_lost" in active):
            self._put(can_id, data)

    def babble(self) -> None:
        """Send meaningless frames while the fault is active."""
        rate = self._active.get("babble", 0.0)
        if rate > 0.0:
            self._put(BABBLE_ID, bytes(8))
            self._schedule.call_at(self._schedule.time() + 1.0 / rate, self.babble)

    def leave(self) -> None:
        """Leave the bus for good."""
        self._station.leave()

    def _put(self, can_id: int, data: bytes) -> None:
        if not self.is_off_bus:
            self._station.send(Frame(can_id, data))
