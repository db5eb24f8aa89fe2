"""The conformance test of every driver conversation."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from can_subjects import ActuatorSubject, TorqueAxisSubject
from conformance import FAULTS, Subject, check_conformance
from modbus_subject import ModbusSubject
from stream_subjects import BridgeSubject, DigitalSubject, NetSubject, ServoSubject

from drivers.compax3.servo_signals import Phase

SUBJECTS: list[Callable[[], Subject]] = [
    ServoSubject, BridgeSubject, DigitalSubject, NetSubject, TorqueAxisSubject, ActuatorSubject,
    ModbusSubject,
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("make", SUBJECTS)
def test_conversation_conforms(make: Callable[[], Subject], fault: str) -> None:
    subject = make()
    try:
        check_conformance(subject, fault)
    finally:
        subject.close()


class ZeroAge(DigitalSubject):
    """Always reports an age of 0."""

    name = "zero age"

    def ages(self) -> tuple[float, float]:
        return 0.0, super().ages()[1]


class SelfEnabling(ServoSubject):
    """Requests enabling again by itself as soon as it can."""

    name = "self-enabling"

    def before_step(self) -> None:
        if self.servo.read(self.now).phase is Phase.OFF:
            self.servo.command(2.5, 0, self.now)
        self.servo.command(2.5, 1, self.now)


class NeverRecovering(BridgeSubject):
    """Does not recover."""

    name = "never recovering"
    recovery = 1.0

    def inject(self, fault: str) -> None:
        if fault != "none":
            super().inject(fault)


@pytest.mark.parametrize(
    ("make", "fault", "message"),
    [
        (ZeroAge, "silent", "zero age reports an age of 0 s"),
        (SelfEnabling, "reconnect", "was enabled without a request"),
        (NeverRecovering, "silent", "does not work after 1 s: bridge: no frame for 0.1 s"),
    ],
)
def test_nonconforming_conversations_are_detected(
    make: Callable[[], Subject], fault: str, message: str
) -> None:
    with pytest.raises(AssertionError, match=message):
        check_conformance(make(), fault)
