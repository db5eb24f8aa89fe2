"""A Modbus line and a slave of the test, byte by byte: late answers, refusals, a lost line."""

from __future__ import annotations

import os
import pty
import socket
import struct
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.modbus.line import (
    ClosedLineError,
    ExceptionResponseError,
    Line,
    NoAnswerError,
    RtuSettings,
    TcpSettings,
)
from drivers.modbus.registers import RegisterBlock, RegisterValue, validated

ANY = (RegisterValue("x", 0, "u16", 1.0, 0.0, 65535.0),)
TIMEOUT, SLOWEST = 0.15, 0.4


def block(first: int, size: int, table: str = "holding", unit: int = 1) -> RegisterBlock:
    return validated(RegisterBlock(unit, table, first, size, ANY))


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS bit by bit."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


def answer(request: bytes) -> bytes:
    """Return a slave's answer to unit and PDU: each register contains its own address."""
    unit, function, first, count = struct.unpack(">BBHH", request[:6])
    if first >= 1000:
        return bytes((unit, function | 0x80, 2))
    if function in (3, 4):
        words = [first + i for i in range(count)]
        return struct.pack(f">BBB{count}H", unit, function, 2 * count, *words)
    if function == 16:
        return request[:6]
    return bytes((unit, function | 0x80, 1))


class Slave:
    """An RTU slave on a pty; `delays` are seconds before its next answers."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self.delays: list[float] = []
        self.requests: list[bytes] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                data = os.read(self._master, 256)
                if len(data) < 8 or crc(data[:-2]) != data[-2:]:
                    continue
                self.requests.append(data)
                time.sleep(self.delays.pop(0) if self.delays else 0.0)
                reply = answer(data[:-2])
                os.write(self._master, reply + crc(reply))
            except OSError:
                return

    def close(self) -> None:
        os.close(self._slave)
        os.close(self._master)


@contextmanager
def rtu(*writable: RegisterBlock) -> Iterator[tuple[Slave, Line]]:
    slave = Slave()
    line = Line(RtuSettings(slave.port, 19200, "N", 1, TIMEOUT, SLOWEST), writable)
    try:
        yield slave, line
    finally:
        line.close()
        slave.close()


def test_registers_are_read_as_requested() -> None:
    with rtu() as (_, line):
        assert line.read(block(7, 3)) == [7, 8, 9]
        assert line.read(block(40, 1, "input")) == [40]


def test_an_exception_response_carries_its_code_and_the_line_continues() -> None:
    with rtu() as (_, line):
        with pytest.raises(
            ExceptionResponseError, match=r"unit 1, holding 1000: refused .* 2"
        ) as error:
            line.read(block(1000, 2))
        assert error.value.code == 2
        assert line.read(block(1, 2)) == [1, 2]


@pytest.mark.parametrize("late", [0.3, 0.5, 0.9])
def test_a_late_answer_is_never_taken_for_a_new_one(late: float) -> None:
    """0.3 s: within the time of the slowest unit; later: after the line was considered quiet.

    Blocks of one length are read in turn, so only their content would show a mix-up.
    """
    with rtu() as (slave, line):
        assert line.read(block(0, 4)) == [0, 1, 2, 3]
        slave.delays = [late]
        with pytest.raises(NoAnswerError):
            line.read(block(100, 4))
        got = []
        for first in (200, 300, 400, 500, 600, 700):
            try:
                got.append((first, line.read(block(first, 4))))
            except NoAnswerError:
                continue
        for first, registers in got:
            assert registers == [first, first + 1, first + 2, first + 3]
        assert got[-1][0] == 700  # it finds back


def test_a_late_answer_is_no_acknowledgement_of_a_write() -> None:
    target = block(10, 2)
    with rtu(target) as (slave, line):
        slave.delays = [0.6]
        with pytest.raises(NoAnswerError):
            line.read(block(100, 4))
        for _ in range(4):
            try:
                line.write(target, [1, 2])
            except NoAnswerError:
                continue
            break
        assert slave.requests[-1][1] == 16
        assert line.read(block(5, 1)) == [5]


def test_only_listed_registers_are_written() -> None:
    with rtu(block(10, 2)) as (slave, line):
        line.write(block(10, 2), [5, 6])
        for other in (block(9, 2), block(11, 2), block(10, 2, unit=2)):
            with pytest.raises(ValueError, match="not listed as writable"):
                line.write(other, [5, 6])
        assert len(slave.requests) == 1


def test_a_port_has_one_owner() -> None:
    with rtu() as (slave, line):
        assert line.read(block(1, 1)) == [1]
        other = Line(RtuSettings(slave.port, 19200, "N", 1, TIMEOUT, SLOWEST))
        with pytest.raises(ClosedLineError):
            other.read(block(1, 1))


def test_a_lost_line_is_reopened_after_a_growing_pause() -> None:
    now = [0.0]
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    line = Line(TcpSettings("127.0.0.1", port, 0.2), clock=lambda: now[0], sleep=lambda _: None)
    attempts = 0
    for _ in range(2000):
        now[0] += 0.01
        with pytest.raises(ClosedLineError) as error:
            line.read(block(1, 1))
        attempts += "opened again after a pause" not in str(error.value)
    # 20 s: after 0.1, 0.2, 0.4 ... 5 s and then every 5 s; without a pause it would be 2000.
    assert 7 <= attempts <= 12


def test_a_tcp_line_recovers_when_its_server_returns() -> None:
    def serve(server: socket.socket) -> None:
        peer, _ = server.accept()
        with peer:
            for _ in range(2):
                data = peer.recv(260)
                reply = answer(data[6:])
                peer.sendall(data[:4] + struct.pack(">H", len(reply)) + reply)

    with socket.create_server(("127.0.0.1", 0)) as server:
        line = Line(TcpSettings("127.0.0.1", server.getsockname()[1], 0.3))
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        assert line.read(block(3, 2)) == [3, 4]
        assert line.read(block(5, 2)) == [5, 6]
        thread.join()
        with pytest.raises((NoAnswerError, ClosedLineError)):
            line.read(block(5, 2))
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        until, values = time.monotonic() + 5.0, []
        while not values and time.monotonic() < until:
            try:
                values = line.read(block(7, 1))
            except (NoAnswerError, ClosedLineError):
                time.sleep(0.05)
        assert values == [7]
        assert line.read(block(7, 1)) == [7]
        thread.join()
        assert line.open_count >= 2
        line.close()
