"""What the rig files of all kinds have in common."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from rig.config.model import FileModel, Reason, RuleViolation, WholeNumber, rule_error
from rig.config.problems import format_number
from rig.config.wiring import Wiring

SupervisorTimeout = Annotated[float, Field(ge=0.3, le=30)]
"""Time without a heartbeat of `rig run` after which the loop stops the rig (category 1), s.

The heartbeat has a period of 0.1 s; the minimum tolerates a lost heartbeat on a busy host."""

SUPERVISOR_TIMEOUT: SupervisorTimeout = 1.0

_SECOND = 10**9  # ns
MAX_RATE = 2000  # Hz


def whole_nanoseconds(min_rate: int) -> AfterValidator:
    """Return a validator for rates whose tick is a whole number of ns."""

    def check_rate(rate: int) -> int:
        if _SECOND % rate:
            allowed = (str(r) for r in range(min_rate, MAX_RATE + 1) if _SECOND % r == 0)
            raise rule_error(
                f"{rate} gives a tick that is not a whole number of ns; "
                f"allowed {', '.join(allowed)} Hz"
            )
        return rate

    return AfterValidator(check_rate)


Rate = Annotated[
    WholeNumber,
    Field(ge=200, le=MAX_RATE),
    Reason("a tick is at most 5 ms and a whole number of ns"),
    whole_nanoseconds(200),
]
"""Rate of the loop, Hz."""


class StopTiming(FileModel):
    """Duration of a controlled stop, and its transition to pure damping."""

    duration_s: float = Field(ge=0.1, le=60)
    ramp_s: float = Field(ge=0, le=2)  # from the demand of the run to pure damping

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that at least half of a stop is pure damping."""
        if self.ramp_s > 0.5 * self.duration_s:
            yield self.violation(
                "ramp_s",
                f"{format_number(self.ramp_s)} leaves too little of the stop to pure damping; "
                f"allowed up to half of duration_s = {format_number(self.duration_s)} s",
            )


class BaseRigFile(FileModel):
    """A rig: its kind, its loop and the files of its limits and its simulated plant.

    The model of a kind narrows `kind`, `rate_hz` and `wiring`.
    """

    name: str = Field(min_length=1, max_length=64)
    kind: str
    rate_hz: int
    realtime: Literal["best effort", "required"]
    limits: str = Field(min_length=1)  # file, relative to this one
    plant: str = Field(min_length=1)  # file, relative to this one; simulates the hardware
    drive_enable_timeout_s: float = Field(ge=0.1, le=60)
    supervisor_timeout_s: SupervisorTimeout = SUPERVISOR_TIMEOUT
    wiring: Wiring | None = None  # None: the rig can only be rehearsed
