"""The rig file of an OSWEC bench: its components and their scales.

Velocities, torques and constants refer to the gearbox output.
"""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from rig.config.model import FileModel, Reason, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number
from rig.config.rig_file import MAX_RATE, BaseRigFile, StopTiming, whole_nanoseconds
from rig.kinds.oswec_bench.config.wiring import BenchWiring, max_counts

BenchRate = Annotated[
    WholeNumber,
    Field(ge=500, le=MAX_RATE),
    Reason("a bench's tick is at most 2 ms and a whole number of ns"),
    whole_nanoseconds(500),
]
"""Rate of a bench's loop, Hz; its driveline is stiffer than a body in water."""


class Encoder(FileModel):
    """An encoder and its estimator."""

    counts_per_revolution: WholeNumber = Field(ge=100, le=100_000_000)  # of the encoder
    noise_counts: float = Field(ge=0, le=1000)  # standard deviation, without quantisation
    jerk_density_rad2_per_s5: float = Field(ge=1e-6, le=1e9)  # process noise of the estimator


class Servo(FileModel):
    """Servo drive, motor and gearbox."""

    gear_ratio: float = Field(ge=1, le=1000)  # motor turns per output turn
    torque_constant_n_m_per_a: float = Field(ge=0.1, le=1000)  # nominal
    velocity_constant_rad_per_s_per_v: float = Field(ge=0.01, le=100)  # nominal
    command_v: float = Field(gt=0, le=10)  # maximum velocity command, for both signs
    encoder: Encoder


class BrakePoint(FileModel):
    """One point of the brake's curve, the mean of its two branches."""

    current_a: float = Field(ge=0, le=20)  # of the brake
    torque_n_m: float = Field(ge=0, le=1000)  # of the brake there


class Brake(FileModel):
    """The particle brake and its amplifier."""

    map: TupleOf[BrakePoint] = Field(min_length=2, strict=False)
    slew_a_per_s: float = Field(gt=0, le=1e5)  # greatest change of the current
    velocity_filter_s: float = Field(ge=1e-4, le=1)  # of the shaft's velocity in T = R |v|

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the map is invertible: it starts at 0 A, current and torque rise."""
        if self.map[0].current_a != 0.0:
            yield RuleViolation(
                ("map", 0, "current_a"),
                f"{format_number(self.map[0].current_a)} is not 0; the map must start at 0 A",
                self.map[0].current_a,
            )
        for key in ("current_a", "torque_n_m"):
            values = [getattr(point, key) for point in self.map]
            yield from self.check_rising(values, ("map",), key, of=" of the previous entry")


class TorqueFeedback(FileModel):
    """The closed torque loop on the load cell."""

    proportional: float = Field(ge=0, le=10)  # gain
    integral_per_s: float = Field(ge=0, le=1000)  # gain


class InstantCorrection(FileModel):
    """The instantaneous position correction, computed from the measured torque."""

    filter_hz: float = Field(ge=0.1, le=200)  # of the torque


class Homing(FileModel):
    """The return of the shaft to its zero between rows."""

    rate_per_s: float = Field(gt=0, le=20)  # speed per remaining angle
    speed_rad_per_s: float = Field(gt=0, le=2)  # greatest speed
    duration_s: float = Field(ge=0.1, le=60)  # time for the return


class BenchStop(StopTiming):
    """A controlled stop: zero velocity, or damping in the torque loop, then power off."""

    damping_n_m_s_per_rad: float = Field(gt=0, le=1000)  # of the shaft in the torque loop


class BenchRigFile(BaseRigFile):
    """A rig of kind `oswec bench`."""

    kind: Literal["oswec bench"]
    rate_hz: BenchRate
    calibrations: TupleOf[str] = Field(default=(), strict=False)  # files, relative to this one
    servo: Servo
    shaft_encoder: Encoder
    brake: Brake
    homing: Homing
    torque_feedback: TorqueFeedback
    instant_correction: InstantCorrection
    stop: BenchStop
    manual_ramp_s: float = Field(default=0.5, ge=0.05, le=10)  # of a change in manual mode
    wiring: BenchWiring | None = None  # None: the rig can only be rehearsed

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that an encoder's counts fit its protocol and the brake current its output."""
        if self.wiring is None:
            return
        bridge = self.wiring.encoders
        for name, channel, encoder, key in (
            ("motor", bridge.motor, self.servo.encoder, "servo.encoder"),
            ("shaft", bridge.shaft, self.shaft_encoder, "shaft_encoder"),
        ):
            counts = encoder.counts_per_revolution
            if counts > max_counts(channel):
                yield RuleViolation(
                    ("wiring", "encoders", name, "protocol"),
                    f"{channel.protocol} carries up to {max_counts(channel)} counts, "
                    f"{key}.counts_per_revolution is {counts}",
                    channel.protocol,
                )
        max_current, output = self.brake.map[-1].current_a, self.wiring.analog.values[1]
        if output.high < max_current:
            yield RuleViolation(
                ("wiring", "analog", "values", 1, "high"),
                f"{format_number(output.high)} A is less than brake.map needs; "
                f"allowed from {format_number(max_current)} A",
                output.high,
            )
