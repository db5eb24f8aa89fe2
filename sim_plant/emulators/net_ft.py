"""The emulated ATI Net F/T: RDT records over UDP, and the two services beside it.

Source: ATI Net F/T manual, RDT interface (UDP 49152), TCP interface (49151), XML pages. The
status code of a saturated gage is not confirmed: a parameter.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.background import Background
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.ft_calibration import Calibration, Wrench
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.net_ft_services import ConfigurationPage, TcpService
from sim_plant.units import Count, Hertz, Second

HEADER = 0x1234
STOP, REAL_TIME, BUFFERED, MULTI_UNIT, RESET_LATCH, BIAS = 0x00, 0x02, 0x03, 0x04, 0x41, 0x42
INTERNAL_RATE = 7000.0  # Hz, of ft_sequence
MOST_LATE = 64  # records sent at once after the process was held up; more are lost
I32 = 0x7FFFFFFF
TEND = 0.005  # s between two looks at what the link's faults hold

FAULTS = {
    "saturated": "every axis reads its rating and the status says so",
    "inverted": "every axis has the other sign",
    "status_error": "the status of every record is 80000000",
    "silent": "nothing is sent; sequences run on",
    "frozen_values": "the counts stand still, both sequences go on",
    "stuck_sensor": "ft_sequence and the counts stand still, rdt_sequence goes on",
    "short_records": "records end after 20 bytes",
    "restarted": "the box forgets its stream once, as after a power dip",
    "foreign_client": "another host has taken the stream: nothing is sent here",
    "ignores_bias": "the bias command does nothing",
}


class NetFtSettings(NamedTuple):
    """How a box is set."""

    host: str = "127.0.0.1"
    port: int = 49152  # RDT; 0: a free one
    tcp_port: int = 49151
    http_port: int = 8080  # a box has 80
    rate: Hertz = 1000.0  # of RDT records, up to 7000
    buffer: Count = 40  # records in one packet of a buffered stream
    saturation_status: int = 0x80020000  # not confirmed
    calibration: Calibration = Calibration()


class NetFt(asyncio.DatagramProtocol):
    """The box: the last host that asks has the stream."""

    def __init__(
        self,
        read: Callable[[], Wrench],
        settings: NetFtSettings | None = None,
        link: LinkFaults | None = None,
    ) -> None:
        """`read` gives the present wrench; `link` has the faults of each datagram."""
        self.settings = settings or NetFtSettings()
        self.faults = DeviceFaults(FAULTS)
        self.link = link or LinkFaults()
        self.address = ""
        self._read = read
        self._bias = [0] * 6
        self._counts = [0] * 6
        self._status = 0
        self._client: tuple[str, int] | None = None
        self._left: Count | None = None  # records still to send; None: endless
        self._per_packet: Count = 1
        self._sequence: Count = 0
        self._ticks: Count = 0  # of the sensor
        self._sender = ("", 0)  # whose datagram came last
        self._begin: Second = 0.0
        self._origin: Second | None = None
        self._sent: Count = 0
        self._transport: asyncio.DatagramTransport | None = None
        self._streaming = Background()
        self._tending = Background()
        self.page = ConfigurationPage(self)
        self.tcp = TcpService(self)

    async def start(self) -> None:
        """Open the three ports; raises OSError if one is taken."""
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
        self._streaming.start(self._stream())
        self._tending.start(self._tend())

    async def close(self) -> None:
        """Close all ports."""
        await self._streaming.stop()
        await self._tending.stop()
        if self._transport is not None:
            self._transport.close()
        self.tcp.close()
        self.page.close()

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Take a datagram off the wire, through the link's faults."""
        loop = asyncio.get_running_loop()
        self._sender = addr
        for at, piece in self.link.to_device.pass_on(data, loop.time()):
            loop.call_at(at, self.take, piece, addr)

    def take(self, data: bytes, sender: tuple[str, int]) -> None:
        """Act on a request; anything else is ignored, as by the box."""
        if len(data) != 8:
            return
        header, command, count = struct.unpack(">HHI", data)
        if header != HEADER:
            return
        if command == STOP:
            self._client = None
        elif command in (REAL_TIME, BUFFERED, MULTI_UNIT):
            self._client = sender
            self._left = count or None
            self._per_packet = self.settings.buffer if command == BUFFERED else 1
            self._sequence = self._sent = 0
            self._begin = asyncio.get_running_loop().time()
        elif command == BIAS:
            self.bias()

    def bias(self) -> None:
        """Take the present load as zero."""
        if not self.faults.on("ignores_bias"):
            self._bias = [0] * 6
            self._bias = self.sense()[0]

    def sense(self) -> tuple[list[int], int]:
        """Give the six counts, bias taken off, and the status."""
        faults, settings = self.faults, self.settings
        if not (faults.on("frozen_values") or faults.on("stuck_sensor")):
            sign = -1.0 if faults.on("inverted") else 1.0
            wrench = Wrench(*(sign * value for value in self._read()))
            self._counts, self._status = self._counted(wrench)
        status = self._status | (0x80000000 if faults.on("status_error") else 0)
        if faults.on("saturated"):
            wrench = Wrench(*settings.calibration.ratings)
            self._counts, status = self._counted(wrench)[0], settings.saturation_status
        return [
            max(-I32, min(count - bias, I32))
            for count, bias in zip(self._counts, self._bias, strict=True)
        ], status

    def record(self, at: Second) -> bytes:
        """Give the next 36-byte record, due at a time of the loop."""
        if not self.faults.on("stuck_sensor"):
            self._ticks = int((at - (self._origin or at)) * INTERNAL_RATE)
        self._sequence = self._sequence + 1 & 0xFFFFFFFF
        counts, status = self.sense()
        ticks = self._ticks & 0xFFFFFFFF
        return struct.pack(">III6i", self._sequence, ticks, status, *counts)

    def _counted(self, wrench: Wrench) -> tuple[list[int], int]:
        calibration = self.settings.calibration
        per_unit = [calibration.counts_per_force] * 3 + [calibration.counts_per_torque] * 3
        counts, status = [], 0
        for value, rating, scale in zip(wrench, calibration.ratings, per_unit, strict=True):
            held = value if math.isfinite(value) else rating
            if abs(held) > rating or not math.isfinite(value):
                status = self.settings.saturation_status
                held = math.copysign(rating, held)
            counts.append(round(held * scale))
        return counts, status

    async def _stream(self) -> None:
        loop = asyncio.get_running_loop()
        period = max(1.0 / self.settings.rate, 0.0005)
        while True:
            await asyncio.sleep(period)
            if self._client is None:
                continue
            due = int((loop.time() - self._begin) * self.settings.rate) - self._sent
            packets = due // self._per_packet
            self._sent += max(packets - MOST_LATE, 0) * self._per_packet
            for _ in range(min(packets, MOST_LATE)):
                self._send_packet()

    def _send_packet(self) -> None:
        size = self._per_packet if self._left is None else min(self._per_packet, self._left)
        times = [self._begin + (self._sent + k) / self.settings.rate for k in range(size)]
        data = b"".join(self.record(at) for at in times)
        self._sent += self._per_packet
        client = self._client
        if self._left is not None:
            self._left -= size
            if self._left == 0:
                self._client = None
        if self.faults.on("restarted"):
            self._client, self._sequence = None, 0
            self.faults.switch("restarted", False)
            return
        if client is None or self.faults.on("silent") or self.faults.on("foreign_client"):
            return
        self._send(data[:20] if self.faults.on("short_records") else data, client)

    def _send(self, data: bytes, client: tuple[str, int]) -> None:
        loop = asyncio.get_running_loop()
        for at, piece in self.link.to_host.pass_on(data, loop.time()):
            loop.call_at(at, self._put, piece, client)

    def _put(self, data: bytes, client: tuple[str, int]) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(data, client)

    async def _tend(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            client = self._client
            for at, piece in self.link.to_host.due(loop.time()):
                if client is not None:
                    loop.call_at(at, self._put, piece, client)
            for at, piece in self.link.to_device.due(loop.time()):
                loop.call_at(at, self.take, piece, self._sender)
            await asyncio.sleep(TEND)
