"""The requests of people and the supervisor to the loop, logged in every row for a replay.

A request is a level, not an event: it is in force until another one replaces it. An order that must
be carried out once has a number.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from controllers.signals import Count, Flag, Index


class Request(NamedTuple):
    """The requests in force in a tick."""

    code: Index  # rig.realtime.safety.REQUEST_*
    armed: Flag  # 1: the power may be switched on, where the plan waits for it
    live: Count  # number of the set point that people chose; 0: the plan's own
    jump: Count  # number of the last order to go on with another segment
    segment: Index  # that segment


NO_REQUEST = Request(0, 0, 0, 0, 0)


class RequestSource(Protocol):
    """The source of the requests of people and of the supervisor."""

    def read(self) -> Request:
        """Return the requests in force."""

    def live_numbers(self, number: int) -> Sequence[float] | None:
        """Return the numbers of the set point with a number; None if it is not there (yet)."""
