"""Access of the master to the SII through registers 0x0500 to 0x050F."""

from __future__ import annotations

import struct

from sim_plant.emulators.ethercat import registers, sii
from sim_plant.emulators.ethercat.controller import SlaveController

READS_8_OCTETS, CHECKSUM_ERROR, COMMAND_ERROR, WRITE_ERROR = 0x0040, 0x0800, 0x2000, 0x4000
WRITE_ENABLE, COMMAND_MASK = 0x0001, 0x0700
READ, WRITE, RELOAD = 0x0100, 0x0200, 0x0400
PDI_HAS_ACCESS, FORCE = 0x01, 0x02


class Eeprom:
    """The EEPROM behind a controller."""

    def __init__(self, controller: SlaveController, image: bytes) -> None:
        self.image = bytearray(image)
        self._controller = controller
        self.is_damaged = False  # a fault: it reads as if erased
        start = registers.SII_CONTROL
        controller.after_write.add(start, start + 2, self._on_command)

    def set_identity(self, identity: sii.Identity) -> None:
        """Replace the identity; the rest, also what the master wrote, stays."""
        struct.pack_into("<4I", self.image, 2 * sii.VENDOR, *identity)

    def is_valid(self) -> bool:
        """Return whether the check octet is right."""
        head = self._read(0, 16)
        return sii.check_octet(head) == head[2 * sii.CHECK]

    def load(self) -> None:
        """Take the alias from the image, as at power-on."""
        controller, valid = self._controller, self.is_valid()
        alias = int.from_bytes(self._read(2 * sii.ALIAS, 2), "little") if valid else 0
        controller.set(registers.STATION_ALIAS, alias, 2)
        controller.set(registers.SII_CONTROL, self._status(), 2)

    def _status(self, error: int = 0) -> int:
        return READS_8_OCTETS | error | (0 if self.is_valid() else CHECKSUM_ERROR)

    def _read(self, at: int, octets: int) -> bytes:
        if self.is_damaged:
            return b"\xff" * octets
        return bytes(self.image[at : at + octets]).ljust(octets, b"\xff")

    def _on_command(self) -> None:
        controller = self._controller
        control = controller.get(registers.SII_CONTROL, 2)
        command, error = control & COMMAND_MASK, 0
        at = 2 * controller.get(registers.SII_ADDRESS, 4)
        if controller.get(registers.SII_ACCESS, 1) & PDI_HAS_ACCESS:
            error = COMMAND_ERROR if command else 0
        elif command == READ:
            data = self._read(at, 8)
            controller.memory[registers.SII_DATA : registers.SII_END] = data
        elif command == WRITE:
            if not control & WRITE_ENABLE:
                error = WRITE_ERROR
            elif at + 2 > len(self.image):
                error = COMMAND_ERROR
            else:
                start = registers.SII_DATA
                self.image[at : at + 2] = controller.memory[start : start + 2]
        elif command == RELOAD:
            self.load()
        elif command:
            error = COMMAND_ERROR
        controller.set(registers.SII_CONTROL, self._status(error), 2)
