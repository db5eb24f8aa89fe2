"""The checklist before power on: what the page knows by itself, and what people confirm.

Confirmations are notes in the run's journal, so every browser and a page that starts anew show the
same ones. `rig doctor` runs in a process of its own when the operator wants it.
"""

import json
import math
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig.host.finding import Use
from rig.recording.journal import Entry

BY_HAND = {
    "e_stop": "the emergency stop was tested",
    "people": "nobody is within reach of moving parts",
}
"""The items that people confirm, by key."""

CHECK, CONFIRMED = "check", "confirmed"  # arguments of a note that confirms or withdraws an item
_DOCTOR_S = 120.0  # s until the checks of the host are given up
_MAX_FINDINGS = 5
_VALID_S = {"people": 600.0}  # s until an item must be confirmed again; others last for the run
_ENDS_VALIDITY = ("tare", "take_seat", "leave_seat")  # accepted requests that do so at once
_SILENT_S = 1.0  # s without a row after which its ages say nothing about the devices any more


class Item(NamedTuple):
    """One line of the checklist."""

    key: str
    text: str
    done: bool
    details: tuple[str, ...] = ()
    by: str = ""  # who confirmed it
    utc: str = ""  # when it was confirmed or checked
    by_hand: bool = False


class Conditions(NamedTuple):
    """The present conditions of a run that the checklist shows."""

    late: tuple[str, ...] | None  # values older than their limits; None: no rows yet
    tare_samples: int | None  # averaged for the zeros; None: the rig measures none
    tare_age: float | None  # s since the zeros were measured; None: before this page began
    privileges: Mapping[str, Any]  # as the loop reports them: cause of a refusal, or empty
    silent_s: float = 0.0  # s since the newest row came


def note(key: str, *, confirmed: bool) -> dict[str, Any]:
    """Return the arguments of the note that confirms or withdraws an item; KeyError for none."""
    text = f"checklist: {BY_HAND[key]}{'' if confirmed else ': withdrawn'}"
    return {"text": text, CHECK: key, CONFIRMED: confirmed}


