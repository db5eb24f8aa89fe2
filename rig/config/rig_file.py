"""Models that the rig files of all kinds share."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer

from rig.config.model import FileModel, Reason, RuleViolation, WholeNumber, rule_error
from rig.config.problems import Problem, display_path, format_number
from rig.config.uncertainty import UncertaintyBudget
from rig.config.wiring import Wiring
from rig.config.yaml_source import KeyPath, SourceMap


class Motor(FileModel):
    """Motor, encoder resolution and gain ramp of a powered axis, which translates or rotates."""

    torque_constant_n_m_per_a: float = Field(ge=0.01, le=100)  # of the motor
    counts_per_revolution: WholeNumber = Field(ge=100, le=100_000_000)  # of the encoder
    encoder_noise_counts: float = Field(ge=0, le=1000)  # standard deviation, without quantisation
    gain_ramp_s: float = Field(ge=0, le=10)  # duration of a change of gains


class Axis(Motor):
    """Drive, encoder and estimator of an axis that translates."""

    gear_ratio_rad_per_m: float = Field(ge=0.1, le=1000)
    """Angle of the motor per travel of the axis."""
    jerk_density_m2_per_s5: float = Field(ge=1e-4, le=1e6)  # process noise of the estimator


class RotaryAxis(Motor):
    """Drive, encoder and estimator of an axis that rotates."""

    gear_ratio: float = Field(ge=0.1, le=1000)  # rad of the motor per rad of the axis
    jerk_density_rad2_per_s5: float = Field(ge=1e-4, le=1e6)  # process noise of the estimator


SupervisorTimeout = Annotated[float, Field(ge=0.3, le=30)]
"""Time without a heartbeat of `rig run` after which the loop stops the rig (category 1), s.

The heartbeat has a period of 0.1 s; the minimum tolerates a lost heartbeat on a busy host."""

SUPERVISOR_TIMEOUT: SupervisorTimeout = 1.0

_SECOND = 10**9  # ns
MAX_RATE = 5000  # Hz


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

    duration_s: float = Field(ge=0.1, le=60)  # of the damping before power is removed
    ramp_s: float = Field(ge=0, le=2)  # from the demand of the run to pure damping

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that at least half of a stop is pure damping."""
        if self.ramp_s > 0.5 * self.duration_s:
            yield self.violation(
                "ramp_s",
                f"{format_number(self.ramp_s)} leaves too little of the stop to pure damping; "
                f"allowed up to half of duration_s = {format_number(self.duration_s)} s",
            )


def _none_is_no_limit(value: Any) -> Any:
    return None if value == "none" else value


DeadManTime = Annotated[
    Annotated[float, Field(ge=0.5, le=3600)] | None,
    BeforeValidator(_none_is_no_limit),
    PlainSerializer(lambda value: "none" if value is None else value),
]


class Operator(FileModel):
    """The requirements on the operator of a run."""

    dead_man_s: DeadManTime = 5.0
    """Time in manual mode without an operator after which the rig stops, s; it damps at once.

    `none`: manual mode goes on without an operator."""
    stop_by_viewers: bool = True  # whoever sees the page may stop the rig
    rehearsal: Literal["optional", "required"] = "optional"
    """Whether a campaign runs on the rig's wires only if the runs have a certificate of it."""


class BaseRigFile(FileModel):
    """A rig: its kind, its loop and the files of its limits and its simulated plant.

    The model of a kind narrows `kind`, `rate_hz` and `wiring`.
    """

    inline: ClassVar[tuple[str, ...]] = ("wiring.ethercat.line.*.device",)

    name: str = Field(min_length=1, max_length=64)  # for people, in reports
    kind: str
    rate_hz: int
    realtime: Literal["best effort", "required"]  # whether a run needs the privileges of real time
    limits: str = Field(min_length=1)  # file, relative to this one
    plant: str = Field(min_length=1)  # file, relative to this one; simulates the hardware
    drive_enable_timeout_s: float = Field(ge=0.1, le=60)  # time in which the drives must be ready
    supervisor_timeout_s: SupervisorTimeout = SUPERVISOR_TIMEOUT
    wiring: Wiring | None = None  # None: the rig can only be rehearsed
    operator: Operator = Operator()

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that drives and bus fit the rate of the loop."""
        if self.wiring is not None:
            for key, message, value in self.wiring.rate_rules(self.rate_hz):
                yield RuleViolation(("wiring", *key), message, value)


class PowerRigFile(BaseRigFile):
    """A rig with power stations."""

    inline: ClassVar[tuple[str, ...]] = (*BaseRigFile.inline, "uncertainty")

    uncertainty: UncertaintyBudget | None = None  # of the power stations; or the name of a file


_RELATIVE_TOLERANCE = 1e-6


def mismatches(
    rig: Any,
    locate_rig: SourceMap,
    plant: Any,
    locate_plant: SourceMap,
    keys: Mapping[KeyPath, KeyPath],
    title: str,
) -> Iterator[Problem]:
    """Yield a problem of each number of a rig that its plant has otherwise.

    ``keys``: of the number in the rig's model or mapping, and in the plant's; ``title``: of the
    plant, for people.
    """
    for rig_key, plant_key in keys.items():
        rig_value, plant_value = _number_at(rig, rig_key), _number_at(plant, plant_key)
        if abs(rig_value - plant_value) > _RELATIVE_TOLERANCE * abs(plant_value):
            place = locate_plant(plant_key)
            yield locate_rig.problem(
                rig_key,
                rig_value,
                f"{format_number(rig_value)} is not the {title}'s {format_number(plant_value)} "
                f"({display_path(place.path)}:{place.line}); the two must agree",
            )


def _number_at(parts: Any, key: KeyPath) -> float:
    for name in key:
        parts = parts[name] if isinstance(parts, dict) else getattr(parts, str(name))
    return float(parts)
