"""Another node on the rig's CAN bus that should not be there: a second master, a wrong address.

CiA 301 has one SYNC producer and one NMT master on a bus, and one sender of each COB-ID. Nothing in
a frame says who sent it: what a second one sends is taken for the first one's.
"""

from __future__ import annotations

from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import STOP
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.node_pdos import Map
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.torque_drive import TorqueDrive
from sim_plant.units import Ampere, Second

SYNC, NMT = 0x080, 0x000
CURRENT: Ampere = 19.6  # of the second master's set-points
FAULTS = {
    "set_points": f"sends the drive's RPDO after each of the rig's, asking for {CURRENT:g} A",
    "nmt": "sends NMT stop to the drive every 0.1 s",
    "sync": "sends SYNC every ms, beside the rig's own",
    "tpdo": "sends the drive's TPDOs every ms, as they were when it began",
}
_PERIODS: dict[str, Second] = {"nmt": 0.1, "sync": 0.001, "tpdo": 0.001}


class ForeignNode:
    """It is silent until it is given a fault; then it sends in the name of others."""

    def __init__(self, drive: TorqueDrive, hub: CanHub, schedule: Schedule) -> None:
        """`drive`: whose frames it sends."""
        self.faults = DeviceFaults(FAULTS)
        self._drive, self._schedule = drive, schedule
        self._station = hub.join(self._hear)
        self._last: dict[int, bytes] = {}  # first data of each TPDO of the drive since the fault
        self._due: dict[str, Second] = {}  # of the next frames of each fault that is on

    def tend(self) -> None:
        """Begin what was switched on; to be called often."""
        if not self.faults.on("tpdo"):
            self._last.clear()
        for name in _PERIODS:
            if not self.faults.on(name):
                self._due.pop(name, None)
            elif name not in self._due:
                self._due[name] = self._schedule.time()
                self._go_on(name)

    def _go_on(self, name: str) -> None:
        if name not in self._due or not self.faults.on(name):
            return
        for frame in self._frames(name):
            self._station.send(frame)
        now = self._schedule.time()
        self._due[name] = max(self._due[name] + _PERIODS[name], now)
        self._schedule.call_at(self._due[name], self._go_on, name)

    def _frames(self, name: str) -> list[Frame]:
        if name == "sync":
            return [Frame(SYNC, b"")]
        if name == "nmt":
            return [Frame(NMT, bytes((STOP, self._drive.params.node_id)))]
        return [Frame(cob_id, data) for cob_id, data in self._last.items()]

    def _commanded(self, map_: Map) -> bytes:
        """The RPDO as the drive has it, but for the set-point."""
        word = 0
        for key, shift, mask, _ in map_.fields:
            target = key == (0x6071, 0)
            value = self._drive.raw_target(CURRENT) if target else self._drive.objects.get(*key)
            word |= (value & mask) << shift
        return word.to_bytes(map_.octets, "little")

    def _hear(self, frame: Frame) -> None:
        if not (self.faults.on("set_points") or self.faults.on("tpdo")):
            return
        pdos, identifier = self._drive.pdos, frame.identifier
        if self.faults.on("set_points") and identifier in pdos.receive:
            self._station.send(Frame(identifier, self._commanded(pdos.receive[identifier])))
        sent = any(identifier == map_.cob_id for map_ in pdos.transmit)
        if self.faults.on("tpdo") and sent and identifier not in self._last:
            self._last[identifier] = frame.data
