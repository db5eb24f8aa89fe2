"""A small master for tests, on a clock that tests move. It packs frames and boxes by hand."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

from sim_plant.emulators.ethercat.line import BenchLine
from sim_plant.emulators.ethercat.slave import Slave

DEVICES = Path(__file__).resolve().parents[3] / "configs" / "devices"
NOP, APRD, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW, ARMW, FRMW = range(15)
INIT, PREOP, SAFEOP, OP = 1, 2, 4, 8
MS = 1_000_000
STATION = 0x1001  # address of the first slave
LOGICAL = 0x0001_0000
SDO_REQUEST, SDO_RESPONSE = 2, 3


def datagram(
    command: int, address: int, data: bytes, index: int = 0, *, more: bool = False
) -> bytes:
    length = len(data) | (0x8000 if more else 0)
    return struct.pack("<BBIHH", command, index, address, length, 0) + data + b"\0\0"


def frame(*datagrams: bytes) -> bytes:
    body = b"".join(datagrams)
    head = b"\xff" * 6 + bytes.fromhex("010101010101") + b"\x88\xa4"
    return (head + struct.pack("<H", len(body) | 0x1000) + body).ljust(60, b"\0")


class FrameMaster:
    """A bench line on a manual clock, and the datagrams to it."""

    def __init__(self, *names: str) -> None:
        self.now = 5_000 * MS
        self.line = BenchLine(names, DEVICES, lambda: self.now)
        self.segment = self.line.segment
        self.slaves: Sequence[Slave] = list(self.segment.slaves.values())
        self.image = b""  # outputs and inputs of all slaves, as last received
        self.areas: list[tuple[int, int, int, int]] = []  # offset and octets: outputs, inputs
        self._counters = [0] * len(self.slaves)

    def pass_time(self, ms: float) -> None:
        """Let time pass without frames."""
        end = self.now + round(ms * MS)
        while self.now < end:
            self.now = min(end, self.now + MS)
            self.segment.poll(self.now)

    # ---- datagrams ------------------------------------------------------------------------------

    def send(self, command: int, address: int, data: bytes) -> tuple[bytes, int]:
        """Send one datagram; return its data and working counter, -1 without an answer."""
        answer = self.segment.process(frame(datagram(command, address, data)))
        if answer is None:
            return b"", -1
        self.segment.finish_frame()
        end = 26 + len(data)
        return answer[26:end], int.from_bytes(answer[end : end + 2], "little")

    def station(self, command: int, number: int, offset: int, data: bytes) -> tuple[bytes, int]:
        return self.send(command, STATION + number | offset << 16, data)

    def read(self, number: int, offset: int, octets: int) -> int:
        data, counter = self.station(FPRD, number, offset, bytes(octets))
        assert counter == 1, f"0x{offset:04X} of slave {number}: working counter {counter}"
        return int.from_bytes(data, "little")

    def write(self, number: int, offset: int, value: int, octets: int) -> int:
        data = value.to_bytes(octets, "little")
        return self.station(FPWR, number, offset, data)[1]

    # ---- states ---------------------------------------------------------------------------------

    def request(self, number: int, state: int) -> tuple[int, int]:
        """Request an AL state; return status and code."""
        self.write(number, 0x0120, state, 2)
        return self.status(number)

    def status(self, number: int) -> tuple[int, int]:
        return self.read(number, 0x0130, 2), self.read(number, 0x0134, 2)

    def reach_preop(self) -> None:
        """Give addresses and mailboxes; bring all slaves to PREOP."""
        for number, slave in enumerate(self.slaves):
            address = (-number & 0xFFFF) | 0x0010 << 16
            assert self.send(APWR, address, (STATION + number).to_bytes(2, "little"))[1] == 1
            if slave.mailbox is not None:
                self.station(FPWR, number, 0x0800, bytes.fromhex("0010800026000100"))
                self.station(FPWR, number, 0x0808, bytes.fromhex("8010800022000100"))
            assert self.request(number, PREOP) == (PREOP, 0), slave.name

    def reach_safeop(self) -> None:
        """Map all process data one after the other, octet by octet; bring all slaves to SAFEOP."""
        at = LOGICAL
        self.areas = []
        for number, slave in enumerate(self.slaves):
            slave.process_data.refresh()
            first = 2 if slave.mailbox is not None else 0
            outputs, inputs = slave.process_data.outputs.octets, slave.process_data.inputs.octets
            unit = 0
            area = [0, 0, 0, 0]
            for kind, octets, start, control, sm in (
                (2, outputs, 0x1100, 0x64, first),
                (1, inputs, 0x1800 if first else 0x1100, 0x20, 3 if first else 0),
            ):
                if not octets:
                    continue
                manager = struct.pack("<HHBBBB", start, octets, control, 0, 1, 0)
                self.station(FPWR, number, 0x0800 + 8 * sm, manager)
                fmmu = struct.pack("<IHBBHBBBxxx", at, octets, 0, 7, start, 0, kind, 1)
                assert self.station(FPWR, number, 0x0600 + 16 * unit, fmmu)[1] == 1
                area[0 if kind == 2 else 2 : 2 if kind == 2 else 4] = at - LOGICAL, octets
                unit, at = unit + 1, at + octets
            self.areas.append((area[0], area[1], area[2], area[3]))
            assert self.request(number, SAFEOP) == (SAFEOP, 0), slave.name
        self.image = bytes(at - LOGICAL)

    def reach_op(self) -> None:
        self.reach_preop()
        self.reach_safeop()
        self.cycle()
        for number in range(len(self.slaves)):
            assert self.request(number, OP) == (OP, 0), self.slaves[number].name

    # ---- process data ---------------------------------------------------------------------------

    def cycle(self, outputs: dict[int, bytes] | None = None, *, command: int = LRW) -> int:
        """Send outputs of slaves, the others as before; 1 ms passes; return the working counter."""
        image = bytearray(self.image)
        for number, data in (outputs or {}).items():
            at, octets, _, _ = self.areas[number]
            assert len(data) == octets
            image[at : at + octets] = data
        self.image, counter = self.send(command, LOGICAL, bytes(image))
        self.now += MS
        self.segment.poll(self.now)
        return counter

    def inputs(self, number: int) -> bytes:
        _, _, at, octets = self.areas[number]
        return self.image[at : at + octets]

    # ---- mailbox --------------------------------------------------------------------------------

    def put_box(self, number: int, data: bytes, kind: int = 3, counter: int = 0) -> int:
        """Write a box; without `counter` with the next one. Return the working counter."""
        if not counter:
            counter = self._counters[number] = self._counters[number] % 7 + 1
        box = struct.pack("<HHBB", len(data), 0, 0, kind | counter << 4) + data
        return self.station(FPWR, number, 0x1000, box.ljust(128, b"\0"))[1]

    def get_box(self, number: int) -> tuple[int, bytes] | None:
        """Return type and data of the box that waits, None if there is none."""
        data, counter = self.station(FPRD, number, 0x1080, bytes(128))
        if not counter:
            return None
        length, _, _, kind = struct.unpack_from("<HHBB", data)
        return kind & 0x0F, data[6 : 6 + length]

    def coe(self, number: int, service: int, body: bytes) -> tuple[int, bytes]:
        """Send a CoE box and return service and body of the answer."""
        assert self.put_box(number, struct.pack("<H", service << 12) + body) == 1
        box = self.get_box(number)
        assert box is not None, "no answer"
        assert box[0] == 3
        return int.from_bytes(box[1][:2], "little") >> 12, box[1][2:]

    def sdo(self, number: int, body: bytes) -> bytes:
        return self.coe(number, SDO_REQUEST, body)[1]

    def download(self, number: int, index: int, sub: int, data: bytes) -> int:
        """Write an object, expedited; return the abort code, 0 without one."""
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub)
        answer = self.sdo(number, head + data.ljust(4, b"\0"))
        if answer[0] == 0x80:
            return int.from_bytes(answer[4:8], "little")
        assert answer == struct.pack("<BHB4x", 0x60, index, sub)
        return 0

    def upload(self, number: int, index: int, sub: int = 0) -> int:
        """Read an integer object of up to 4 octets."""
        answer = self.sdo(number, struct.pack("<BHB4x", 0x40, index, sub))
        assert answer[0] & 0xF3 == 0x43, answer.hex()
        assert answer[1:4] == struct.pack("<HB", index, sub)
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little")