class Checklist:
    """The checklist of one run; its methods may be called from several threads."""

    def __init__(
        self,
        mode: str,
        config: Mapping[str, Any],
        runs: Path,
        loop_core: int | None = None,
        clock: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        """``mode``: name of the execution mode; ``runs``: folder of runs.

        ``loop_core``: that the checks of the host judge; None: as a new process finds it.
        """
        self._clock, self._core = clock, loop_core
        self._use = Use.REALTIME if mode == "hardware" else Use.REHEARSAL
        self._calibrations = list(calibrations(config))
        self._runs = runs
        self._confirmed: dict[str, tuple[str, str]] = {}  # by whom and when
        self._lock = threading.Lock()
        self._running = self._closed = False
        self._doctor: subprocess.Popen[bytes] | None = None
        self._stopped = ""  # why the checks were stopped
        self._host = Item("host", "checks of this host (`rig doctor`): not run yet", False)

    @property
    def checking(self) -> bool:
        """Whether `rig doctor` runs."""
        return self._running

    def stop_checks(self, why: str) -> None:
        """Kill `rig doctor` if it runs."""
        with self._lock:
            if self._running:
                self._stopped = why
            if self._doctor is not None:
                self._doctor.kill()

    def close(self) -> None:
        """Kill `rig doctor` if it runs, and start it no more."""
        self._closed = True
        self.stop_checks("the page ends")

    def take(self, entries: Iterable[Entry]) -> None:
        """Take the confirmations in entries of the journal.

        A new tare or operator ends those that do not last: the people near the rig may be others.
        """
        for entry in entries:
            if entry.accepted and entry.request in _ENDS_VALIDITY:
                for item in _VALID_S:
                    self._confirmed.pop(item, None)
            key = entry.arguments.get(CHECK)
            if entry.request != "annotate" or not entry.accepted:
                continue
            if not isinstance(key, str) or key not in BY_HAND:  # anybody may annotate anything
                continue
            self._confirmed.pop(key, None)
            if entry.arguments.get(CONFIRMED) is True:
                self._confirmed[key] = entry.person, entry.utc

    def items(self, present: Conditions) -> list[Item]:
        """Return all items."""
        return [
            self._host,
            self._privileges(present.privileges),
            _devices(present),
            Item(
                "calibrations",
                f"calibrations in use: {len(self._calibrations) or 'none, only the rig file'}",
                True,
                tuple(self._calibrations),
            ),
            _tare(present),
            *(self._by_hand(key, text) for key, text in BY_HAND.items()),
        ]

    def _by_hand(self, key: str, text: str) -> Item:
        person, utc = self._confirmed.get(key, ("", ""))
        done, valid_s = key in self._confirmed, _VALID_S.get(key)
        if done and valid_s is not None and not 0.0 <= self._age(utc) <= valid_s:
            details = (f"confirmed more than {valid_s / 60:g} min ago: look again",)
            return Item(key, text, False, details, person, utc, True)
        return Item(key, text, done, (), person, utc, True)

    def _age(self, utc: str) -> float:
        """Return s since a time of the journal; infinity for a text that is none."""
        try:
            return (self._clock() - datetime.fromisoformat(utc)).total_seconds()
        except (ValueError, TypeError):  # TypeError: without a time zone
            return math.inf

    def check_host(self, person: str) -> str:
        """Run `rig doctor` beside the run and wait for it; return why not, or empty text.

        It inherits the page's priority and cores, which leave the loop alone.
        """
        with self._lock:
            if self._running or self._closed:
                return "the checks run already" if self._running else "the page ends"
            self._running, self._stopped = True, ""
        self._host = Item("host", "checks of this host (`rig doctor`): running", False)
        command = [sys.executable, "-m", "rig", "doctor", "--during-run", "--json"]
        if self._core is not None:  # doctor inherits the cores of the page, without this one
            command += ["--core", str(self._core)]
        try:
            found = json.loads(self._run([*command, "--runs", str(self._runs)]))
            self._host = self._verdict(found, person)
        except (OSError, ValueError, KeyError, TypeError, subprocess.TimeoutExpired) as error:
            text = f"checks of this host failed: {type(error).__name__}"
            self._host = Item("host", text, False, (str(error)[:200],))
        finally:
            with self._lock:
                self._running, stopped = False, self._stopped
        if stopped:
            self._host = Item("host", f"checks of this host were stopped: {stopped}", False)
        return stopped

    def _run(self, command: list[str]) -> bytes:
        """Return the output of a command, which `stop_checks` may kill."""
        with self._lock:
            if self._stopped:
                return b""
            self._doctor = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        try:
            return self._doctor.communicate(timeout=_DOCTOR_S)[0]
        finally:
            with self._lock:
                self._doctor.kill()
                self._doctor.communicate()
                self._doctor = None

    def _verdict(self, examination: Mapping[str, Any], person: str) -> Item:
        findings = [each for each in examination["findings"] if each["verdict"] == "bad"]
        details = [f"{each['check']}: {each['value']}. {each['advice']}" for each in findings]
        if len(details) > _MAX_FINDINGS:
            details[_MAX_FINDINGS:] = [f"and {len(details) - _MAX_FINDINGS} more: `rig doctor`"]
        fit = examination["fit"][str(self._use)] is True
        text = f"this host is {'' if fit else 'not '}fit for a {self._use}".replace(
            "a real", "real"
        )
        utc = datetime.now(UTC).isoformat(timespec="seconds")
        return Item("host", text, fit, tuple(details), person, utc)

    def _privileges(self, granted: Mapping[str, Any]) -> Item:
        if self._use is not Use.REALTIME:
            return Item("loop", "the loop needs no real-time privileges in this mode", True)
        refused = tuple(f"{key.replace('_', ' ')}: {why}" for key, why in granted.items() if why)
        if not granted:
            return Item("loop", "the loop has not reported its privileges", False)
        text = "the host refused privileges of the loop" if refused else "the loop has real time"
        return Item("loop", text, not refused, refused)


def calibrations(config: Mapping[str, Any]) -> Iterable[str]:
    """Yield file and date of each calibration that a run recorded as its input."""
    files = config.get("files")
    rig = config.get("rig")
    valid = {
        key.replace("_", " "): value["valid"]
        for key, value in (rig if isinstance(rig, dict) else {}).items()
        if isinstance(value, dict) and {"valid", "correction"} <= value.keys()
    }
    for each in files if isinstance(files, list) else ():
        role = each.get("role") if isinstance(each, dict) else None
        if role == "calibration" or role in valid:
            yield f"{each.get('path')}, {each.get('date') or _validity(valid.get(role))}"


def _validity(valid: Any) -> str:
    """Return the validity of a calibration, which has no date, as text."""
    with suppress(KeyError, TypeError, AttributeError):
        kind, span = next((key, each) for key, each in valid.items() if each)
        ends = (f"{key} {value}" for key, value in span.items() if value is not None)
        return f"valid for {kind} {' '.join(ends)}"
    return "without a date"


def _devices(present: Conditions) -> Item:
    late = present.late
    if late is None:
        return Item("devices", "no rows of the run yet", False)
    if present.silent_s > _SILENT_S:
        text = f"no rows of the run for {present.silent_s:.0f} s: devices are unknown"
        return Item("devices", text, False)
    if late:
        return Item("devices", f"{len(late)} devices do not answer in time", False, late)
    return Item("devices", "all devices answer: no value is older than its limit", True)


def _tare(present: Conditions) -> Item:
    if present.tare_samples is None:
        return Item("tare", "this rig measures no sensor zeros", True)
    if present.tare_samples <= 0:
        return Item("tare", "the sensor zeros are not measured", False)
    age = "before this page began"
    if present.tare_age is not None:
        minutes, seconds = divmod(int(present.tare_age), 60)
        age = f"{minutes} min {seconds:02d} s ago"
    return Item("tare", f"sensor zeros: {present.tare_samples} samples, {age}", True)
