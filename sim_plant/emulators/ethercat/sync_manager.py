"""Sync managers of a slave controller: three-buffer process data, and mailboxes."""

from __future__ import annotations

import struct
from collections.abc import Callable

REGISTERS = 8  # octets of one sync manager
_FORM = struct.Struct("<HHBBBB")  # start, length, control, status, activate, PDI control
STATUS, ACTIVATE, PDI = 5, 6, 7  # offsets in the registers

MODE_MASK, BUFFERED, MAILBOX = 0x03, 0x00, 0x02  # control
DIRECTION_MASK, WRITTEN_BY_MASTER = 0x0C, 0x04
WATCHDOG_TRIGGER = 0x40
FULL = 0x08  # status of a mailbox
ENABLE, REPEAT = 0x01, 0x02  # activate; REPEAT toggles: send the last box again
REPEAT_ACKNOWLEDGED = 0x02  # PDI control


class SyncManager:
    """One sync manager over its eight registers, which stay in the controller's memory."""

    def __init__(self, memory: bytearray, at: int) -> None:
        """`at`: address of its registers in the memory."""
        self._memory = memory
        self._at = at
        self.on_written: Callable[[bytes], None] = lambda data: None  # the last octet was written
        self.on_read: Callable[[], None] = lambda: None  # the last octet was read
        self.on_repeat: Callable[[], None] = lambda: None
        self.blocked = False  # by the device: below SAFEOP, process data
        self._repeat = 0
        self._area: tuple[int, int, int, bool] | None = None
        self.configure()

    def configure(self) -> None:
        """Read the registers after a write of the master; a change of the area empties it."""
        fields = _FORM.unpack_from(self._memory, self._at)
        self.start: int = fields[0]
        self.length: int = fields[1]
        self.control: int = fields[2]
        activate: int = fields[4]
        self.enabled = bool(activate & ENABLE) and self.length > 0
        self.end = self.start + self.length
        self.is_mailbox = self.control & MODE_MASK == MAILBOX
        self.is_written_by_master = self.control & DIRECTION_MASK == WRITTEN_BY_MASTER
        area = (self.start, self.length, self.control, self.enabled)
        if self._area != area:
            self._area = area
            self._pending = bytearray(self.length)  # the buffer that the master writes
            self.latest = bytes(self.length)  # the complete one
            self._current = self.latest  # the one that the master reads
            self.fresh = False  # a complete buffer was written since the area was set up
            self.is_full = False
            self._is_open = False
            self._set_status()
        if activate & REPEAT != self._repeat:
            self._repeat = activate & REPEAT
            self.on_repeat()
            pdi = self._memory[self._at + PDI] & ~REPEAT_ACKNOWLEDGED
            self._memory[self._at + PDI] = pdi | self._repeat

    def covers(self, address: int, length: int) -> bool:
        """Return whether an access touches the area."""
        return self.enabled and address < self.end and address + length > self.start

    # ---- master ---------------------------------------------------------------------------------

    def read(self, address: int, length: int) -> bytes | None:
        """Return what the master reads; None if the access is refused."""
        first, last = address - self.start, address + length == self.end
        if self.blocked or first < 0 or address + length > self.end:
            return None
        if self.is_mailbox:
            if self.is_written_by_master or not self.is_full:
                return None
        elif first == 0:
            self._current = bytes(self._pending) if self.is_written_by_master else self.latest
        data = bytes(self._current[first : first + length])
        if last and not self.is_written_by_master:
            self.is_full = False
            self._set_status()
            self.on_read()
        return data

    def write(self, address: int, data: bytes) -> bool:
        """Take what the master writes; return False if the access is refused."""
        first, last = address - self.start, address + len(data) == self.end
        if self.blocked or not self.is_written_by_master or first < 0:
            return False
        if address + len(data) > self.end or (self.is_mailbox and not self._may_write(first)):
            return False
        self._pending[first : first + len(data)] = data
        if last:
            self.latest = bytes(self._pending)
            self.fresh = True
            self.is_full = self.is_mailbox
            self._is_open = False
            self._set_status()
            self.on_written(self.latest)
        return True

    def write_bits(self, address: int, value: int, mask: int) -> bool:
        """Take single bits of octets from an address on; the others keep their pending value."""
        octets = (mask.bit_length() + 7) // 8
        first = address - self.start
        if not 0 <= first <= self.length - octets:
            return False
        old = int.from_bytes(self._pending[first : first + octets], "little")
        return self.write(address, (old & ~mask | value & mask).to_bytes(octets, "little"))

    def _may_write(self, first: int) -> bool:
        if self.is_full or not (first == 0 or self._is_open):
            return False
        self._is_open = True
        return True

    # ---- device ---------------------------------------------------------------------------------

    def put(self, data: bytes) -> None:
        """Give the master a buffer or a box; it is cut or padded to the area."""
        self.latest = data[: self.length].ljust(self.length, b"\0")
        if self.is_mailbox:
            self._current = self.latest
            self.is_full = True
        self._set_status()

    def release(self) -> None:
        """Empty a box that the device has taken."""
        self.is_full = False
        self._set_status()

    def _set_status(self) -> None:
        if self.is_mailbox:
            status = FULL if self.is_full else 0
        else:
            status = 0 if self.fresh or not self.is_written_by_master else 0x30  # none written
        self._memory[self._at + STATUS] = status
