"""Reasons of a stop, each with a stable number, a stop category and a text.

The core knows the reasons of loop, people, drives, axes, panel and power stations; a kind of rig
adds its own (`rig.realtime.cycle.Kind`). A log row holds the number, and a run records the table.
Numbers below 100 belong to this distribution; a kind of another one uses 100 to 255.
"""

from collections.abc import Iterable, Mapping
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple, Self


class StopReason(IntEnum):
    """Numbers of reasons of a stop, each with its stop category, its text and the advice to people.

    A controlled stop (category 1) is impossible after a fault in something that the damping itself
    needs: encoder, drive, arithmetic, time.
    """

    category: int
    text: str
    advice: str

    def __new__(cls, number: int, category: int, text: str, advice: str = "") -> Self:
        member = int.__new__(cls, number)
        member._value_, member.category, member.text = number, category, text
        member.advice = advice
        return member


class Reason(StopReason):
    """Reasons of every kind of rig."""

    NONE = 0, 1, "no reason recorded"
    PLAN_END = (
        1,
        1,
        "the plan ran to its end",
        "Nothing to do: the results follow.",
    )
    OPERATOR_STOP = (
        2,
        1,
        "the operator stopped the run",
        "A new run continues; rows measured so far are kept.",
    )
    OPERATOR_ABORT = (
        3,
        0,
        "the operator aborted the run (power off at once)",
        "Check that the body is at rest before a new run.",
    )
    SUPERVISOR_LOST = (
        4,
        1,
        "`rig run` stopped sending its heartbeat: killed, suspended, or delayed by a busy host",
        "Look at the terminal of the run; `rig recover` finishes the record.",
    )
    LOGGER_LOST = (
        5,
        1,
        "the record could not be written: logger, disk or folder was lost",
        "Check the disk and the folder of runs; `rig recover` finishes the record.",
    )
    NOT_FINITE = (
        6,
        0,
        "a value was NaN or infinite",
        "Look with `rig plot last` at the last seconds, for the first value that is no number.",
    )
    STALE_ENCODER = (
        7,
        0,
        "the encoder's value was too old",
        "Check cable and supply of the encoder, then `rig devices`.",
    )
    STALE_DRIVE = (
        8,
        0,
        "the drive's values were too old",
        "Check cable and supply of the drive, then `rig devices`.",
    )
    LOST_TICKS = (
        12,
        0,
        "too many ticks were lost in one gap",
        "Run `rig doctor`: another program or the host delayed the loop.",
    )
    DRIVE_FAULT = (
        13,
        0,
        "the drive reported a fault",
        "Read the fault code at the drive, remove the cause, reset the drive.",
    )
    DRIVE_DROPPED = (
        14,
        0,
        "the drive switched its power off by itself",
        "Check supply and enable chain of the drive.",
    )
    DRIVE_NOT_ON = (
        15,
        0,
        "the drive did not come up in time",
        "Check supply, enable chain and fault code of the drive.",
    )
    POSITION = (
        16,
        1,
        "the position limit was reached",
        "Check the set point and the sea; move the body back before a new run.",
    )
    VELOCITY = (
        17,
        1,
        "the velocity limit was reached",
        "Check the set point and the sea.",
    )
    NOT_CALM = (
        21,
        1,
        "the body moved during the tare",
        "Wait for calm water, then start the run over.",
    )
    EXCEPTION = (
        22,
        0,
        "the loop's own code failed",
        "Keep the run's folder and report the fault with `loop.stderr`.",
    )
    ENCODER_JUMP = (
        23,
        0,
        "the encoder jumped: it slipped or lost counts",
        "Check coupling and cable of the encoder.",
    )
    EMERGENCY_STOP = (
        34,
        0,
        "the emergency stop was pressed",
        "Find out who pressed it and why; release it; start a new run.",
    )
    LIMIT_SWITCH = (
        35,
        1,
        "a limit switch was hit",
        "Move the body off the switch with the power off.",
    )
    STALE_PANEL = (
        36,
        1,
        "the emergency stop could not be read any more",
        "Check the wire of the panel; without it the emergency stop is not seen.",
    )
    CURRENT_DISAGREES = (
        42,
        0,
        "the drive's current was not the commanded one",
        "Check the drive's scaling and its current limit.",
    )
    FORCE_DISAGREES = (
        45,
        0,
        "motor current and the force sensor at the motor shaft disagreed",
        "Check force sensor and motor coupling, and both calibrations.",
    )
    POWER_SIGN = (
        46,
        0,
        "the motor fed energy into the body, under a law that can only absorb",
        "Check the signs of encoder and force before any power on.",
    )
    POWER_BALANCE = (
        47,
        1,
        "two stations reported powers that no loss between them explains",
        "Check the sensors of both power stations.",
    )
    NO_OPERATOR = (
        48,
        1,
        "manual mode had no operator for longer than `operator.dead_man_s` of the rig file",
        "Take the seat in a new run, and keep the page open and its tab awake.",
    )
    FIELDBUS_LOST = (
        49,
        0,
        "the bus to the drives was lost: a cable, a device without power or out of operation, or "
        "the process that monitors it",
        "The messages name the devices; check their cables and supplies, then `rig devices`.",
    )


