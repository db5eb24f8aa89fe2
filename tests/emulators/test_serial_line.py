"""The pseudo-terminal against pyserial: timing, chunks, echo, unplugging and return."""

from __future__ import annotations

import time

import pytest
import serial
from emulator_stage import Stage, until

from sim_plant.emulators.serial_line import SerialLine


class Parrot:
    """Returns received bytes with a mark."""

    def __init__(self, line: SerialLine) -> None:
        self.line = line
        self.link = line.link
        self.address = line.address
        self.received: list[bytes] = []
        line.attach(self.receive)

    def receive(self, data: bytes, now: float) -> None:
        self.received.append(data)
        self.line.send(b">" + data)

    async def start(self) -> None:
        await self.line.start()

    async def close(self) -> None:
        await self.line.close()


def test_bytes_in_both_directions_for_several_clients(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line()))
    for _ in range(3):
        with serial.Serial(parrot.address, 115_200, timeout=2.0, exclusive=True) as port:
            with pytest.raises(serial.SerialException):
                serial.Serial(parrot.address, exclusive=True)
            port.write(b"hello")
            assert port.read(6) == b">hello"


def test_line_timing(stage: Stage) -> None:
    """200 bytes out and 201 back at 9600 baud, 11 bits: 459 ms; never faster."""
    parrot = stage.show(Parrot(stage.line(baud=9600, bits_per_byte=11)))
    with serial.Serial(parrot.address, timeout=3.0) as port:
        start = time.monotonic()
        port.write(bytes(200))
        assert len(port.read(201)) == 201
        took = time.monotonic() - start
    assert 401 * 11 / 9600 - 0.002 <= took < 1.5


def test_answers_come_in_chunks(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line(baud=2400, chunk=4)))
    with serial.Serial(parrot.address, timeout=2.0) as port:
        port.write(b"0123456789")
        first = port.read(1) + port.read(port.in_waiting)
        assert len(first) <= 8  # the whole answer takes 46 ms
        assert first + port.read(11 - len(first)) == b">0123456789"


def test_two_wire_adapter_echo(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line(echo=True)))
    with serial.Serial(parrot.address, timeout=2.0) as port:
        port.write(b"ab")
        assert port.read(5) == b"ab>ab"


def test_unplugging_is_an_error_and_the_path_returns(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line()))
    port = serial.Serial(parrot.address, timeout=2.0)
    parrot.link.switch("disconnect")
    assert until(lambda: not parrot.line.settings.path.is_symlink())
    with pytest.raises(serial.SerialException):
        port.read(1)
    port.close()
    with pytest.raises(serial.SerialException):
        serial.Serial(parrot.address)
    parrot.link.switch("disconnect", False)
    assert until(parrot.line.settings.path.is_symlink)
    with serial.Serial(parrot.address, timeout=2.0) as port:
        port.write(b"back")
        assert port.read(5) == b">back"


def test_unread_bytes_are_lost_and_counted(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line(paced=False)))
    with serial.Serial(parrot.address, timeout=2.0):
        stage.do(lambda: parrot.line.send(bytes(100_000)))
        assert until(lambda: parrot.line.lost_bytes > 50_000)


def test_existing_file_is_not_replaced(stage: Stage) -> None:
    (stage.folder / "port").write_text("mine")
    with pytest.raises(FileExistsError):
        stage.show(Parrot(stage.line()))


def test_frozen_bytes_arrive_later(stage: Stage) -> None:
    parrot = stage.show(Parrot(stage.line()))
    with serial.Serial(parrot.address, timeout=0.1) as port:
        parrot.link.switch("freeze", toward="host")
        port.write(b"a")
        assert port.read(2) == b""
        parrot.link.clear()
        port.timeout = 2.0
        assert port.read(2) == b">a"


def test_host_with_parity_can_reopen_the_line(stage: Stage) -> None:
    """The kernel ignores parity on a pseudo-terminal and reports an error at the second request."""
    parrot = stage.show(Parrot(stage.line(bits_per_byte=11)))
    for _ in range(3):
        with serial.Serial(parrot.address, 115_200, parity="E", timeout=2.0) as port:
            port.write(b"x")
            assert port.read(2) == b">x"
        time.sleep(0.05)
