"""Reasons of a stop, each with a stable number, a stop category and a text.

The core knows the reasons of loop, people, drives, axes, panel and power stations; a kind of rig
adds its own (`rig.realtime.cycle.Kind`). A log row holds the number, and a run records the table.
Numbers below 100 belong to this distribution; a kind of another one uses 100 to 255.
"""

from collections.abc import Iterable, Mapping
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple


class Reason(IntEnum):
    """Reasons of every kind of rig."""

    NONE = 0
    PLAN_END = 1
    OPERATOR_STOP = 2
    OPERATOR_ABORT = 3
    SUPERVISOR_LOST = 4
    LOGGER_LOST = 5
    NOT_FINITE = 6
    STALE_ENCODER = 7
    STALE_DRIVE = 8
    LOST_TICKS = 12
    DRIVE_FAULT = 13
    DRIVE_DROPPED = 14
    DRIVE_NOT_ON = 15
    POSITION = 16
    VELOCITY = 17
    NOT_CALM = 21
    EXCEPTION = 22
    ENCODER_JUMP = 23
    EMERGENCY_STOP = 34
    LIMIT_SWITCH = 35
    STALE_PANEL = 36
    CURRENT_DISAGREES = 42
    FORCE_DISAGREES = 45
    POWER_SIGN = 46
    POWER_BALANCE = 47


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


def trip_reason(member: IntEnum, category: int, text: str) -> TripReason:
    """Return the reason of an enumeration's member.

    A controlled stop (category 1) is impossible after a fault in something that the damping itself
    needs: encoder, drive, arithmetic, time.
    """
    return TripReason(int(member), member.name, category, text)


CORE_REASONS = (
    trip_reason(Reason.NONE, 1, "no reason recorded"),
    trip_reason(Reason.PLAN_END, 1, "the plan ran to its end"),
    trip_reason(Reason.OPERATOR_STOP, 1, "the operator stopped the run"),
    trip_reason(Reason.OPERATOR_ABORT, 0, "the operator aborted the run (power off at once)"),
    trip_reason(
        Reason.SUPERVISOR_LOST,
        1,
        "`rig run` stopped sending its heartbeat: killed, suspended, or delayed by a busy host",
    ),
    trip_reason(
        Reason.LOGGER_LOST,
        1,
        "the record could not be written: logger, disk or folder was lost",
    ),
    trip_reason(Reason.NOT_FINITE, 0, "a value was NaN or infinite"),
    trip_reason(Reason.STALE_ENCODER, 0, "the encoder's value was too old"),
    trip_reason(Reason.STALE_DRIVE, 0, "the drive's values were too old"),
    trip_reason(Reason.LOST_TICKS, 0, "too many ticks were lost in one gap"),
    trip_reason(Reason.DRIVE_FAULT, 0, "the drive reported a fault"),
    trip_reason(Reason.DRIVE_DROPPED, 0, "the drive switched its power off by itself"),
    trip_reason(Reason.DRIVE_NOT_ON, 0, "the drive did not come up in time"),
    trip_reason(Reason.POSITION, 1, "the position limit was reached"),
    trip_reason(Reason.VELOCITY, 1, "the velocity limit was reached"),
    trip_reason(Reason.NOT_CALM, 1, "the body moved during the tare"),
    trip_reason(Reason.EXCEPTION, 0, "the loop's own code failed"),
    trip_reason(Reason.ENCODER_JUMP, 0, "the encoder jumped: it slipped or lost counts"),
    trip_reason(Reason.EMERGENCY_STOP, 0, "the emergency stop was pressed"),
    trip_reason(Reason.LIMIT_SWITCH, 1, "a limit switch was hit"),
    trip_reason(Reason.STALE_PANEL, 1, "the emergency stop could not be read any more"),
    trip_reason(Reason.CURRENT_DISAGREES, 0, "the drive's current was not the commanded one"),
    trip_reason(
        Reason.FORCE_DISAGREES,
        0,
        "motor current and the force sensor at the motor shaft disagreed",
    ),
    trip_reason(
        Reason.POWER_SIGN,
        0,
        "the motor fed energy into the body, under a law that can only absorb",
    ),
    trip_reason(
        Reason.POWER_BALANCE,
        1,
        "two stations reported powers that no loss between them explains",
    ),
)


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

    def number(self, name: str) -> int | None:
        """Return the number of a name; None for an unknown one."""
        reason = self._by_name.get(name)
        return None if reason is None else reason.number

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
        TripReason(int(each["number"]), each["name"], int(each["category"]), each["text"])
        for each in records
    )