STOPS_OF_PEOPLE = (Reason.OPERATOR_STOP, Reason.OPERATOR_ABORT, Reason.NO_OPERATOR)
"""Reasons that are no fault of the rig: people stop it, or leave it alone."""
AXIS_FAULTS = (
    Reason.STALE_ENCODER, Reason.STALE_DRIVE, Reason.DRIVE_FAULT, Reason.DRIVE_DROPPED,
    Reason.POSITION, Reason.VELOCITY, Reason.ENCODER_JUMP, Reason.CURRENT_DISAGREES,
)  # fmt: skip
"""Reasons that `rig.realtime.axis.check` returns without the name of the axis."""


def numbers_of_axis(own: Mapping[Reason, int]) -> tuple[int, ...]:
    """Return the number of an axis's own reason, if it has one, for each number of the core.

    It is indexed by number, so that compiled code can use it, too.
    """
    by_number = {int(reason): int(number) for reason, number in own.items()}
    return tuple(by_number.get(number, number) for number in range(max(Reason) + 1))


NO_REASON = int(Reason.NONE)
PLUG_IN_NUMBER = 100
"""The lowest number of a kind of another distribution."""
MAX_NUMBER = 255


class TripReason(NamedTuple):
    """A reason of a stop."""

    number: int  # in log rows
    name: str
    category: int  # stop category 0 or 1 (`rig.realtime.safety`)
    text: str
    advice: str = ""  # what people should do; empty: nothing


def trip_reason(member: IntEnum, category: int, text: str, advice: str = "") -> TripReason:
    """Return the reason of an enumeration's member."""
    return TripReason(int(member), member.name, category, text, advice)


def reasons_of(numbers: Iterable[StopReason]) -> tuple[TripReason, ...]:
    """Return the reasons of an enumeration."""
    return tuple(trip_reason(each, each.category, each.text, each.advice) for each in numbers)


CORE_REASONS = reasons_of(Reason)


class ReasonTable:
    """The reasons of a kind of rig, or of a recorded run."""

    def __init__(self, reasons: Iterable[TripReason]) -> None:
        self.reasons = tuple(sorted(reasons))
        self._by_number = {reason.number: reason for reason in self.reasons}
        self._by_name = {reason.name: reason for reason in self.reasons}

    @property
    def categories(self) -> tuple[int, ...]:
        """The stop category by number; 0 for a number without a reason."""
        numbers = range(self.reasons[-1].number + 1)
        known = self._by_number
        return tuple(known[n].category if n in known else 0 for n in numbers)

    def __contains__(self, number: int) -> bool:
        return number in self._by_number

    def name(self, number: int) -> str:
        """Return the name of a number; "reason N" for an unknown one."""
        reason = self._by_number.get(int(number))
        return f"reason {int(number)}" if reason is None else reason.name

    def text(self, name: str) -> str:
        """Return the text of a name; an unknown name unchanged."""
        reason = self._by_name.get(name)
        return name if reason is None else reason.text

    def advice(self, number: int) -> str:
        """Return what people should do after a stop; empty for an unknown number, or no advice."""
        reason = self._by_number.get(int(number))
        return "" if reason is None else reason.advice

    def number(self, name: str) -> int | None:
        """Return the number of a name; None for an unknown one."""
        reason = self._by_name.get(name)
        return None if reason is None else reason.number

    def category(self, name: str) -> int | None:
        """Return the stop category of a name; None for an unknown one."""
        reason = self._by_name.get(name)
        return None if reason is None else reason.category

    def as_records(self) -> list[dict[str, Any]]:
        """Return the reasons as JSON values, as in a run's plan."""
        return [reason._asdict() for reason in self.reasons]


@cache
def reason_table(own: tuple[TripReason, ...] = ()) -> ReasonTable:
    """Return the core's reasons and those of a kind.

    Raises ValueError if a number or a name of the kind's is taken, or a number or category is
    outside its range.
    """
    taken = list(CORE_REASONS)
    for reason in own:
        if any(reason.number == each.number or reason.name == each.name for each in taken):
            raise ValueError(f"reason {reason.number} {reason.name}: number or name is taken")
        if not (0 < reason.number <= MAX_NUMBER and reason.category in (0, 1)):
            raise ValueError(
                f"reason {reason.number} {reason.name}, category {reason.category}: allowed "
                f"numbers 1 .. {MAX_NUMBER} and categories 0, 1"
            )
        taken.append(reason)
    return ReasonTable(taken)


def from_records(records: Iterable[Mapping[str, Any]]) -> ReasonTable:
    """Return the table that a run recorded."""
    return ReasonTable(
        TripReason(
            int(each["number"]),
            each["name"],
            int(each["category"]),
            each["text"],
            each.get("advice", ""),
        )
        for each in records
    )
