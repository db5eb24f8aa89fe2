"""The Modbus line against a server of libmodbus, in C: it makes the numbers, we read them."""

from __future__ import annotations

import ctypes
import os
import pty
import select
import socket
import threading
import tty
from collections.abc import Iterator
from contextlib import suppress
from ctypes import POINTER, byref, c_char, c_float, c_int, c_uint8, c_uint16, c_void_p
from typing import Any

import pytest

from drivers.modbus import registers
from drivers.modbus.line import (
    ExceptionResponseError,
    Line,
    NoAnswerError,
    RtuSettings,
    TcpSettings,
)
from drivers.modbus.registers import RegisterBlock, RegisterValue

UNIT, SIZE = 7, 32
VALUES = (151.25, -0.3, 6.02e4)


class Mapping(ctypes.Structure):
    """modbus_mapping_t of modbus.h."""

    _fields_ = (
        *((name, c_int) for name in (
            "nb_bits", "start_bits", "nb_input_bits", "start_input_bits",
            "nb_input_registers", "start_input_registers", "nb_registers", "start_registers",
        )),
        ("tab_bits", POINTER(c_uint8)), ("tab_input_bits", POINTER(c_uint8)),
        ("tab_input_registers", POINTER(c_uint16)), ("tab_registers", POINTER(c_uint16)),
    )  # fmt: skip


def library() -> Any:
    try:
        lib: Any = ctypes.CDLL("libmodbus.so.5")
    except OSError:
        return None
    for name in ("modbus_new_tcp", "modbus_new_rtu"):
        getattr(lib, name).restype = c_void_p
    lib.modbus_mapping_new.restype = POINTER(Mapping)
    lib.modbus_get_float.restype = c_float
    return lib


LIB = library()
pytestmark = pytest.mark.skipif(
    LIB is None, reason="libmodbus is not installed: no Modbus server of others (libmodbus5)"
)


class Server:
    """One unit of libmodbus, whose registers the test can read and set."""

    def __init__(self, context: int | None) -> None:
        assert context
        self._context = c_void_p(context)
        LIB.modbus_set_slave(self._context, UNIT)
        self.mapping: Any = LIB.modbus_mapping_new(SIZE, SIZE, SIZE, SIZE)

    def serve(self) -> None:
        request = (c_uint8 * 260)()
        while (size := LIB.modbus_receive(self._context, request)) >= 0:
            if size > 0:
                LIB.modbus_reply(self._context, request, size, self.mapping)

    def floats(self, table: str, high_first: bool) -> None:
        """Its own low word and high word of each value, in this order or the other.

        The functions that name an order differ between versions (3.1.6 swaps bytes too); this one
        is the same in all.
        """
        into, words = getattr(self.mapping.contents, table), (c_uint16 * 2)()
        for i, value in enumerate(VALUES):
            LIB.modbus_set_float(c_float(value), words)
            into[2 * i], into[2 * i + 1] = reversed(words) if high_first else words


