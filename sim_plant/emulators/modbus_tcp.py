"""Modbus TCP: several units behind one port.

Modbus messaging on TCP/IP V1.0b: transaction, protocol 0, length, unit, PDU.
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable, Mapping

from sim_plant.emulators import modbus_pdu
from sim_plant.emulators.background import BackgroundTask
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_pdu import ExceptionCode
from sim_plant.emulators.modbus_unit import Answer, ModbusUnit
from sim_plant.units import Count, Second

POLL_PERIOD = 0.01  # s between two updates of units and link faults
MAX_LENGTH_FIELD = 254  # of the length field


class HostConnection(asyncio.Protocol):
    """One host's connection; an invalid header ends it."""

    def __init__(self, server: TcpUnits) -> None:
        """`server` answers requests and has the link's faults."""
        self._server = server
        self._to_device = server.link.to_device.branch()
        self._to_host = server.link.to_host.branch()
        self._buffer = b""
        self.transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self._server.connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the connection after either side has closed it."""
        self._server.connections.discard(self)
        self.transport = None

    def data_received(self, data: bytes) -> None:
        """Receive bytes from the wire, through the link's faults."""
        loop = asyncio.get_running_loop()
        now = loop.time()
        for at, piece in self._to_device.transmit(data, now):
            self._call_at(at, now, self.process, piece)

    def send(self, data: bytes) -> None:
        """Send one answer, through the link's faults."""
        now = asyncio.get_running_loop().time()
        for at, piece in self._to_host.transmit(data, now):
            self._call_at(at, now, self.write, piece)

    def poll(self, now: Second) -> None:
        """Deliver pieces that the link's faults delayed or generated."""
        for at, piece in self._to_host.due_arrivals(now):
            self._call_at(at, now, self.write, piece)
        for at, piece in self._to_device.due_arrivals(now):
            self._call_at(at, now, self.process, piece)

    def process(self, data: bytes) -> None:
        """Process received bytes."""
        self._buffer += data
        while len(self._buffer) >= 7:
            transaction, protocol, length, unit = struct.unpack(">HHHB", self._buffer[:7])
            if protocol != 0 or not 2 <= length <= MAX_LENGTH_FIELD:
                self._server.bad_headers += 1
                self.disconnect()
                return
            if len(self._buffer) < 6 + length:
                return
            pdu, self._buffer = self._buffer[7 : 6 + length], self._buffer[6 + length :]
            answer = self._server.serve(unit, pdu)
            if answer is not None:
                header = struct.pack(">HHHB", transaction, 0, 1 + len(answer.pdu), unit)
                loop = asyncio.get_running_loop()
                loop.call_later(answer.delay, self.send, header + answer.pdu)

    def write(self, data: bytes) -> None:
        """Write bytes to the wire."""
        if self.transport is not None:
            self.transport.write(data)

    def disconnect(self) -> None:
        """End the connection at once."""
        self._buffer = b""
        if self.transport is not None:
            self.transport.abort()

    @staticmethod
    def _call_at(at: Second, now: Second, call: Callable[[bytes], None], data: bytes) -> None:
        if at <= now:
            call(data)
        else:
            asyncio.get_running_loop().call_at(at, call, data)


class TcpUnits:
    """Units behind one TCP port; a request to an unknown address gets exception 11."""

    def __init__(
        self,
        units: Mapping[int, ModbusUnit],
        host: str = "127.0.0.1",
        port: int = 0,
        link: LinkFaults | None = None,
    ) -> None:
        """`units` by address, 0 to 255; port 0 selects a free port and keeps it."""
        self.units = dict(units)
        self.link = link or LinkFaults()
        self.connections: set[HostConnection] = set()
        self.bad_headers: Count = 0  # headers that ended a connection
        self.host = host
        self.port = port
        self._server: asyncio.Server | None = None
        self._poll_task = BackgroundTask()

    @property
    def address(self) -> str:
        """Host and port, as `127.0.0.1:5020`."""
        return f"{self.host}:{self.port}"

    async def start(self) -> None:
        """Listen. Raises OSError if the port is in use."""
        await self._listen()
        self._poll_task.start(self._poll_loop())

    async def close(self) -> None:
        """End all connections and stop listening."""
        await self._poll_task.stop()
        self._stop_listening()

    def serve(self, unit: int, pdu: bytes) -> Answer | None:
        """Answer one request."""
        if unit in self.units:
            return self.units[unit].serve(pdu, asyncio.get_running_loop().time())
        if not pdu:
            return None
        return Answer(modbus_pdu.exception(pdu[0], ExceptionCode.NO_ANSWER_BEHIND_GATEWAY), 0.0)

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(
            lambda: HostConnection(self), self.host, self.port, reuse_address=True
        )
        self.port = self._server.sockets[0].getsockname()[1]

    def _stop_listening(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        for connection in tuple(self.connections):
            connection.disconnect()

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            now = loop.time()
            for unit in self.units.values():
                unit.advance(now)
                if unit.should_disconnect():
                    for connection in tuple(self.connections):
                        connection.disconnect()
            if self.link.disconnected:
                self._stop_listening()
            elif self._server is None:
                with contextlib.suppress(
                    OSError
                ):  # the port is still in use by a host: retry next time
                    await self._listen()
            for connection in tuple(self.connections):
                connection.poll(now)
            await asyncio.sleep(POLL_PERIOD)
