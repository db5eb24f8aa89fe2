"""What any driver conversation must stand: a test it is put through, whatever device it speaks to.

A device is made to fall silent, to talk nonsense, to talk in pieces, to answer late, to break off
in the middle, and to come back. After each the conversation must be in a state that it names, must
have raised nothing but its own errors, must never tell an age below the true one, and must find
back by itself; a drive stays down until it is asked up anew.
"""

from __future__ import annotations

from typing import Protocol

FAULTS = ("silent", "garbage", "babble", "split", "late", "half", "reconnect")


class Subject(Protocol):
    """One conversation with its device and the wire between; see `docs/drivers.md`."""

    name: str
    patience: float  # s after which silence must be named and every permission gone
    recovery: float  # s in which it must be well again
    harmless: frozenset[str]  # faults that it must not even notice
    grain: float  # s by which the device's own value may be coarse
    blind: float  # s of lateness that its protocol has no way to show

    def run(self, seconds: float) -> float:
        """Let time pass, in steps short enough for the device; gives how much (s) did."""
        ...

    def spoil(self, fault: str) -> None:
        """Begin a fault of FAULTS; "none" ends it. "half": half a message, then a hang-up."""
        ...

    def told(self) -> tuple[float, float]:
        """The age (s) that the conversation tells, and the true one of the value it tells."""
        ...

    def well(self) -> bool:
        """Whether it gives fresh values and names no trouble."""
        ...

    def trouble(self) -> str:
        """What it names, empty for nothing."""
        ...

    def acting(self) -> int:
        """1: the device does what it is told by permission; 0, also of what cannot act."""
        ...

    def ask_up(self) -> bool:
        """Request what `acting` shows; False of a device that cannot act."""
        ...

    def close(self) -> None:
        """Give back what was opened."""
        ...


def make_well(subject: Subject, within: float) -> None:
    """Run until it is well; AssertionError after so long."""
    passed = 0.0
    while passed < within:
        passed += subject.run(subject.patience / 8)
        check_age(subject)
        if subject.well():
            return
    raise AssertionError(f"{subject.name} not well {within:g} s on: {subject.trouble()}")


def check_age(subject: Subject) -> None:
    """An age may be told too great, never too small."""
    told, true = subject.told()
    assert told >= true - subject.grain - subject.blind, (
        f"{subject.name} tells {told:g} s, it is {true:g} s"
    )


def conforms(subject: Subject, fault: str) -> None:
    """AssertionError names what it does not stand."""
    make_well(subject, 3.0 * subject.recovery)
    acts = subject.ask_up()
    if acts:
        subject.run(subject.patience)
        assert subject.acting() == 1, subject.trouble()
    subject.spoil(fault)
    ages, passed = [], 0.0
    while passed < 2.5 * subject.patience:
        passed += subject.run(subject.patience / 8)
        check_age(subject)
        ages.append(subject.told()[0])
        if fault in subject.harmless:
            assert subject.well(), f"{subject.name} minds {fault}: {subject.trouble()}"
    if fault in ("silent", "garbage", "half", "reconnect"):
        assert not subject.well()
        assert ages[-1] > subject.patience, f"{subject.name}: its age stood still"
        half = ages[len(ages) // 2 :]
        assert sorted(half) == half
        assert subject.acting() == 0
        assert subject.trouble()
    before = subject.acting()
    subject.spoil("none")
    make_well(subject, subject.recovery)
    assert subject.acting() <= before, f"{subject.name} went up by itself"
    if acts:
        if subject.acting() == 0:
            assert subject.ask_up()
            subject.run(subject.patience)
        assert subject.acting() == 1, subject.trouble()
