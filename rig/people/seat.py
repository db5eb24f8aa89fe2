"""The operator's seat: one session at a time may act; the others look.

The seat is a lease that the session renews by beats. A lease that is not renewed ends: its operator
is gone. Taking over from a present operator is an act of its own.
"""

from typing import NamedTuple

LEASE_S = 3.0  # s from beat to beat, at most
BEAT_S = 1.0  # s from beat to beat, as it should be


class Holder(NamedTuple):
    """The session in the seat."""

    session: str  # of the page, or of the command
    person: str


class Seat:
    """The seat of a run; ``now`` of its methods is in s on one monotonic clock."""

    def __init__(self) -> None:
        self._holder: Holder | None = None
        self._renewed = 0.0
        self.changes = 0  # of the operator: seated, left or lost
        self.vacated: float | None = None  # when the last operator left or was lost; None: seated

    def holder(self, now: float) -> Holder | None:
        """Return who sits in the seat; None if nobody does."""
        if self._holder is not None and now - self._renewed > LEASE_S:
            self._vacate(self._renewed + LEASE_S)
        return self._holder

    def take(self, session: str, person: str, now: float, *, take_over: bool) -> str:
        """Seat a session; return why it was refused, or an empty text."""
        present = self.holder(now)
        if present is not None and present.session != session and not take_over:
            return f"{present.person} is the operator; take over to act instead"
        self.changes += self._holder != (session, person)
        self._holder, self._renewed, self.vacated = Holder(session, person), now, None
        return ""

    def renew(self, session: str, now: float) -> bool:
        """Renew the lease of a session; return False if it does not have the seat."""
        present = self.holder(now)
        if present is None or present.session != session:
            return False
        self._renewed = now
        return True

    def leave(self, session: str, now: float) -> None:
        """Give up the seat, if the session has it."""
        present = self.holder(now)
        if present is not None and present.session == session:
            self._vacate(now)

    def _vacate(self, at: float) -> None:
        self._holder, self.vacated = None, at
        self.changes += 1
