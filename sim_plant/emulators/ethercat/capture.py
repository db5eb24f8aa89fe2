"""A capture file (pcap, times in ns) of the frames on a wire."""

from __future__ import annotations

import struct
from pathlib import Path

_GLOBAL = struct.Struct("<IHHiIII")
_RECORD = struct.Struct("<IIII")
NANOSECONDS, ETHERNET = 0xA1B23C4D, 1


class Capture:
    """An open capture file."""

    def __init__(self, path: Path) -> None:
        """Create the file."""
        self._file = path.open("wb")
        self._file.write(_GLOBAL.pack(NANOSECONDS, 2, 4, 0, 0, 0xFFFF, ETHERNET))

    def write(self, frame: bytes, now: int) -> None:
        """Append a frame; `now` in ns."""
        seconds, ns = divmod(now, 1_000_000_000)
        self._file.write(_RECORD.pack(seconds, ns, len(frame), len(frame)) + frame)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
