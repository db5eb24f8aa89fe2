"""Parts of an emulated node that `canopen`'s LocalNode provides: SDO, boot-up, heartbeat."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import canopen

from sim_plant.emulators.device_objects import Objects, SdoRefusedError
from sim_plant.emulators.node_network import NodeNetwork
from sim_plant.emulators.schedule import Schedule


class LocalNodeAdapter:
    """A LocalNode whose integer objects are stored in Objects."""

    def __init__(
        self,
        node_id: int,
        dictionary: canopen.ObjectDictionary,
        objects: Objects,
        schedule: Schedule,
        send: Callable[[int, bytes], None],
    ) -> None:
        self.request_id = 0x600 + node_id
        self._objects = objects
        self._schedule = schedule
        self._network = NodeNetwork(send, schedule)
        self._node = canopen.LocalNode(node_id, dictionary)
        self._network[node_id] = self._node
        self._node.add_read_callback(self._on_read)
        self._node.add_write_callback(self._on_write)

    def boot(self) -> None:
        """Send the boot-up message, enter PRE-OPERATIONAL and start the heartbeat of 0x1017."""
        self._node.nmt.state = "INITIALISING"
        self._node.nmt.state = "PRE-OPERATIONAL"

    def set_state(self, state: str) -> None:
        """Set the NMT state that heartbeats report."""
        self._node.nmt.state = state

    def stop_heartbeat(self) -> None:
        """Stop the heartbeat."""
        self._node.nmt.stop_heartbeat()

    def request(self, data: bytes) -> None:
        """Answer an SDO request; data that is not 8 bytes long is ignored."""
        if len(data) != 8:
            return
        try:
            self._network.notify(self.request_id, bytearray(data), self._schedule.time())
        except struct.error:  # the library aborts a transfer that never began: no object to name
            return

    def _on_read(self, *, index: int, subindex: int, od: Any) -> int | None:
        return self._objects.values.get((index, subindex))

    def _on_write(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        key = index, subindex
        type_ = self._objects.types.get(key)
        if type_ is not None:
            value = int.from_bytes(data, "little", signed=type_.signed)
            try:
                self._objects.check(key, value)
            except SdoRefusedError as error:
                raise canopen.SdoAbortedError(error.code) from error
            self._objects.write(key, value)
