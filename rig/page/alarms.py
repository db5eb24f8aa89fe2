"""Alarms of a run: what happened, why, and what to do; the first cause stays on top."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from rig.realtime.reasons import NO_REASON, Reason, ReasonTable
from rig.recording.journal import Entry

MAX_ALARMS = 200
HIGH, LOW = "high", "low"

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
        advice = self._reasons.advice(number) or _OF_CATEGORY[self._reasons.categories[number]]
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
