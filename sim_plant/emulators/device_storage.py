"""Object values after a reset: defaults, or values stored over 0x1010 (CiA 301)."""

from __future__ import annotations

from sim_plant.emulators import device_objects
from sim_plant.emulators.device_objects import Key, Objects, SdoRefusedError

STORE, RESTORE = 0x1010, 0x1011
SIGNATURES = {STORE: 0x65766173, RESTORE: 0x64616F6C}  # "save", "load"
LAST_COMMUNICATION_INDEX = 0x1FFF  # the last index of the communication area


class Storage:
    """Values at power-on."""

    def __init__(self, objects: Objects) -> None:
        self.defaults = dict(objects.values)
        self._objects = objects
        self._power_on = self.defaults
        for index, sub in objects.types:
            if index in SIGNATURES and sub:
                objects.guards[index] = self._guard

    def restore(self, *, all_of_them: bool) -> None:
        """Restore objects to their power-on values: all, or those of the communication area."""
        high = 0xFFFF if all_of_them else LAST_COMMUNICATION_INDEX
        self._objects.restore(self._power_on, 0x1000, high)

    def _guard(self, key: Key, signature: int) -> None:
        """Store or restore: the written value must be the signature."""
        if signature != SIGNATURES[key[0]]:
            raise SdoRefusedError(device_objects.NOT_STORED)
        self._power_on = dict(self._objects.values if key[0] == STORE else self.defaults)
