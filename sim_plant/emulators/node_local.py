"""What `canopen`'s LocalNode does of an emulated node: SDO, boot-up, NMT word, heartbeat."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import canopen

from sim_plant.emulators.node_network import NodeNetwork
from sim_plant.emulators.node_objects import Objects
from sim_plant.emulators.schedule import Schedule


class LocalSide:
    """A LocalNode whose integer objects live in Objects."""

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

    def enter(self, state: str) -> None:
        """Let heartbeats tell an NMT state."""
        self._node.nmt.state = state

    def quiet(self) -> None:
        """Stop the heartbeat."""
        self._node.nmt.stop_heartbeat()

    def request(self, data: bytes) -> None:
        """Answer an SDO request; one that is not 8 bytes long is none."""
        if len(data) != 8:
            return
        try:
            self._network.notify(self.request_id, bytearray(data), self._schedule.time())
        except struct.error:  # it aborts a transfer that never began: no object to name
            return

    def _on_read(self, *, index: int, subindex: int, od: Any) -> int | None:
        return self._objects.values.get((index, subindex))

    def _on_write(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        key = index, subindex
        kind = self._objects.kinds.get(key)
        if kind is not None:
            value = int.from_bytes(data, "little", signed=kind.signed)
            self._objects.check(key, value)
            self._objects.write(key, value)
