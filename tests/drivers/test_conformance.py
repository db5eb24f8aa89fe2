"""Every driver conversation that there is, put through the conformance test."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from can_subjects import ActuatorSubject, TorqueAxisSubject
from conformance import FAULTS, Subject, conforms
from modbus_subject import ModbusSubject
from stream_subjects import BridgeSubject, DigitalSubject, NetSubject, ServoSubject

from drivers.compax3.servo_signals import Phase

SUBJECTS: list[Callable[[], Subject]] = [
    ServoSubject, BridgeSubject, DigitalSubject, NetSubject, TorqueAxisSubject, ActuatorSubject,
    ModbusSubject,
]  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("make", SUBJECTS)
def test_a_conversation_stands(make: Callable[[], Subject], fault: str) -> None:
    subject = make()
    try:
        conforms(subject, fault)
    finally:
        subject.close()


class YoungForEver(DigitalSubject):
    """Tells an age of 0 whatever happens."""

    name = "one that lies"

    def told(self) -> tuple[float, float]:
        return 0.0, super().told()[1]


class Eager(ServoSubject):
    """Asks up again by itself as soon as it may."""

    name = "one that goes up by itself"

    def each(self) -> None:
        if self.servo.read(self.now).phase is Phase.OFF:
            self.servo.command(2.5, 0, self.now)
        self.servo.command(2.5, 1, self.now)


class Deaf(BridgeSubject):
    """Does not come back."""

    name = "one that stays away"
    recovery = 1.0

    def spoil(self, fault: str) -> None:
        if fault != "none":
            super().spoil(fault)


@pytest.mark.parametrize(
    ("make", "fault", "said"),
    [
        (YoungForEver, "silent", "one that lies tells 0 s"),
        (Eager, "reconnect", "went up by itself"),
        (Deaf, "silent", "not well 1 s on: bridge: no frame for 0.1 s"),
    ],
)
def test_one_that_does_not_conform_is_found(
    make: Callable[[], Subject], fault: str, said: str
) -> None:
    with pytest.raises(AssertionError, match=said):
        conforms(make(), fault)
