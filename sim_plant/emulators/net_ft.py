"""The emulated ATI Net F/T: RDT records over UDP, and its two TCP services.

Source: ATI Net F/T manual, RDT interface (UDP 49152), TCP interface (49151, 20-byte requests), XML
pages (netftapi2.xml). The status code of a saturated gage is not confirmed: a parameter.
"""

from __future__ import annotations

import asyncio
import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple
from xml.sax.saxutils import escape

from sim_plant.emulators.background import BackgroundTask
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.ft_calibration import NEWTON, NEWTON_METRE, Calibration, Wrench
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.units import Count, Hertz, Second

HEADER = 0x1234
STOP, REAL_TIME, BUFFERED, MULTI_UNIT, RESET_LATCH, BIAS = 0x00, 0x02, 0x03, 0x04, 0x41, 0x42
READ, CALIBRATION, TRANSFORM, THRESHOLD = 0, 1, 2, 3
REQUEST = 20  # bytes of a request over TCP
UNIT_NAMES = ("N", "Nm")
INTERNAL_RATE = 7000.0  # Hz, of ft_sequence
MAX_BURST = 64  # most packets sent at once after a stall of the process; more are lost
INT32_MAX = 0x7FFFFFFF
POLL_PERIOD = 0.005  # s between two updates of the link's faults

FAULTS = {
    "saturated": "every axis reads its rating and the status shows saturation",
    "inverted": "every axis has the opposite sign",
    "status_error": "the status of every record is 80000000",
    "silent": "nothing is sent; sequences continue",
    "frozen_values": "the counts do not change, both sequences continue",
    "stuck_sensor": "ft_sequence and the counts do not change, rdt_sequence continues",
    "short_records": "records end after 20 bytes",
    "restarted": "the box loses its stream once, as after a power dip",
    "foreign_client": "another host has taken over the stream: nothing is sent here",
    "ignores_bias": "the bias command does nothing",
}


class NetFtSettings(NamedTuple):
    """Settings of a box."""

    host: str = "127.0.0.1"
    port: int = 49152  # RDT; 0: a free one
    tcp_port: int = 49151
    http_port: int = 8080  # a box has 80
    rate: Hertz = 1000.0  # of RDT records, up to 7000
    buffer: Count = 40  # records in one packet of a buffered stream
    saturation_status: int = 0x80020000  # not confirmed
    calibration: Calibration = Calibration()


