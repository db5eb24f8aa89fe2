"""Errors of an emulated device: EMCY messages, error register 0x1001, history 0x1003. CiA 301."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators import device_objects
from sim_plant.emulators.device_objects import Key, Objects, SdoRefusedError

# EMCY codes
GENERAL = 0x1000
OVER_CURRENT = 0x2310
DC_LINK_OVER_VOLTAGE = 0x3210
DC_LINK_UNDER_VOLTAGE = 0x3220
OVER_TEMPERATURE = 0x4310
SENSOR = 0x7305
COMMUNICATION = 0x7500
BUS_OVERRUN = 0x8110
HEARTBEAT_LOST = 0x8130
BUS_OFF_RECOVERED = 0x8140
PDO_TOO_SHORT = 0x8210
PDO_TOO_LONG = 0x8220
RPDO_TIMEOUT = 0x8250  # [C] CiA 301
FOLLOWING_ERROR = 0x8611
SYNCHRONISATION = 0x8700  # [C] CiA 402
VENDOR = 0xFF00

# Bit of the error register by the code's first digits; every error also sets bit 0.
REGISTER = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: 0x10, 0xF: 0x80}


def register_bits(code: int) -> int:
    """Return the bits of 0x1001 that an error sets: 0 generic, 1 current, 2 voltage, 3 temperature,
    4 communication, 5 profile, 7 manufacturer."""
    if code >> 8 == 0x86:
        return 0x21
    return 0x01 | REGISTER.get(code >> 12, 0)


class DeviceErrors:
    """The active errors of a device, their EMCY messages and history."""

    def __init__(self, objects: Objects) -> None:
        self.active: set[int] = set()  # EMCY codes
        self.send: Callable[[bytes], None] = lambda data: None  # sends 8 bytes: set by a transport
        self._objects = objects
        self._history_length = sum(1 for index, sub in objects.types if index == 0x1003 and sub > 0)
        objects.guards[0x1003] = self._guard_history
        objects.hooks[0x1003, 0] = lambda value: self.clear_history()

    def raise_error(self, code: int, vendor: bytes = b"") -> None:
        """Set an error and send its EMCY, once until the error is cleared."""
        if code in self.active:
            return
        self.active.add(code)
        history = [self._objects.get(0x1003, sub) for sub in range(1, self._history_length)]
        count = min(self._objects.get(0x1003) + 1, self._history_length)
        for sub, value in enumerate([code, *history], start=1):
            self._objects.put(0x1003, value, sub)
        self._objects.put(0x1003, count)
        self._send_emcy(code, vendor)

    def report_transient(self, code: int) -> None:
        """Send the EMCY of an event that does not last."""
        self.raise_error(code)
        self.active.discard(code)
        self._set_register()

    def clear(self, code: int) -> None:
        """Clear one error; after the last one send EMCY code 0."""
        self.active.discard(code)
        if self.active:
            self._set_register()
        else:
            self._send_emcy(0, b"")

    def clear_all(self) -> None:
        """Clear all errors; send EMCY code 0 if there was one."""
        if self.active:
            self.active.clear()
            self._send_emcy(0, b"")

    def clear_history(self) -> None:
        """Clear the error history."""
        for sub in range(self._history_length + 1):
            self._objects.put(0x1003, 0, sub)

    def _set_register(self) -> int:
        register = 0
        for code in self.active:
            register |= register_bits(code)
        self._objects.put(0x1001, register)
        return register

    def _send_emcy(self, code: int, vendor: bytes) -> None:
        data = code.to_bytes(2, "little") + bytes([self._set_register()])
        self.send(data + vendor[:5].ljust(5, b"\0"))

    def _guard_history(self, key: Key, value: int) -> None:
        if key[1] == 0 and value != 0:
            raise SdoRefusedError(device_objects.BAD_VALUE)
