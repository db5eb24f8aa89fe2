"""The service end of a segment on a master that the test holds in its hands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from drivers.ethercat import service as services
from drivers.ethercat.service import AlState, Service

ERROR = 0x10


class SdoError(Exception):
    """An abort by the slave."""


class MailboxError(Exception):
    """A wrong box."""


class PacketError(Exception):
    """A wrong packet."""


class WkcError(Exception):
    """No answer in time."""


class Emergency(Exception):  # noqa: N818 - pysoem's name
    """An emergency in place of an answer."""


class Slave:
    """A slave whose mailbox gives prepared answers, and whose registers have prepared values."""

    def __init__(self, state: int = AlState.SAFE_OPERATIONAL) -> None:
        self.state, self.al_status = state, 0
        self.answers: list[bytes | Exception] = []
        self.registers: dict[int, int] = {}
        self.requests: list[int] = []

    def sdo_read(self, index: int, sub: int) -> bytes:
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def write_state(self) -> None:
        self.requests.append(self.state)

    def _fprd(self, register: int, size: int, timeout: int) -> bytes:
        return self.registers.get(register, 0).to_bytes(size, "little")


class Master:
    """A master of these slaves."""

    def __init__(self, slaves: list[Slave]) -> None:
        self.slaves, self.state = slaves, 0

    def open(self, interface: str) -> None:
        """Open nothing."""

    def read_state(self) -> int:
        return 0

    def write_state(self) -> int:
        return 0


@pytest.fixture
def slaves() -> list[Slave]:
    return [Slave(), Slave(), Slave()]


@pytest.fixture
def service(slaves: list[Slave], monkeypatch: pytest.MonkeyPatch) -> Service:
    module = SimpleNamespace(
        Master=lambda: Master(slaves), SdoError=SdoError, MailboxError=MailboxError,
        PacketError=PacketError, WkcError=WkcError, Emergency=Emergency,
        al_status_code_to_string=lambda code: "a text",
    )  # fmt: skip
    monkeypatch.setattr(services, "_pysoem", lambda: module)
    return Service("none0")


@pytest.mark.parametrize("disturbance", [Emergency(), WkcError(), MailboxError(), PacketError()])
def test_a_disturbed_answer_is_requested_anew(
    service: Service, slaves: list[Slave], disturbance: Exception
) -> None:
    slaves[1].answers = [disturbance, disturbance, b"\x10\x27\0\0"]
    assert service.read(1, 0x8000, 1, "u32") == 10_000


def test_an_object_that_is_missing_or_silent_has_no_value(
    service: Service, slaves: list[Slave]
) -> None:
    slaves[0].answers = [SdoError(), b"\1"]
    assert service.read(0, 0x8000, 1, "u8") is None
    assert slaves[0].answers == [b"\1"]  # an abort is an answer
    slaves[0].answers = [*[WkcError()] * 5, b"\1", WkcError(), b"\2"]
    assert [service.read(0, 0x8000, 1, "u8") for _ in range(5)] == [None, None, None, 1, 2]


def test_op_is_requested_once_in_a_while_and_anew_after_an_error(
    service: Service, slaves: list[Slave], monkeypatch: pytest.MonkeyPatch
) -> None:
    now: Any = [100.0]
    monkeypatch.setattr(services.time, "monotonic", lambda: now[0])
    slaves[1].state, slaves[2].state = AlState.OPERATIONAL, AlState.PRE_OPERATIONAL
    for _ in range(50):
        slaves[0].state = AlState.SAFE_OPERATIONAL
        service.request_operational()
        now[0] += 0.02
    assert slaves[0].requests == [AlState.OPERATIONAL]  # a slave that waits begins anew each time
    slaves[0].state = AlState.SAFE_OPERATIONAL | ERROR
    service.request_operational()
    slaves[0].state = AlState.SAFE_OPERATIONAL
    service.request_operational()
    assert slaves[0].requests[1:] == [AlState.SAFE_OPERATIONAL | ERROR, AlState.OPERATIONAL]
    now[0] += 1.5
    slaves[0].state = AlState.SAFE_OPERATIONAL
    service.request_operational()  # the request may have been lost
    assert slaves[0].requests[3:] == [AlState.OPERATIONAL]
    assert slaves[1].requests == slaves[2].requests == []


def test_only_clocks_have_a_difference_and_the_first_one_leads(
    service: Service, slaves: list[Slave]
) -> None:
    slaves[0].registers = {0x0008: 0x04, 0x092C: 0x8000_01F4}
    slaves[1].registers = {0x0008: 0x04, 0x092C: 700}
    slaves[2].registers = {0x0008: 0x00, 0x092C: 5}
    assert service.clock_differences() == (500, 700, None)
    assert service.reference_clock() == 0x1001
    slaves[0].registers[0x0008] = 0
    assert service.reference_clock() == 0x1002


def test_slaves_that_stay_behind_are_named_with_their_codes(
    service: Service, slaves: list[Slave]
) -> None:
    slaves[1].state, slaves[1].al_status = AlState.SAFE_OPERATIONAL | ERROR, 0x36
    slaves[0].state = slaves[2].state = AlState.OPERATIONAL
    assert service.missing(["a", "b", "c"], AlState.OPERATIONAL) == [
        "b: does not reach OPERATIONAL, is in SAFE_OPERATIONAL with an error with AL status "
        "0x0036, a text"
    ]


WATCHED = {
    0x0400: 2498, 0x0420: 200,  # 20 ms
    0x0802: 128, 0x0804: 0x26, 0x0806: 1,  # mailbox
    0x0812: 4, 0x0814: 0x64, 0x0816: 1,  # outputs that trigger the watchdog
    0x081A: 15, 0x081C: 0x20, 0x081E: 1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({}, ""),
        ({0x0400: 498, 0x0420: 1000}, ""),  # another divider
        ({0x0420: 0}, "its watchdog lasts 0 ms; expected 20 ms"),
        ({0x0420: 2000}, "its watchdog lasts 200 ms"),
        ({0x0814: 0x24}, "its outputs do not trigger its watchdog (0x0814 is 0x24)"),
        ({0x0814: 0x24, 0x0812: 0}, ""),  # no outputs
        ({0x0814: 0x24, 0x0816: 0}, ""),
        ({0x0804: 0x24}, "its outputs do not trigger its watchdog (0x0804 is 0x24)"),
    ],
)
def test_a_slave_that_would_not_stop_without_frames_is_found(
    service: Service, slaves: list[Slave], changed: dict[int, int], text: str
) -> None:
    slaves[0].registers = WATCHED | changed
    problem = service._watchdog_problem(slaves[0], 20.0)
    assert text in problem
    assert bool(problem) == bool(text)
