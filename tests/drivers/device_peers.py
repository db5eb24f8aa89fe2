"""The far end of each serial and UDP device, byte by byte, written from the manuals' layouts.

The measured value of each peer grows with its time, so a reading reveals its sample time.
"""

from __future__ import annotations

import math
import struct
from typing import Protocol

TURN = 1 << 19


class Peer(Protocol):
    """A device: `receive` takes bytes of the host, `tick` advances time; both return its bytes."""

    def receive(self, data: bytes, now: float) -> list[bytes]: ...
    def tick(self, now: float) -> list[bytes]: ...
    def power_cycle(self, now: float) -> None: ...


def ccitt(data: bytes, crc: int, augmented: bool) -> int:
    """CRC with 0x1021; Parker's loop takes each byte in at the low end, without augmentation."""
    for byte in data:
        if augmented:
            crc ^= byte << 8
            for _ in range(8):
                crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
        else:
            high = crc >> 8 << 8
            for _ in range(8):
                high = (high << 1 ^ 0x1021) & 0xFFFF if high & 0x8000 else high << 1
            crc = high ^ (crc << 8 & 0xFFFF) ^ byte
    return crc


def modbus(data: bytes) -> bytes:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return data + struct.pack("<H", crc)


class Compax3Peer:
    """A servo drive: status word, control word, last error, a set-point and two actual values."""

    def __init__(self, identity: str = "Compax3 I10T10 Rel 2008-3") -> None:
        self.identity = identity
        self.control, self.error, self.powered = 0, 1, False
        self.set_point = 0.0
        self.refuse: dict[tuple[int, int], int] = {}
        self.writes: list[tuple[int, int, float]] = []
        self.outstanding_at_once = 0
        self.deaf_control = False
        self._buffer = b""

    def power_cycle(self, now: float) -> None:
        self.control, self.error, self.powered, self._buffer = 0, 1, False, b""
        self.set_point = 0.0

    def trip(self, number: int) -> None:
        self.error, self.powered = number, False

    def tick(self, now: float) -> list[bytes]:
        return []

    def receive(self, data: bytes, now: float) -> list[bytes]:
        self._buffer += data
        answers: list[bytes] = []
        while self._buffer:
            start = self._buffer[0]
            if start & 0xF4 in (0xA4, 0xC4):
                if len(self._buffer) < 2 or len(self._buffer) < self._buffer[1] + 5:
                    break
                end = self._buffer[1] + 5
                record, self._buffer = self._buffer[:end], self._buffer[end:]
                answers.append(self._answer(record, now))
            elif b"\r" in self._buffer:
                line, _, self._buffer = self._buffer.partition(b"\r")
                if line.endswith(b"_?"):
                    answers.append(self.identity.encode() + b"\r")
            else:
                break
        self.outstanding_at_once = max(self.outstanding_at_once, len(answers))
        return answers

    def _record(self, start: int, data: bytes) -> bytes:
        body = bytes((start, len(data) - 1)) + data
        return body + ccitt(body, 0, augmented=False).to_bytes(2, "big")

    def _answer(self, record: bytes, now: float) -> bytes:
        body, crc = record[:-2], int.from_bytes(record[-2:], "big")
        if ccitt(body, 0, augmented=False) != crc:
            return self._record(0x07, b"\x00\x01")
        data = body[2:]
        if record[0] & 0xF4 == 0xC4:
            number = (int.from_bytes(data[:2], "big"), data[2])
            if number in self.refuse:
                return self._record(0x07, self.refuse[number].to_bytes(2, "big"))
            self._write(number, data[3:])
            return self._record(0x06, b"\x00\x00")
        out = b""
        for at in range(0, len(data), 3):
            number = (int.from_bytes(data[at : at + 2], "big"), data[at + 2])
            if number in self.refuse:
                return self._record(0x07, self.refuse[number].to_bytes(2, "big"))
            out += self._value(number, now)
        return self._record(0x05, out)

    def _value(self, number: tuple[int, int], now: float) -> bytes:
        if number == (1000, 3):
            word = (self.error == 1) << 8 | (not self.powered) << 10 | self.powered << 11
            return struct.pack(">H", word)
        if number == (550, 1):
            return struct.pack(">H", self.error)
        return struct.pack(">f", {(680, 5): now, (681, 5): self.set_point}[number])

    def _write(self, number: tuple[int, int], data: bytes) -> None:
        if number == (1100, 3):
            word = struct.unpack(">H", data)[0]
            self.writes.append((*number, word))
            if word & 1 and not self.control & 1:
                self.error = 1
            self.control = word
            if not self.deaf_control:
                self.powered = bool(word & 1) and self.error == 1
        else:
            self.set_point = struct.unpack(">f", data)[0]
            self.writes.append((*number, self.set_point))