class TcpServer(Server):
    def __init__(self) -> None:
        super().__init__(LIB.modbus_new_tcp(b"127.0.0.1", 0))
        self._socket = socket.socket(fileno=LIB.modbus_tcp_listen(self._context, 1))
        self.port = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        listening = c_int(self._socket.fileno())
        if LIB.modbus_tcp_accept(self._context, byref(listening)) >= 0:
            self.serve()

    def close(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # if no client has connected
        self._thread.join(5.0)
        self._socket.close()
        LIB.modbus_close(self._context)


class Cable:
    """Two ptys whose far ends are joined: bytes written to one arrive at the other."""

    def __init__(self) -> None:
        pairs = [pty.openpty() for _ in range(2)]
        for fd in (fd for pair in pairs for fd in pair):
            tty.setraw(fd)
        self.ends = [os.ttyname(slave) for _, slave in pairs]
        self._masters = [master for master, _ in pairs]
        self._slaves = [slave for _, slave in pairs]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _carry(self) -> None:
        one, other = self._masters
        while not self._ended.is_set():
            for fd in select.select(self._masters, [], [], 0.05)[0]:
                with suppress(OSError):
                    os.write(other if fd == one else one, os.read(fd, 512))

    def close(self) -> None:
        self._ended.set()
        self._thread.join(5.0)
        for fd in (*self._masters, *self._slaves):
            os.close(fd)


def block(table: str, first: int, size: int, kind: str = "f32", unit: int = UNIT) -> RegisterBlock:
    step = registers.REGISTER_COUNT[kind]
    values = tuple(
        RegisterValue(f"value_{i}", step * i, kind, 1.0, -1e6, 1e6) for i in range(size // step)
    )
    return registers.validated(RegisterBlock(unit, table, first, size, values))


WRITABLE = (block("coil", 0, 3, "bit"), block("holding", 8, 4), block("holding", SIZE, 2))


@pytest.fixture
def server() -> Iterator[TcpServer]:
    one = TcpServer()
    yield one
    one.close()


@pytest.fixture
def line(server: TcpServer) -> Iterator[Line]:
    one = Line(TcpSettings("127.0.0.1", server.port, 3.0), WRITABLE)
    yield one
    one.close()


@pytest.mark.parametrize("table", ["input", "holding"])
@pytest.mark.parametrize("high_first", [True, False])
def test_floats_of_either_word_order(
    server: TcpServer, line: Line, table: str, high_first: bool
) -> None:
    server.floats("tab_input_registers" if table == "input" else "tab_registers", high_first)
    map_block = block(table, 0, 6)
    values = registers.decode(map_block, line.read(map_block), high_first)
    assert values == pytest.approx(VALUES, rel=1e-7)
    swapped = registers.decode(map_block, line.read(map_block), not high_first)
    assert swapped != pytest.approx(VALUES, rel=0.1)


def test_bits(server: TcpServer, line: Line) -> None:
    pattern = [1, 0, 0, 1, 1, 0, 1, 0, 1, 1]
    for i, bit in enumerate(pattern):
        server.mapping.contents.tab_input_bits[i] = bit
    assert line.read(block("discrete", 0, 10, "bit")) == pattern
    line.write(WRITABLE[0], [1, 0, 1])
    assert [server.mapping.contents.tab_bits[i] for i in range(4)] == [1, 0, 1, 0]
    assert line.read(block("coil", 0, 3, "bit")) == [1, 0, 1]


def test_written_values_arrive(server: TcpServer, line: Line) -> None:
    line.write(WRITABLE[1], registers.encode(WRITABLE[1], (-12.5, 0.1), True))
    stored = server.mapping.contents.tab_registers
    for i, value in ((8, -12.5), (10, 0.1)):
        words = (c_uint16 * 2)(stored[i + 1], stored[i])
        assert LIB.modbus_get_float(words) == pytest.approx(value, rel=1e-7)


def test_missing_registers_are_refused(line: Line) -> None:
    for request in (
        lambda: line.read(block("holding", SIZE - 1, 2)),
        lambda: line.write(WRITABLE[2], [1, 2]),
    ):
        with pytest.raises(ExceptionResponseError) as error:
            request()
        assert error.value.code == 2  # illegal data address
    assert line.read(block("holding", 0, 2)) == [0, 0]


def test_rtu_and_a_unit_that_is_not_there() -> None:
    cable = Cable()
    server_port, client_port = cable.ends
    server = Server(LIB.modbus_new_rtu(server_port.encode(), 115_200, c_char(b"N"), 8, 1))
    line = Line(RtuSettings(client_port, 115_200, "N", 1, 1.0, 0.2))
    try:
        assert LIB.modbus_connect(server._context) == 0
        serving = threading.Thread(target=server.serve, daemon=True)
        serving.start()
        server.floats("tab_registers", True)
        map_block = block("holding", 0, 6)
        for _ in range(3):
            values = registers.decode(map_block, line.read(map_block), True)
            assert values == pytest.approx(VALUES, rel=1e-7)
        with pytest.raises(NoAnswerError):
            line.read(block("holding", 0, 6, unit=9))
        assert registers.decode(map_block, line.read(map_block), True) == pytest.approx(
            VALUES, rel=1e-7
        )
    finally:
        line.close()
        cable.close()
        LIB.modbus_close(server._context)
