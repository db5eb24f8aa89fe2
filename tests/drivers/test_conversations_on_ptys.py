"""Each serial conversation over a real link on a pty: byte by byte, hang-up and return.

One thread runs both ends, so a busy machine affects only the duration.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from device_peers import BridgePeer, Compax3Peer, DigitalFtPeer, Peer
from pty_port import PtyPort
from stream_subjects import BRIDGE, DIGITAL, SERVO

from drivers.compax3.requests import Timing
from drivers.compax3.servo import Servo
from drivers.conversation import Exchange
from drivers.encoder import unwrap
from drivers.encoder.bridge_reader import BridgeReader
from drivers.force_torque.digital_reader import DigitalReader
from drivers.serial_link import SerialLink, SerialSettings

BUSY = 0.5  # s that a busy machine may stall


class Case(NamedTuple):
    """A conversation, its peer, and the age of its last good value."""

    conversation: Any
    peer: Peer
    age: Callable[[float], float]


def servo() -> Case:
    settings = SERVO._replace(
        set_point_timeout=2.0,
        max_status_age=2.0,
        enable_timeout=2.0,
        timing=Timing(answer_timeout=BUSY, quiet_time=0.1),
    )
    talk = Servo(settings)
    return Case(talk, Compax3Peer(), lambda now: talk.read(now).age)


def bridge() -> Case:
    # A turn in 30 s: a machine that stalls for a while does not lose it.
    slow = unwrap.Params(1 << 19, 0.5, 8.0)
    motor, shaft = (
        BRIDGE.motor._replace(unwrap_params=slow),
        BRIDGE.shaft._replace(unwrap_params=slow),
    )
    talk = BridgeReader(BRIDGE._replace(motor=motor, shaft=shaft, silence_timeout=BUSY))
    return Case(talk, BridgePeer(motor=0.2, shaft=0.1), lambda now: talk.read(now).motor.age)


def digital() -> Case:
    talk = DigitalReader(DIGITAL._replace(answer_timeout=BUSY, silence_timeout=BUSY))
    return Case(talk, DigitalFtPeer(), lambda now: talk.read(now).age)


@pytest.fixture
def port(tmp_path: Path) -> Iterator[PtyPort]:
    port = PtyPort(tmp_path / "port")
    yield port
    port.pull()


class PortLoop:
    """Runs both ends alternately."""

    def __init__(self, case: Case, port: PtyPort, echo: int = 0) -> None:
        self.case, self.port = case, port
        self.began = time.monotonic()
        self.link = SerialLink(
            SerialSettings("device", str(port.path), 460_800, "N", 1, echo=echo), clock=self.now
        )
        self.exchange = Exchange(self.link, case.conversation)

    def now(self) -> float:
        return time.monotonic() - self.began

    def until(
        self, condition: Callable[[], bool], by_byte: bool = False, timeout_s: float = 10.0
    ) -> None:
        end = self.now() + timeout_s
        while not condition():
            assert self.now() < end, self.case.conversation.explain(self.now()) or self.link.problem
            self.port.pump(self.case.peer, self.now(), by_byte)
            self.exchange.step()
            time.sleep(0.0005)

    def fresh(self) -> bool:
        now = self.now()
        return self.case.age(now) < 0.2 and self.case.conversation.explain(now) == ""


CASES = [servo, bridge, digital]


@pytest.mark.parametrize("make", CASES)
@pytest.mark.parametrize("by_byte", [True, False])
def test_a_conversation_runs_over_a_port(
    make: Callable[[], Case], port: PtyPort, by_byte: bool
) -> None:
    table = PortLoop(make(), port)
    table.until(table.fresh, by_byte)
    assert table.link.open_count == 1
    table.link.close()


@pytest.mark.parametrize("make", CASES)
def test_a_pulled_adapter_is_found_again(make: Callable[[], Case], port: PtyPort) -> None:
    table = PortLoop(make(), port)
    table.until(table.fresh)
    port.pull()
    table.until(lambda: not table.link.is_open)
    lost_at = table.now()
    table.until(lambda: table.now() > lost_at + 0.3)
    assert table.case.age(table.now()) > 0.3
    port.plug()
    table.case.peer.power_cycle(table.now())
    table.until(lambda: table.fresh() and table.case.age(table.now()) < table.now() - lost_at)
    assert (table.link.open_count, table.link.loss_count) == (2, 1)
    table.link.close()


def test_a_servo_that_was_on_stays_down_after_the_hang_up(port: PtyPort) -> None:
    case = servo()
    table = PortLoop(case, port)
    drive = case.peer
    assert isinstance(drive, Compax3Peer)
    table.until(table.fresh)

    def up() -> bool:
        case.conversation.command(1.0, 1, table.now())
        return drive.powered and drive.set_point == 1.0

    table.until(up)
    port.pull()
    table.until(lambda: not table.link.is_open)
    port.plug()  # the drive kept its power and its set-point

    def down() -> bool:
        case.conversation.command(1.0, 1, table.now())
        return not drive.powered

    table.until(down)
    assert "the port was opened again" in case.conversation.explain(table.now())
    writes = len(drive.writes)
    until = table.now() + 0.3
    table.until(lambda: not down() or table.now() > until)
    assert not any(word & 1 for index, _, word in drive.writes[writes:] if index == 1100)
    table.link.close()


def test_a_servo_behind_an_adapter_with_echo(port: PtyPort) -> None:
    class Echoing(Compax3Peer):
        def receive(self, data: bytes, now: float) -> list[bytes]:
            return [data, *super().receive(data, now)]

    case = servo()._replace(peer=Echoing())
    table = PortLoop(case, port, echo=1)
    table.until(table.fresh)
    assert table.link.echoes_missed == 0
    assert case.conversation.requests.late == 0
    table.link.close()
