"""Findings of the checks, and access to the kernel's files of a host."""

import os
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

from rig.wires.wire_check import file_owner


class Verdict(StrEnum):
    """Result of comparing a value with its limit."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"
    UNKNOWN = "not measurable"
    NOTE = "for information"  # has no limit


class Use(StrEnum):
    """Use of a host."""

    REHEARSAL = "rehearsal"
    REALTIME = "real time on a rig"


class Finding(NamedTuple):
    """The result of one check."""

    area: str
    check: str  # name of the check
    value: str
    limit: str  # with its reason
    verdict: Verdict
    advice: str = ""  # what to do; empty if nothing
    forbids: tuple[Use, ...] = ()  # uses that the host is not fit for because of this finding
    numbers: dict[str, Any] = {}  # the value for programs  # noqa: RUF012

    @property
    def cause(self) -> str:
        """The finding as a reason in the verdict of the examination."""
        return f"{self.check}: {self.value}"


REALTIME = (Use.REALTIME,)
ALL_USES = (Use.REHEARSAL, Use.REALTIME)


def grade(value: float, good: float, bad: float) -> Verdict:
    """Return the verdict on a value where less is better: good to ``good``, bad above ``bad``."""
    if value <= good:
        return Verdict.GOOD
    return Verdict.BAD if value > bad else Verdict.WARNING


class Check(NamedTuple):
    """A value of the host that has a limit."""

    area: str
    name: str
    limit: str  # with its reason
    forbids: tuple[Use, ...] = ()  # uses that a bad value forbids

    def finding(
        self, value: str, verdict: Verdict = Verdict.GOOD, advice: str = "", /, **numbers: Any
    ) -> Finding:
        """Return the finding for a value; the advice is left out if it is good."""
        advice = "" if verdict is Verdict.GOOD else advice
        forbids = self.forbids if verdict is Verdict.BAD else ()
        return Finding(self.area, self.name, value, self.limit, verdict, advice, forbids, numbers)

    def unknown(self, value: str = "cannot be read") -> Finding:
        """Return the finding for a value that the host does not show."""
        return self.finding(value, Verdict.UNKNOWN)


class Host:
    """Files of the kernel under a root folder.

    A missing or unreadable file reads as None and never raises. Another root represents another
    machine.
    """

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def read_text(self, path: str) -> str | None:
        """Return a file's text without outer white space."""
        try:
            return self._at(path).read_bytes().decode(errors="replace").strip()
        except OSError:
            return None

    def read_int(self, path: str) -> int | None:
        """Return the integer that a file holds."""
        try:
            return int(self.read_text(path) or "")
        except ValueError:
            return None

    def exists(self, path: str) -> bool:
        """Return whether a file or folder exists."""
        try:
            return self._at(path).exists()
        except OSError:
            return False

    def list_names(self, path: str) -> list[str]:
        """Return the sorted names in a folder."""
        try:
            return sorted(entry.name for entry in self._at(path).iterdir())
        except OSError:
            return []

    def is_accessible(self, path: str) -> bool:
        """Return whether this process may read and write a file."""
        return os.access(self._at(path), os.R_OK | os.W_OK)

    def owner(self, path: str) -> str:
        """Return user, group and permissions of a file; empty if it does not exist."""
        try:
            return file_owner(self._at(path))
        except OSError:
            return ""

    def _at(self, path: str) -> Path:
        return self.root / path.lstrip("/")
