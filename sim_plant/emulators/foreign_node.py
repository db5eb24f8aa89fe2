"""An unwanted node on the rig's CAN bus: a second master, or a node with a wrong address.

CiA 301 allows one SYNC producer and one NMT master on a bus, and one sender of each COB-ID. A frame
does not identify its sender, so receivers attribute the frames of a second sender to the first.
"""

from __future__ import annotations

from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import STOP, CanopenNode
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.node_pdos import PdoMap
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.torque_drive import TorqueDrive
from sim_plant.units import Ampere, Second

SYNC, NMT = 0x080, 0x000
CURRENT: Ampere = 19.6  # of the second master's set-points
FAULTS = {
    "set_points": f"sends the drive's RPDO after each of the rig's, commanding {CURRENT:g} A",
    "nmt": "sends NMT stop to the drive every 0.1 s",
    "sync": "sends SYNC every ms, in addition to the rig's own",
    "tpdo": "sends the drive's TPDOs every ms, with the data of the start of the fault",
}
_PERIODS: dict[str, Second] = {"nmt": 0.1, "sync": 0.001, "tpdo": 0.001}


class ForeignNode:
    """A node that is silent until a fault is switched on and then sends other nodes' frames."""

    def __init__(self, drive: CanopenNode[TorqueDrive], hub: CanHub, schedule: Schedule) -> None:
        """`drive`: the drive whose frames it imitates."""
        self.faults = DeviceFaults(FAULTS)
        self._drive, self._schedule = drive, schedule
        self._station = hub.join(self._receive)
        self._recorded_tpdos: dict[
            int, bytes
        ] = {}  # first data of each TPDO of the drive since the start of the fault
        self._next_times: dict[str, Second] = {}  # time of the next frames of each active fault

    def poll(self) -> None:
        """Start the faults that were switched on; call it often."""
        if not self.faults.is_on("tpdo"):
            self._recorded_tpdos.clear()
        for name in _PERIODS:
            if not self.faults.is_on(name):
                self._next_times.pop(name, None)
            elif name not in self._next_times:
                self._next_times[name] = self._schedule.time()
                self._send_next(name)

    def _send_next(self, name: str) -> None:
        if name not in self._next_times or not self.faults.is_on(name):
            return
        for frame in self._frames(name):
            self._station.send(frame)
        now = self._schedule.time()
        self._next_times[name] = max(self._next_times[name] + _PERIODS[name], now)
        self._schedule.call_at(self._next_times[name], self._send_next, name)

    def _frames(self, name: str) -> list[Frame]:
        if name == "sync":
            return [Frame(SYNC, b"")]
        if name == "nmt":
            return [Frame(NMT, bytes((STOP, self._drive.params.node_id)))]
        return [Frame(cob_id, data) for cob_id, data in self._recorded_tpdos.items()]

    def _rpdo_data(self, map_: PdoMap) -> bytes:
        """Return the data of the RPDO from the drive's objects, with another set-point."""
        payload = 0
        for key, shift, mask, _ in map_.fields:
            is_target = key == (0x6071, 0)
            value = (
                self._drive.device.raw_target(CURRENT)
                if is_target
                else self._drive.objects.get(*key)
            )
            payload |= (value & mask) << shift
        return payload.to_bytes(map_.octets, "little")

    def _receive(self, frame: Frame) -> None:
        if not (self.faults.is_on("set_points") or self.faults.is_on("tpdo")):
            return
        pdos, identifier = self._drive.pdos, frame.identifier
        if self.faults.is_on("set_points") and identifier in pdos.receive:
            self._station.send(Frame(identifier, self._rpdo_data(pdos.receive[identifier])))
        is_tpdo = any(identifier == map_.cob_id for map_ in pdos.transmit)
        if self.faults.is_on("tpdo") and is_tpdo and identifier not in self._recorded_tpdos:
            self._recorded_tpdos[identifier] = frame.data
