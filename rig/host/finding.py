"""What a check finds, and the host as it shows itself in files."""

import os
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

from rig.execution.hardware.wire_check import owner


class Verdict(StrEnum):
    """How a value stands to its limit."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"
    UNKNOWN = "not measurable"
    NOTE = "for information"  # nothing is asked of it


class Use(StrEnum):
    """What a host may be fit for."""

    REHEARSAL = "rehearsal"
    REALTIME = "real time on a rig"


class Finding(NamedTuple):
    """One thing that was looked at."""

    area: str
    what: str  # was looked at
    value: str
    limit: str  # and its reason
    verdict: Verdict
    advice: str = ""  # what to do, in plain words; empty if nothing
    forbids: tuple[Use, ...] = ()  # what the host is not fit for because of this
    numbers: dict[str, Any] = {}  # the value for a program  # noqa: RUF012

    @property
    def cause(self) -> str:
        """The finding as a reason, for the final sentence."""
        return f"{self.what}: {self.value}"


REALTIME = (Use.REALTIME,)
BOTH = (Use.REHEARSAL, Use.REALTIME)


def graded(value: float, good: float, bad: float) -> Verdict:
    """Verdict on a value of which less is better: good up to ``good``, bad above ``bad``."""
    if value <= good:
        return Verdict.GOOD
    return Verdict.BAD if value > bad else Verdict.WARNING


def forbidding(verdict: Verdict, *uses: Use) -> tuple[Use, ...]:
    """What a verdict forbids: nothing unless it is bad."""
    return uses if verdict is Verdict.BAD else ()


class Host:
    """Files of the kernel under a root; whatever is missing or unreadable is None, never an error.

    Another root stands in for another machine.
    """

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def text(self, path: str) -> str | None:
        """A file's text without outer blanks."""
        try:
            return self._at(path).read_bytes().decode(errors="replace").strip()
        except OSError:
            return None

    def number(self, path: str) -> int | None:
        """A file that holds one whole number."""
        try:
            return int(self.text(path) or "")
        except ValueError:
            return None

    def there(self, path: str) -> bool:
        """Whether there is such a file or folder."""
        try:
            return self._at(path).exists()
        except OSError:
            return False

    def names(self, path: str) -> list[str]:
        """Names in a folder."""
        try:
            return sorted(entry.name for entry in self._at(path).iterdir())
        except OSError:
            return []

    def usable(self, path: str) -> bool:
        """Whether this process may read and write a file."""
        return os.access(self._at(path), os.R_OK | os.W_OK)

    def owner(self, path: str) -> str:
        """User, group and rights of a file; empty if it is not there."""
        try:
            return owner(self._at(path))
        except OSError:
            return ""

    def _at(self, path: str) -> Path:
        return self.root / path.lstrip("/")
