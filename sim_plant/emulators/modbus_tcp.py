"""Modbus TCP: several units behind one port.

Modbus messaging on TCP/IP V1.0b: transaction, protocol 0, length, unit, PDU.
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable, Mapping

from sim_plant.emulators import modbus_pdu
from sim_plant.emulators.background import Background
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.modbus_pdu import Refused
from sim_plant.emulators.modbus_unit import Answer, ModbusUnit
from sim_plant.units import Count, Second

TEND = 0.01  # s between two looks at units and link faults
LONGEST = 254  # of the length field


class Connection(asyncio.Protocol):
    """One host's connection; a header that cannot be true ends it."""

    def __init__(self, server: TcpUnits) -> None:
        """`server` answers and knows the link's faults."""
        self._server = server
        self._to_device = server.link.to_device.branch()
        self._to_host = server.link.to_host.branch()
        self._buffer = b""
        self.transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self._server.connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """The host has gone, or was sent away."""
        self._server.connections.discard(self)
        self.transport = None

    def data_received(self, data: bytes) -> None:
        """Take bytes off the wire, through the link's faults."""
        loop = asyncio.get_running_loop()
        now = loop.time()
        for at, piece in self._to_device.pass_on(data, now):
            self._at(at, now, self.take, piece)

    def send(self, data: bytes) -> None:
        """Send one answer, through the link's faults."""
        now = asyncio.get_running_loop().time()
        for at, piece in self._to_host.pass_on(data, now):
            self._at(at, now, self.put, piece)

    def tend(self, now: Second) -> None:
        """Let come what the link's faults held or made up."""
        for at, piece in self._to_host.due(now):
            self._at(at, now, self.put, piece)
        for at, piece in self._to_device.due(now):
            self._at(at, now, self.take, piece)

    def take(self, data: bytes) -> None:
        """Take bytes that have arrived."""
        self._buffer += data
        while len(self._buffer) >= 7:
            transaction, protocol, length, unit = struct.unpack(">HHHB", self._buffer[:7])
            if protocol != 0 or not 2 <= length <= LONGEST:
                self._server.nonsense += 1
                self.hang_up()
                return
            if len(self._buffer) < 6 + length:
                return
            pdu, self._buffer = self._buffer[7 : 6 + length], self._buffer[6 + length :]
            answer = self._server.serve(unit, pdu)
            if answer is not None:
                header = struct.pack(">HHHB", transaction, 0, 1 + len(answer.pdu), unit)
                loop = asyncio.get_running_loop()
                loop.call_later(answer.delay, self.send, header + answer.pdu)

    def put(self, data: bytes) -> None:
        """Put bytes on the wire."""
        if self.transport is not None:
            self.transport.write(data)

    def hang_up(self) -> None:
        """End the connection at once."""
        self._buffer = b""
        if self.transport is not None:
            self.transport.abort()

    @staticmethod
    def _at(at: Second, now: Second, call: Callable[[bytes], None], data: bytes) -> None:
        if at <= now:
            call(data)
        else:
            asyncio.get_running_loop().call_at(at, call, data)


class TcpUnits:
    """Units behind one TCP port; an address that is not there is refused by exception 11."""

    def __init__(
        self,
        units: Mapping[int, ModbusUnit],
        host: str = "127.0.0.1",
        port: int = 0,
        link: LinkFaults | None = None,
    ) -> None:
        """`units` by their address, 0 to 255; port 0 takes a free one and keeps it."""
        self.units = dict(units)
        self.link = link or LinkFaults()
        self.connections: set[Connection] = set()
        self.nonsense: Count = 0  # headers that ended a connection
        self.host = host
        self.port = port
        self._server: asyncio.Server | None = None
        self._tending = Background()

    @property
    def address(self) -> str:
        """Host and port, as `127.0.0.1:5020`."""
        return f"{self.host}:{self.port}"

    async def start(self) -> None:
        """Listen; raises OSError if the port is taken."""
        await self._listen()
        self._tending.start(self._tend())

    async def close(self) -> None:
        """End all connections and listen no longer."""
        await self._tending.stop()
        self._deafen()

    def serve(self, unit: int, pdu: bytes) -> Answer | None:
        """Answer one request."""
        if unit in self.units:
            return self.units[unit].serve(pdu, asyncio.get_running_loop().time())
        if not pdu:
            return None
        return Answer(modbus_pdu.exception(pdu[0], Refused.NO_ANSWER_BEHIND_GATEWAY), 0.0)

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(
            lambda: Connection(self), self.host, self.port, reuse_address=True
        )
        self.port = self._server.sockets[0].getsockname()[1]

    def _deafen(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        for connection in tuple(self.connections):
            connection.hang_up()

    async def _tend(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            now = loop.time()
            for unit in self.units.values():
                unit.advance(now)
                if unit.hangs_up():
                    for connection in tuple(self.connections):
                        connection.hang_up()
            if self.link.disconnected:
                self._deafen()
            elif self._server is None:
                with contextlib.suppress(OSError):  # a host still holds the port: next time
                    await self._listen()
            for connection in tuple(self.connections):
                connection.tend(now)
            await asyncio.sleep(TEND)
