"""Predicted use of a limit."""

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

from rig.config.yaml_source import KeyPath

Role = Literal["limits", "rig", "plant", "campaign"]
"""The file that defines a limit; "campaign" for the stability of the row's own gains."""

Effect = Literal["stop", "cut", "warn", "unstable"]
"""Effect beyond a limit: the rig trips, it cuts force, it warns, or the motion grows."""

NEAR = 0.9  # share of a stop limit that counts as near: the motion overshoots after a change of row


class Limit(NamedTuple):
    """One limit and the key that defines it."""

    name: str  # as in the table of `rig check`
    field: str  # of the predicted value
    role: Role
    key: KeyPath
    effect: Effect
    unit: str
    quantity: str  # predicted quantity
    is_lower_bound: bool = False

    @property
    def of_own_gains(self) -> bool:
        """True for the stability of the loop: the row's own gains are the limit."""
        return self.role == "campaign"


class Margin(NamedTuple):
    """A predicted value and its limit."""

    limit: Limit
    predicted: float
    allowed: float
    at_rest: float = 0.0  # value without waves

    @property
    def used(self) -> float:
        """Used share of the limit, counted from the value at rest; above 1 it is exceeded."""
        if self.limit.is_lower_bound and self.at_rest == 0.0:
            return self.allowed / self.predicted if self.predicted > 0.0 else math.inf
        span = self.allowed - self.at_rest
        if (span > 0.0) == self.limit.is_lower_bound or not math.isfinite(self.predicted):
            return math.inf  # limit exceeded at rest, or not a number
        return (self.predicted - self.at_rest) / span

    @property
    def exceeded(self) -> bool:
        """True beyond the limit and for a prediction that is not a number."""
        return not self.used <= 1.0

    @property
    def blocks(self) -> bool:
        """True for an exceeded limit that refuses a row: the rig would trip or be unstable."""
        return self.exceeded and self.limit.effect in ("stop", "unstable")

    @property
    def warns(self) -> bool:
        """True for a limit that gives a warning: force is cut, it warns, or a stop is near."""
        if self.exceeded:
            return self.limit.effect in ("cut", "warn")
        return (self.limit.effect == "stop" or self.limit.of_own_gains) and self.used >= NEAR


def tightest(margins: Iterable[Margin]) -> Margin:
    """Return the limit with the highest use, warning limits excluded."""
    return max((m for m in margins if m.limit.effect != "warn"), key=lambda m: m.used)
