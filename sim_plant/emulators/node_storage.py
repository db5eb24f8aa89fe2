"""What an emulated node has after a reset: defaults, or what was stored over 0x1010. CiA 301."""

from __future__ import annotations

from sim_plant.emulators import node_objects
from sim_plant.emulators.node_objects import Key, Objects, Refused

STORE, RESTORE = 0x1010, 0x1011
SIGNATURES = {STORE: 0x65766173, RESTORE: 0x64616F6C}  # "save", "load"
COMMUNICATION = 0x1FFF  # the last index of the communication area


class Storage:
    """Values at power-on."""

    def __init__(self, objects: Objects) -> None:
        self.defaults = dict(objects.values)
        self._objects = objects
        self._power_on = self.defaults
        for index, sub in objects.kinds:
            if index in SIGNATURES and sub:
                objects.guards[index] = self._guard

    def recall(self, *, all_of_them: bool) -> None:
        """Take objects back to their values at power-on: all, or the communication area's."""
        high = 0xFFFF if all_of_them else COMMUNICATION
        self._objects.restore(self._power_on, 0x1000, high)

    def _guard(self, key: Key, signature: int) -> None:
        """Store or restore: what is written is a signature, not a value."""
        if signature != SIGNATURES[key[0]]:
            raise Refused(node_objects.NOT_STORED)
        self._power_on = dict(self._objects.values if key[0] == STORE else self.defaults)