class BridgePeer:
    """An encoder bridge: motor SSI4 with stamps, shaft SSI1; both turn with the time."""

    def __init__(self, period: float = 0.002, motor: float = 3.0, shaft: float = 0.2) -> None:
        self.period, self.motor, self.shaft = period, motor, shaft
        self.drift, self.base = 0.0, 7_000_000
        self.status, self.frozen, self.valid = 0, False, 1
        self._due = 0.0
        self._sequence = 0
        self._began: float | None = None
        self._frozen_sample: tuple[int, int, int] | None = None

    def power_cycle(self, now: float) -> None:
        self._began, self._sequence, self.base = None, 0, 1234

    def receive(self, data: bytes, now: float) -> list[bytes]:
        return []

    def tick(self, now: float) -> list[bytes]:
        if now < self._due:
            return []
        self._due = max(self._due + self.period, now - 10 * self.period)
        status = self.status
        if self._began is None:
            self._began, status = now, status | 0x08
        frames = [self.frame(now, status)]
        self._sequence = (self._sequence + 1) & 0xFFFF
        return frames

    def frame(self, now: float, status: int = 0) -> bytes:
        time_us = self.base + round((now - (self._began or 0.0)) * (1.0 + self.drift) * 1e6)
        motor = math.floor(self.motor * now / math.tau * TURN) % TURN
        shaft = math.floor(self.shaft * now / math.tau * TURN) % TURN
        stamp = time_us // 10 % 2048
        if self.frozen:
            self._frozen_sample = self._frozen_sample or (motor, shaft, stamp)
            motor, shaft, stamp = self._frozen_sample
        else:
            self._frozen_sample = None
        head = struct.pack(">BBHQBB", 1, status, self._sequence, time_us, 4, 1)
        words = self.valid << 31 | 1 << 30 | motor << 11 | stamp, 1 << 23 | 1 << 22 | shaft
        body = head + struct.pack(">II", *words)
        return b"\xeb\x90" + body + ccitt(body, 0xFFFF, augmented=True).to_bytes(2, "big")


class DigitalFtPeer:
    """An ATI Digital F/T: Modbus RTU until the stream is started; gauge 0 counts milliseconds."""

    MATRIX = tuple(1.0 if row == column else 0.0 for row in range(6) for column in range(6))

    def __init__(self, period: float = 0.002, serial: str = "FT12345") -> None:
        self.period, self.serial = period, serial
        self.streaming = False
        self.fault, self.gauges = 0, [0, 10, -20, 30, -40, 50]
        self.starts = 0
        self._due = 0.0
        self._received = b""

    def power_cycle(self, now: float) -> None:
        self.streaming, self._received = False, b""

    def block(self) -> bytes:
        """169 registers: 4 counts a unit of force, 8 a unit of torque."""
        return struct.pack(
            ">8s32s4s20s36fBB6fii6H6H6B6B6H16s16s16s",
            self.serial.encode(), b"Mini58", b"", b"", *self.MATRIX, 2, 3, *([100.0] * 6), 4, 8,
            *([0] * 12), *([0] * 12), *([0] * 6), b"", b"", b"",
        )  # fmt: skip

    def receive(self, data: bytes, now: float) -> list[bytes]:
        if self.streaming:
            self._received += data
            if len(self._received) >= 14:
                self.streaming, self._received = False, b""
            return []
        if len(data) < 5 or modbus(data[:-2]) != data or data[0] != 10:
            return []
        if data[1] == 3:
            first, count = struct.unpack(">HH", data[2:6])
            part = self.block()[2 * (first - 0xE3) : 2 * (first - 0xE3 + count)]
            return [modbus(bytes((10, 3, 2 * count)) + part)]
        if data == bytes.fromhex("0A4655A39D"):
            self.streaming, self._received, self._due = True, b"", now + 0.02
            self.starts += 1
            return [modbus(bytes((10, 0x46, 1)))]
        return []

    def tick(self, now: float) -> list[bytes]:
        if not self.streaming or now < self._due:
            return []
        self._due += self.period
        return [self.sample(now)]

    def sample(self, now: float) -> bytes:
        g = [round(now * 1000.0), *self.gauges[1:]]
        body = struct.pack(">6h", g[0], g[2], g[4], g[1], g[3], g[5])
        return body + bytes((sum(body) & 0x7F | self.fault << 7,))


class NetFtPeer:
    """An ATI Net F/T: endless records; Fx counts microseconds."""

    def __init__(self, period: float = 0.002) -> None:
        self.period = period
        self.streaming = False
        self.status, self.bias = 0, 0
        self.requests: list[int] = []
        self.skip = 0  # records that the network loses
        self.hangs = False  # the sensor takes no samples; the box talks on
        self._due = 0.0
        self._rdt = self._ft = 0

    def power_cycle(self, now: float) -> None:
        self.streaming, self.bias = False, 0

    def receive(self, data: bytes, now: float) -> list[bytes]:
        header, command, _ = struct.unpack(">HHI", data)
        if header == 0x1234:
            self.requests.append(command)
            if command == 0x42:
                self.bias = round(now * 1e6)
            elif command in (0, 2, 3):
                self.streaming, self._rdt, self._due = command != 0, 0, now
        return []

    def tick(self, now: float) -> list[bytes]:
        self._ft += 0 if self.hangs else 1
        if not self.streaming or now < self._due:
            return []
        self._due += self.period
        self._rdt += 1
        if self.skip:
            self.skip -= 1
            return []
        return [self.record(now)]

    def record(self, now: float) -> bytes:
        fx = round(now * 1e6) - self.bias
        return struct.pack(">3I6i", self._rdt, self._ft, self.status, fx, 2000, 0, 3, 0, -7)
