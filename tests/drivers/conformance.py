"""Conformance test of a driver conversation, independent of the device.

The test injects faults: the device falls silent, sends invalid data, sends in pieces, answers late,
breaks off within a message, and comes back. After each fault the conversation must report its
state, must have raised nothing but its own errors, must never report an age below the true one, and
must recover by itself; a drive stays disabled until a new request.
"""

from __future__ import annotations

from typing import Protocol

FAULTS = ("silent", "garbage", "babble", "split", "late", "half", "reconnect")


class Subject(Protocol):
    """One conversation, its device and the wire between them; see `docs/how_to/add_a_device.md`."""

    name: str
    timeout_s: float  # s after which silence must be reported and every permission withdrawn
    recovery: float  # s within which it must work again
    harmless: frozenset[str]  # faults that must have no effect
    resolution: float  # s, resolution of the device's value
    undetectable_delay: float  # s of delay that its protocol cannot reveal

    def run(self, seconds: float) -> float:
        """Advance time in steps short enough for the device; return the elapsed time (s)."""
        ...

    def inject(self, fault: str) -> None:
        """Start a fault of FAULTS; "none" ends it. "half": half a message, then a hang-up."""
        ...

    def ages(self) -> tuple[float, float]:
        """Return the age (s) that the conversation reports, and the true age of its value."""
        ...

    def is_well(self) -> bool:
        """Return True if the values are fresh and no problem is reported."""
        ...

    def problem(self) -> str:
        """Return the reported problem, empty for none."""
        ...

    def acting(self) -> int:
        """Return 1 while the device follows commands; 0 otherwise, and if it cannot act."""
        ...

    def request_enable(self) -> bool:
        """Request enabling; return False for a device that cannot act."""
        ...

    def close(self) -> None:
        """Close everything that was opened."""
        ...


def run_until_well(subject: Subject, timeout_s: float) -> None:
    """Run until the conversation works; AssertionError after ``timeout_s``."""
    elapsed = 0.0
    while elapsed < timeout_s:
        elapsed += subject.run(subject.timeout_s / 8)
        check_age(subject)
        if subject.is_well():
            return
    raise AssertionError(f"{subject.name} does not work after {timeout_s:g} s: {subject.problem()}")


def check_age(subject: Subject) -> None:
    """Assert that the reported age is not below the true one."""
    reported, true = subject.ages()
    assert reported >= true - subject.resolution - subject.undetectable_delay, (
        f"{subject.name} reports an age of {reported:g} s, the true one is {true:g} s"
    )


def check_conformance(subject: Subject, fault: str) -> None:
    """Assert that the conversation handles one fault; AssertionError names the violation."""
    run_until_well(subject, 3.0 * subject.recovery)
    can_act = subject.request_enable()
    if can_act:
        subject.run(subject.timeout_s)
        assert subject.acting() == 1, subject.problem()
    subject.inject(fault)
    ages, elapsed = [], 0.0
    while elapsed < 2.5 * subject.timeout_s:
        elapsed += subject.run(subject.timeout_s / 8)
        check_age(subject)
        ages.append(subject.ages()[0])
        if fault in subject.harmless:
            assert subject.is_well(), f"{subject.name} is affected by {fault}: {subject.problem()}"
    if fault in ("silent", "garbage", "half", "reconnect"):
        assert not subject.is_well()
        assert ages[-1] > subject.timeout_s, f"{subject.name}: its age did not grow"
        half = ages[len(ages) // 2 :]
        assert sorted(half) == half
        assert subject.acting() == 0
        assert subject.problem()
    before = subject.acting()
    subject.inject("none")
    run_until_well(subject, subject.recovery)
    assert subject.acting() <= before, f"{subject.name} was enabled without a request"
    if can_act:
        if subject.acting() == 0:
            assert subject.request_enable()
            subject.run(subject.timeout_s)
        assert subject.acting() == 1, subject.problem()
