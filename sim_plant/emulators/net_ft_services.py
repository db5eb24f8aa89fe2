"""Services of a Net F/T box besides its stream: single readings over TCP, settings as XML.

Source: ATI Net F/T manual, TCP interface (20-byte requests) and XML pages (netftapi2.xml).
"""

from __future__ import annotations

import asyncio
import struct
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from sim_plant.emulators.ft_calibration import NEWTON, NEWTON_METRE

if TYPE_CHECKING:
    from sim_plant.emulators.net_ft import NetFt

READ, CALIBRATION, TRANSFORM, THRESHOLD = 0, 1, 2, 3
REQUEST = 20
UNIT_NAMES = ("N", "Nm")


def scales(box: NetFt) -> list[int]:
    """Return counts per 16-bit step, chosen so that the rating of each axis fits."""
    calibration = box.settings.calibration
    per_unit = [calibration.counts_per_force] * 3 + [calibration.counts_per_torque] * 3
    return [
        min(-(-int(rating * scale) // 32000), 0xFFFF)
        for rating, scale in zip(calibration.ratings, per_unit, strict=True)
    ]


class BoxService(ABC):
    """One TCP port of the box."""

    def __init__(self, box: NetFt) -> None:
        """`box` provides readings and settings."""
        self._box = box
        self._server: asyncio.Server | None = None
        self.address = ""

    async def start(self, host: str, port: int) -> None:
        """Listen; port 0 selects a free port."""
        self._server = await asyncio.start_server(self._serve, host, port)
        self.address = "{}:{}".format(*self._server.sockets[0].getsockname()[:2])

    def close(self) -> None:
        """Stop listening."""
        if self._server is not None:
            self._server.close()

    @abstractmethod
    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""


class TcpService(BoxService):
    """Single readings and the calibration."""

    def answer(self, request: bytes) -> bytes:
        """Return the answer to a 20-byte request; empty for an unknown command."""
        box = self._box
        if request[0] == READ:
            counts, status = box.counts_and_status()
            steps = [
                max(-32768, min(round(count / scale), 32767))
                for count, scale in zip(counts, scales(box), strict=True)
            ]
            return struct.pack(">HH6h", 0x1234, status >> 16, *steps)
        if request[0] == CALIBRATION:
            calibration = box.settings.calibration
            per_unit = calibration.counts_per_force, calibration.counts_per_torque
            return struct.pack(">HBBII6H", 0x1234, NEWTON, NEWTON_METRE, *per_unit, *scales(box))
        if request[0] in (TRANSFORM, THRESHOLD):
            return struct.pack(">HBB", 0x1234, request[0], 0)
        return b""

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                writer.write(self.answer(await reader.readexactly(REQUEST)))
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()


class ConfigurationPage(BoxService):
    """The page /netftapi2.xml."""

    def text(self) -> str:
        """Return the text of the page."""
        box = self._box
        calibration = box.settings.calibration
        counts, status = box.counts_and_status()
        entries = {
            "runstat": f"0x{status:08X}",
            "runft": ";".join(map(str, counts)),
            "prodname": "Net F/T",
            "setserial": calibration.serial,
            "cfgnam": "Configuration #0",
            "cfgcalsn": calibration.serial,
            "cfgfu": str(NEWTON),
            "scfgfu": UNIT_NAMES[0],
            "cfgtu": str(NEWTON_METRE),
            "scfgtu": UNIT_NAMES[1],
            "cfgcpf": str(calibration.counts_per_force),
            "cfgcpt": str(calibration.counts_per_torque),
            "cfgmr": ";".join(f"{rating:g}" for rating in calibration.ratings),
            "comrdte": "Enabled",
            "comrdtrate": f"{box.settings.rate:.0f}",
            "comrdtbsiz": str(box.settings.buffer),
        }
        lines = "".join(f"<{name}>{escape(value)}</{name}>\n" for name, value in entries.items())
        return f'<?xml version="1.0" encoding="utf-8"?>\n<netft>\n{lines}</netft>\n'

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await reader.readuntil(b"\r\n\r\n")
            path = head.split(b" ")[1].split(b"?")[0] if head.count(b" ") > 1 else b""
            found = head.startswith(b"GET ") and path == b"/netftapi2.xml"
            body = self.text().encode() if found else b"not here"
            status = "200 OK" if found else "404 Not Found"
            writer.write(
                f"HTTP/1.1 {status}\r\nContent-Type: text/xml\r\nContent-Length: {len(body)}\r\n"
                "Connection: close\r\n\r\n".encode()
                + body
            )
            await writer.drain()
        except (asyncio.IncompleteReadError, asyncio.LimitOverrunError, ConnectionError):
            pass
        finally:
            writer.close()
