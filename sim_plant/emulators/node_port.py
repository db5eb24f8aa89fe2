"""What leaves an emulated node, by its NMT state and by the faults it has."""

from __future__ import annotations

from enum import IntEnum

from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import Station
from sim_plant.emulators.schedule import Schedule

BABBLE = 0x07F  # identifier of frames that mean nothing


class Nmt(IntEnum):
    """NMT states, as a heartbeat tells them."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class Port:
    """The sending side of a node."""

    def __init__(self, station: Station, schedule: Schedule, active: dict[str, float]) -> None:
        self.nmt = Nmt.INITIALISING
        self._station = station
        self._schedule = schedule
        self._active = active

    @property
    def cut(self) -> bool:
        """Whether the node is off the bus."""
        return "bus_off" in self._active or "powered_off" in self._active

    def basic(self, can_id: int, data: bytes) -> None:
        """Send SDO answers, boot-up and heartbeats."""
        active = self._active
        if can_id & 0x780 == 0x580:
            lost = "sdo_lost" in active
        else:
            lost = "silent" in active or "heartbeat_lost" in active
        if not lost:
            self._put(can_id, data)

    def emergency(self, can_id: int, data: bytes) -> None:
        """Send an EMCY, not while STOPPED or booting."""
        if self.nmt in (Nmt.OPERATIONAL, Nmt.PRE_OPERATIONAL) and "silent" not in self._active:
            self._put(can_id, data)

    def process(self, can_id: int, data: bytes) -> None:
        """Send a PDO, in OPERATIONAL only."""
        active = self._active
        if self.nmt is Nmt.OPERATIONAL and not ("silent" in active or "pdo_lost" in active):
            self._put(can_id, data)

    def babble(self) -> None:
        """Send frames that mean nothing as long as the fault lasts."""
        rate = self._active.get("babble", 0.0)
        if rate > 0.0:
            self._put(BABBLE, bytes(8))
            self._schedule.call_at(self._schedule.time() + 1.0 / rate, self.babble)

    def leave(self) -> None:
        """Leave the bus for good."""
        self._station.leave()

    def _put(self, can_id: int, data: bytes) -> None:
        if not self.cut:
            self._station.send(Frame(can_id, data))
