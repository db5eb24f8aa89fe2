"""Sending side of an emulated node: its NMT state and active faults filter the frames."""

from __future__ import annotations

from enum import IntEnum

from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import Station
from sim_plant.emulators.schedule import Schedule

BABBLE_ID = 0x07F  # identifier of meaningless frames


class NmtState(IntEnum):
    """NMT states with their codes in a heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class Port:
    """The sending side of a node."""

    def __init__(self, station: Station, schedule: Schedule, active: dict[str, float]) -> None:
        self.nmt = NmtState.INITIALISING
        self._station = station
        self._schedule = schedule
        self._active = active

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

    def send_emergency(self, can_id: int, data: bytes) -> None:
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
