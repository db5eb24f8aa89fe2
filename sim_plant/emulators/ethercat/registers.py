"""Register addresses of a slave controller, and which of them the master may write."""

from __future__ import annotations

REGISTERS_END = 0x1000  # from here on: memory of process data and mailboxes

TYPE, FMMU_COUNT, SYNC_MANAGER_COUNT, RAM_SIZE, PORTS, FEATURES = 0x0, 0x4, 0x5, 0x6, 0x7, 0x8
STATION_ADDRESS, STATION_ALIAS = 0x0010, 0x0012
DL_CONTROL, ALIAS_ENABLE, DL_STATUS = 0x0100, 0x0103, 0x0110
AL_CONTROL, AL_STATUS, AL_STATUS_CODE = 0x0120, 0x0130, 0x0134
PDI_CONTROL = 0x0140
WATCHDOG_DIVIDER, WATCHDOG_PDI, WATCHDOG_TIME = 0x0400, 0x0410, 0x0420
WATCHDOG_STATUS, WATCHDOG_COUNT = 0x0440, 0x0442
SII_ACCESS, SII_CONTROL, SII_ADDRESS, SII_DATA, SII_END = 0x0500, 0x0502, 0x0504, 0x0508, 0x0510
FMMUS, SYNC_MANAGERS = 0x0600, 0x0800
PORT_TIMES, SYSTEM_TIME, RECEIVE_TIME, SYSTEM_OFFSET = 0x0900, 0x0910, 0x0918, 0x0920
SYSTEM_DELAY, SYSTEM_DIFFERENCE, SPEED_START = 0x0928, 0x092C, 0x0930
SYNC_UNIT, SYNC_ACTIVATION, SYNC_START = 0x0980, 0x0981, 0x0990
SYNC0_CYCLE, SYNC1_CYCLE, DC_END = 0x09A0, 0x09A4, 0x09B0

HAS_DC = 0x04  # bit of the features

_WRITABLE = (
    (STATION_ADDRESS, 2),
    (DL_CONTROL, 4),
    (AL_CONTROL, 2),
    (0x0200, 2),  # mask of interrupts
    (0x0300, 0x14),  # error counters
    (WATCHDOG_DIVIDER, 2),
    (WATCHDOG_PDI, 2),
    (WATCHDOG_TIME, 2),
    (WATCHDOG_COUNT, 2),
    (SII_ACCESS, 1),
    (SII_CONTROL, SII_END - SII_CONTROL),
)
_WRITABLE_DC = (
    (PORT_TIMES, 4),
    (SYSTEM_TIME, 8),
    (SYSTEM_OFFSET, 12),
    (SPEED_START, 6),
    (SYNC_UNIT, 2),
    (SYNC_START, 0x18),
)


def writable(fmmus: int, sync_managers: int, has_dc: bool) -> bytes:
    """Return a mask of the registers: 1 where the master may write."""
    mask = bytearray(REGISTERS_END)
    areas = [*_WRITABLE, (FMMUS, 16 * fmmus), *(_WRITABLE_DC if has_dc else ())]
    for number in range(sync_managers):
        areas += [(SYNC_MANAGERS + 8 * number, 5), (SYNC_MANAGERS + 8 * number + 6, 1)]
    for start, length in areas:
        mask[start : start + length] = b"\1" * length
    return bytes(mask)
