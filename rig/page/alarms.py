"""Alarms of a run: what happened, why, and what to do; the first cause stays on top."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from rig.realtime.reasons import NO_REASON, Reason, ReasonTable
from rig.recording.journal import Entry

MAX_ALARMS = 200
HIGH, LOW = "high", "low"

_ADVICE: dict[int, str] = {
    Reason.PLAN_END: "Nothing to do: the results follow.",
    Reason.OPERATOR_STOP: "A new run continues; rows measured so far are kept.",
    Reason.OPERATOR_ABORT: "Check that the body is at rest before a new run.",
    Reason.SUPERVISOR_LOST: "Look at the terminal of the run; `rig recover` finishes the record.",
    Reason.LOGGER_LOST: "Check the disk and the folder of runs; `rig recover` finishes the record.",
    Reason.NOT_FINITE: "Look in the last second of the log for the first value that is no number.",
    Reason.STALE_ENCODER: "Check cable and supply of the encoder, then `rig devices`.",
    Reason.STALE_DRIVE: "Check cable and supply of the drive, then `rig devices`.",
    Reason.LOST_TICKS: "Run `rig doctor`: another program or the host delayed the loop.",
    Reason.DRIVE_FAULT: "Read the fault code at the drive, remove the cause, reset the drive.",
    Reason.DRIVE_DROPPED: "Check supply and enable chain of the drive.",
    Reason.DRIVE_NOT_ON: "Check supply, enable chain and fault code of the drive.",
    Reason.POSITION: "Check the set point and the sea; move the body back before a new run.",
    Reason.VELOCITY: "Check the set point and the sea.",
    Reason.NOT_CALM: "Wait for calm water, then start the run over.",
    Reason.EXCEPTION: "Keep the run's folder and report the fault with `loop.stderr`.",
    Reason.ENCODER_JUMP: "Check coupling and cable of the encoder.",
    Reason.EMERGENCY_STOP: "Find out who pressed it and why; release it; start a new run.",
    Reason.LIMIT_SWITCH: "Move the body off the switch with the power off.",
    Reason.STALE_PANEL: "Check the wire of the panel; without it the emergency stop is not seen.",
    Reason.CURRENT_DISAGREES: "Check the drive's scaling and its current limit.",
    Reason.FORCE_DISAGREES: "Check force sensor and motor coupling, and both calibrations.",
    Reason.POWER_SIGN: "Check the signs of encoder and force before any power on.",
    Reason.POWER_BALANCE: "Check the sensors of both power stations.",
    Reason.NO_OPERATOR: "Take the seat in a new run, and keep the page open and its tab awake.",
    Reason.FIELDBUS_LOST: "The messages name the devices; check their cables and supplies, then "
    "`rig devices`.",
}
_OF_CATEGORY = (
    "Power was removed at once. Find the cause before a new run.",
    "The body was brought to rest, then power was removed. Find the cause before a new run.",
)
_NORMAL = (Reason.PLAN_END, Reason.OPERATOR_STOP)


class Alarm(NamedTuple):
    """One alarm; equal ones are counted, not listed twice."""

    key: str
    time: float  # s of the run, when it came first
    priority: str
    cause: str
    action: str
    times: int = 1


class Alarms:
    """The alarms of a run in the order of time."""

    def __init__(self, reasons: ReasonTable) -> None:
        self._reasons = reasons
        self._alarms: dict[str, Alarm] = {}
        self._acknowledged: dict[str, str] = {}  # by whom

    def raise_alarm(self, key: str, time: float, priority: str, cause: str, action: str) -> None:
        """Add an alarm, or count one that is there already."""
        known = self._alarms.get(key)
        if known is not None:
            self._alarms[key] = known._replace(times=known.times + 1)
        elif len(self._alarms) < MAX_ALARMS:
            self._alarms[key] = Alarm(key, time, priority, cause, action)

    def stopped(self, time: float, number: int) -> None:
        """Add the alarm of a stop by the number of its reason."""
        if number == NO_REASON or number not in self._reasons or number in _NORMAL:
            return
        name = self._reasons.name(number)
        advice = _ADVICE.get(number) or _OF_CATEGORY[self._reasons.categories[number]]
        self.raise_alarm(name, time, HIGH, self._reasons.text(name), advice)

    def acknowledge(self, entries: Iterable[Entry]) -> None:
        """Take the acknowledgements in entries of the journal."""
        for entry in entries:
            if entry.request == "acknowledge" and entry.accepted:
                self._acknowledged.setdefault(str(entry.arguments.get("alarm")), entry.person)

    def listed(self) -> list[dict[str, Any]]:
        """Return the alarms, the first one of high priority on top."""
        ordered = sorted(self._alarms.values(), key=lambda each: (each.priority != HIGH, each.time))
        return [
            each._asdict() | {"acknowledged": self._acknowledged.get(each.key, "")}
            for each in ordered
        ]