class NetFt(asyncio.DatagramProtocol):
    """The box; the last requesting host receives the stream."""

    def __init__(
        self,
        read: Callable[[], Wrench],
        settings: NetFtSettings | None = None,
        link: LinkFaults | None = None,
    ) -> None:
        """`read` returns the present wrench; `link` has the faults of the datagrams."""
        self.settings = settings or NetFtSettings()
        self.faults = DeviceFaults(FAULTS)
        self.link = link or LinkFaults()
        self.address = ""
        self._read = read
        self._bias = [0] * 6
        self._counts = [0] * 6
        self._status = 0
        self._client: tuple[str, int] | None = None
        self._records_left: Count | None = None  # records still to send; None: endless
        self._per_packet: Count = 1
        self._sequence: Count = 0
        self._ticks: Count = 0  # of the sensor
        self._sender = ("", 0)  # sender of the last datagram
        self._stream_start: Second = 0.0
        self._origin: Second | None = None
        self._sent: Count = 0
        self._transport: asyncio.DatagramTransport | None = None
        self._stream_task = BackgroundTask()
        self._poll_task = BackgroundTask()
        self.page = ConfigurationPage(self)
        self.tcp = TcpService(self)

    async def start(self) -> None:
        """Open the three ports. Raises OSError if one is in use."""
        settings = self.settings
        loop = asyncio.get_running_loop()
        self._origin = loop.time()
        transport, _ = await loop.create_datagram_endpoint(
            lambda: self, local_addr=(settings.host, settings.port)
        )
        self._transport = transport
        self.address = "{}:{}".format(*transport.get_extra_info("sockname")[:2])
        await self.tcp.start(settings.host, settings.tcp_port)
        await self.page.start(settings.host, settings.http_port)
        self._stream_task.start(self._stream())
        self._poll_task.start(self._poll_loop())

    async def close(self) -> None:
        """Close all ports."""
        await self._stream_task.stop()
        await self._poll_task.stop()
        if self._transport is not None:
            self._transport.close()
        self.tcp.close()
        self.page.close()

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Receive a datagram from the wire, through the link's faults."""
        loop = asyncio.get_running_loop()
        self._sender = addr
        for at, piece in self.link.to_device.transmit(data, loop.time()):
            loop.call_at(at, self.handle_request, piece, addr)

    def handle_request(self, data: bytes, sender: tuple[str, int]) -> None:
        """Execute a request; other datagrams are ignored, as by the box."""
        if len(data) != 8:
            return
        header, command, count = struct.unpack(">HHI", data)
        if header != HEADER:
            return
        if command == STOP:
            self._client = None
        elif command in (REAL_TIME, BUFFERED, MULTI_UNIT):
            self._client = sender
            self._records_left = count or None
            self._per_packet = self.settings.buffer if command == BUFFERED else 1
            self._sequence = self._sent = 0
            self._stream_start = asyncio.get_running_loop().time()
        elif command == BIAS:
            self.bias()

    def bias(self) -> None:
        """Set the present load as zero."""
        if not self.faults.is_on("ignores_bias"):
            self._bias = [0] * 6
            self._bias = self.counts_and_status()[0]

    def counts_and_status(self) -> tuple[list[int], int]:
        """Return the six counts minus bias, and the status."""
        faults, settings = self.faults, self.settings
        if not (faults.is_on("frozen_values") or faults.is_on("stuck_sensor")):
            sign = -1.0 if faults.is_on("inverted") else 1.0
            wrench = Wrench(*(sign * value for value in self._read()))
            self._counts, self._status = self._to_counts(wrench)
        status = self._status | (0x80000000 if faults.is_on("status_error") else 0)
        if faults.is_on("saturated"):
            wrench = Wrench(*settings.calibration.ratings)
            self._counts, status = self._to_counts(wrench)[0], settings.saturation_status
        return [
            max(-INT32_MAX, min(count - bias, INT32_MAX))
            for count, bias in zip(self._counts, self._bias, strict=True)
        ], status

    def next_record(self, at: Second) -> bytes:
        """Return the next 36-byte record, due at a time of the loop."""
        if not self.faults.is_on("stuck_sensor"):
            self._ticks = int((at - (self._origin or at)) * INTERNAL_RATE)
        self._sequence = self._sequence + 1 & 0xFFFFFFFF
        counts, status = self.counts_and_status()
        ticks = self._ticks & 0xFFFFFFFF
        return struct.pack(">III6i", self._sequence, ticks, status, *counts)

    def _to_counts(self, wrench: Wrench) -> tuple[list[int], int]:
        calibration = self.settings.calibration
        per_unit = [calibration.counts_per_force] * 3 + [calibration.counts_per_torque] * 3
        counts, status = [], 0
        for value, rating, scale in zip(wrench, calibration.ratings, per_unit, strict=True):
            clamped = value if math.isfinite(value) else rating
            if abs(clamped) > rating or not math.isfinite(value):
                status = self.settings.saturation_status
                clamped = math.copysign(rating, clamped)
            counts.append(round(clamped * scale))
        return counts, status

    async def _stream(self) -> None:
        loop = asyncio.get_running_loop()
        period = max(1.0 / self.settings.rate, 0.0005)
        while True:
            await asyncio.sleep(period)
            if self._client is None:
                continue
            due = int((loop.time() - self._stream_start) * self.settings.rate) - self._sent
            packets = due // self._per_packet
            self._sent += max(packets - MAX_BURST, 0) * self._per_packet
            for _ in range(min(packets, MAX_BURST)):
                self._send_packet()

    def _send_packet(self) -> None:
        size = (
            self._per_packet
            if self._records_left is None
            else min(self._per_packet, self._records_left)
        )
        times = [self._stream_start + (self._sent + k) / self.settings.rate for k in range(size)]
        data = b"".join(self.next_record(at) for at in times)
        self._sent += self._per_packet
        client = self._client
        if self._records_left is not None:
            self._records_left -= size
            if self._records_left == 0:
                self._client = None
        if self.faults.is_on("restarted"):
            self._client, self._sequence = None, 0
            self.faults.switch("restarted", False)
            return
        if client is None or self.faults.is_on("silent") or self.faults.is_on("foreign_client"):
            return
        self._send(data[:20] if self.faults.is_on("short_records") else data, client)

    def _send(self, data: bytes, client: tuple[str, int]) -> None:
        loop = asyncio.get_running_loop()
        for at, piece in self.link.to_host.transmit(data, loop.time()):
            loop.call_at(at, self._write_datagram, piece, client)

    def _write_datagram(self, data: bytes, client: tuple[str, int]) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(data, client)

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            client = self._client
            for at, piece in self.link.to_host.due_arrivals(loop.time()):
                if client is not None:
                    loop.call_at(at, self._write_datagram, piece, client)
            for at, piece in self.link.to_device.due_arrivals(loop.time()):
                loop.call_at(at, self.handle_request, piece, self._sender)
            await asyncio.sleep(POLL_PERIOD)


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
