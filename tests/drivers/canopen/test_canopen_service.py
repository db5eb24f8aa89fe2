"""The CAN service against a node that answers late, wrongly, repeatedly or not at all."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Iterator

import can
import pytest
from canopen_drives import MACHINE, OWN, foreign_steps, until

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.heartbeat import NmtState
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service, ServiceError
from drivers.cia402 import arming, homing
from drivers.cia402.arming import SetupStep
from drivers.cia402.drive_objects import Access
from drivers.cia402.homing_run import HomingSettings

NODE = 5
HOMING = HomingSettings(MACHINE, homing.Params(10, 10))
BUS = BusSettings("virtual", "service", 1_000_000, ())
KIND, RIGID = (0x1000, 0), (0x608F, 1)
ABORTED = struct.pack("<BHBI", 0x80, 0x1000, 0, 0x0602_0000)


class Answers:
    """A node that only answers SDO requests; expedited, mostly four bytes."""

    def __init__(self) -> None:
        self.objects = {KIND: 402, RIGID: 20000}
        self.sizes: dict[tuple[int, int], int] = {}  # bytes, where they are not four
        self.written: list[tuple[int, int, int]] = []
        self.refused: set[tuple[int, int]] = set()
        self.late = 0.0  # s
        self.change: Callable[[bytes], bytes] = lambda answer: answer
        self.commands: list[int] = []  # of NMT
        self.bus = can.Bus(interface="virtual", channel="service")
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            message = self.bus.recv(0.02)
            if message is None:
                continue
            if message.arbitration_id == 0:
                self.commands.append(message.data[0])
            elif message.arbitration_id == 0x600 + NODE and message.data[0] != 0x80:
                time.sleep(self.late)
                self.transmit(0x580 + NODE, self.change(self._answer(bytes(message.data))))

    def _answer(self, request: bytes) -> bytes:
        word, index, sub, value = struct.unpack("<BHBI", request)
        key = index, sub
        if key in self.refused or (word == 0x40 and key not in self.objects):
            return struct.pack("<BHBI", 0x80, index, sub, 0x0602_0000)
        if word == 0x40:
            unused = 4 - self.sizes.get(key, 4)
            return struct.pack("<BHBI", 0x43 | unused << 2, index, sub, self.objects[key])
        self.written.append((index, sub, value))
        self.objects.setdefault(key, value)
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def transmit(self, identifier: int, data: bytes) -> None:
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def close(self) -> None:
        self._ended.set()
        self._thread.join(5.0)
        self.bus.shutdown()


@pytest.fixture
def node() -> Iterator[Answers]:
    one = Answers()
    yield one
    one.close()


@pytest.fixture
def service(node: Answers) -> Iterator[Service]:
    one = Service(BUS)
    one.watch(NODE)
    yield one
    one.close()


def step(key: tuple[int, int], value: int, access: Access = Access.SET) -> SetupStep:
    return SetupStep(*key, "u32", f"object {key[0]:#x}", value, access, -1)


def test_writing_is_read_back_and_a_write_that_did_nothing_is_named(
    service: Service, node: Answers
) -> None:
    steps = (step((0x6085, 0), 7), step(RIGID, 4096), step(KIND, 402, Access.VERIFY))
    assert arming.format_mismatches(service.set_up(NODE, steps)) == (
        "0x608f:01 object 0x608f: expected 4096 (0x1000), got 20000 (0x4e20)"
    )
    assert node.written == [(0x6085, 0, 7), (0x608F, 1, 4096)], "verified objects are not written"
    assert node.commands == [128]


def test_an_abort_is_no_answer_and_the_rest_is_still_done(service: Service, node: Answers) -> None:
    node.refused.add((0x6085, 0))
    mismatches = service.set_up(NODE, (step((0x6085, 0), 7), step((0x6007, 0), 2)))
    assert [(one.object, one.actual) for one in mismatches] == [(0x6085, None)]
    assert node.written == [(0x6007, 0, 2)]


def test_a_late_answer_within_the_timeout_is_accepted(service: Service, node: Answers) -> None:
    node.late = 0.2
    assert service.set_up(NODE, (step((0x6007, 0), 2),)) == ()


def test_a_node_that_answers_too_late_does_not_answer_and_its_old_answer_is_not_taken(
    service: Service, node: Answers
) -> None:
    node.late = 0.8
    with pytest.raises(ServiceError, match=r"^node 5 does not answer$"):
        service.set_up(NODE, (step((0x6007, 0), 2),))
    node.late = 0.0
    time.sleep(0.5)
    assert service.read(NODE, *RIGID, "u32") == 20000


@pytest.mark.parametrize(
    "change",
    [
        lambda answer: answer[:4],
        lambda answer: answer[:1],
        lambda answer: b"",
        lambda answer: b"\x80",
        lambda answer: b"\xff" * 8,
        lambda answer: answer[:1] + b"\x01\x20\x00" + answer[4:],  # of another object
        lambda answer: ABORTED,
    ],
)
def test_answers_of_a_wrong_length_or_meaning_are_none(
    change: Callable[[bytes], bytes], service: Service, node: Answers
) -> None:
    node.change = change
    assert service.read(NODE, *KIND, "u32") is None
    assert service.identity(NODE).name is None
    with pytest.raises(ServiceError, match=r"^node 5 does not answer$"):
        service.set_up(NODE, ())
    assert service.health()[NODE].code == 0, "and the service lives"


def test_an_object_of_another_size_is_rejected(service: Service) -> None:
    assert service.read(NODE, *KIND, "u16") is None
    assert service.read(NODE, *KIND, "i32") == 402


def test_a_silent_node_keeps_its_age_and_a_restart_is_counted(
    service: Service, node: Answers
) -> None:
    before = service.health()[NODE]
    assert (before.nmt, before.boots, before.code) == (NmtState.SILENT, 0, 0)
    time.sleep(0.05)
    assert service.health()[NODE].last_heartbeat == before.last_heartbeat
    for state in (NmtState.BOOT, NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL, NmtState.BOOT):
        node.transmit(0x700 + NODE, bytes((state,)))
    until(lambda: service.health()[NODE].boots == 2, lambda: None)
    assert service.health()[NODE].last_heartbeat > before.last_heartbeat


def test_frames_that_are_no_heartbeat_or_emergency_change_nothing(
    service: Service, node: Answers
) -> None:
    before = service.health()
    for data in (b"", b"\x05\x05", b"\x33"):
        node.transmit(0x700 + NODE, data)
    node.transmit(0x80 + NODE, b"\x10\x32")
    node.transmit(0x700 + OWN, b"\x05")
    node.transmit(0x80 + NODE, bytes.fromhex("103205 0000000000"))
    until(lambda: service.health()[NODE].code == 0x3210, lambda: None)
    after = service.health()[NODE]
    assert (after.emergencies, after.register) == (1, 5)
    assert after._replace(code=0, register=0, emergencies=0) == before[NODE]
    assert set(service.health()) == {NODE}


def test_a_bus_that_accepts_no_frames_is_reported(
    service: Service, node: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise can.CanOperationError("Transmit buffer full")

    monkeypatch.setattr(service._can, "send", full)
    for act in (lambda: service.set_up(NODE, foreign_steps(NODE)), lambda: service.start(NODE)):
        with pytest.raises(
            ServiceError, match=r"^node 5: cannot send NMT .*: Transmit buffer full$"
        ):
            act()
    service.stop(NODE)
    assert service.read(NODE, *KIND, "u32") is None
    with pytest.raises(LinkError, match="Transmit buffer full"):
        service.scan(0.02)


def test_requests_wait_for_space_in_the_queue(
    service: Service, node: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    send, counter = service._can.send, [0]

    def small(message: can.Message, timeout: float | None = None) -> None:
        counter[0] = (counter[0] + 1) % 11
        if counter[0] == 0:
            raise can.CanOperationError("Transmit buffer full")
        send(message, timeout)

    monkeypatch.setattr(service._can, "send", small)
    assert service.scan(0.5) == (NODE,)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_dead_reader_is_reported_and_closing_raises_nothing(
    service: Service, node: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(*_: object) -> None:
        raise struct.error("garbage")

    monkeypatch.setattr(service._can, "recv", dies)
    node.transmit(0x700 + NODE, b"\x05")

    def deaf() -> bool:
        try:
            service.health()
        except LinkError as error:
            return str(error) == "the CAN service receives no frames: garbage"
        return False

    until(deaf, lambda: None)
    service.close()
    service.close()


def test_bus_off_is_reported_and_persists(service: Service, node: Answers) -> None:
    def error(kind: int) -> None:
        node.bus.send(can.Message(arbitration_id=kind, data=bytes(8), is_error_frame=True))

    def frame_count() -> int:
        return service.health()[NODE].boots

    for kind in (0x004, 0x100, 0x008, 0x020):  # passive, restarted, protocol, no acknowledge
        error(kind)
    node.transmit(0x040, b"")  # a data frame with that identifier, not an error frame
    node.transmit(0x700 + NODE, b"\x00")
    until(lambda: frame_count() == 1, lambda: None)
    error(0x040)

    def off() -> bool:
        try:
            service.health()
        except LinkError as error:
            return "bus-off" in str(error)
        return False

    until(off, lambda: None)
    error(0x100)
    node.transmit(0x700 + NODE, b"\x05")
    until(lambda: service._health[NODE].nmt == NmtState.OPERATIONAL, lambda: None)
    assert off()


def test_a_drive_silent_during_homing_is_reported_and_disabled(
    service: Service, node: Answers
) -> None:
    node.objects |= {(0x6041, 0): 0x0250}
    why = r"^node 5 may still be powered: .*; it did not home: no answer$"
    with pytest.raises(ServiceError, match=why):
        service.home(NODE, HOMING, lambda: False)
    assert node.written[0] == (0x6060, 0, homing.MODE)
    assert node.written[-1] == (0x6040, 0, 0)


def test_a_homed_drive_is_left_unchanged(service: Service, node: Answers) -> None:
    """A second run must not wait for a change of an outcome that is left from the first."""
    node.objects |= {(0x6041, 0): 0x1640, (0x6061, 0): homing.MODE}
    node.sizes |= {(0x6041, 0): 2, (0x6061, 0): 1}
    service.home(NODE, HOMING, lambda: False)
    assert node.written == [(0x6060, 0, homing.MODE), (0x6040, 0, 0)]  # homed, and without power


def test_a_drive_that_stays_enabled_after_homing_is_reported(
    service: Service, node: Answers
) -> None:
    node.objects |= {(0x6041, 0): 0x1637, (0x6061, 0): homing.MODE}
    node.sizes |= {(0x6041, 0): 2, (0x6061, 0): 1}
    with pytest.raises(ServiceError, match=r"^node 5 may still be powered: .* emergency stop$"):
        service.home(NODE, HOMING, lambda: False)
    assert node.written.count((0x6040, 0, 0)) > 10


def test_a_bus_that_is_not_there_is_named() -> None:
    with pytest.raises(LinkError, match=r"^CAN bus slcan /nowhere: "):
        Service(BusSettings("slcan", "/nowhere", 1_000_000, ()))
