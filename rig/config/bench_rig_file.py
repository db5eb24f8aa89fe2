"""The file of an OSWEC bench: what is screwed together, and how its numbers are scaled.

Velocities, torques and constants are those of the gearbox output.
"""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from rig.config.bench_wiring import BenchWiring, field_of
from rig.config.model import Broken, FileModel, Several, Whole
from rig.config.problems import number_text
from rig.config.rig_file import SUPERVISOR_TIMEOUT, BenchRate, StopTiming, SupervisorTimeout


class Encoder(FileModel):
    """An encoder and its estimator."""

    counts_per_revolution: Whole = Field(ge=100, le=100_000_000)
    noise_counts: float = Field(ge=0, le=1000)  # standard deviation besides quantisation
    jerk_density_rad2_per_s5: float = Field(ge=1e-6, le=1e9)


class Servo(FileModel):
    """Servo drive, motor and gearbox."""

    gear_ratio: float = Field(ge=1, le=1000)  # motor turns per turn of the output
    torque_constant_n_m_per_a: float = Field(ge=0.1, le=1000)  # nominal
    velocity_constant_rad_per_s_per_v: float = Field(ge=0.01, le=100)  # nominal
    command_v: float = Field(gt=0, le=10)  # most of the velocity command, either way
    encoder: Encoder


class BrakePoint(FileModel):
    """One point of the brake's curve, the mean of its two branches."""

    current_a: float = Field(ge=0, le=20)
    torque_n_m: float = Field(ge=0, le=1000)


class Brake(FileModel):
    """The particle brake and its amplifier."""

    map: Several[BrakePoint] = Field(min_length=2, strict=False)
    slew_a_per_s: float = Field(gt=0, le=1e5)
    velocity_filter_s: float = Field(ge=1e-4, le=1)  # of the shaft's velocity in T = R |v|

    def broken_rules(self) -> Iterator[Broken]:
        """Current and torque rise, from no current: the map can be inverted."""
        if self.map[0].current_a != 0.0:
            yield Broken(
                ("map", 0, "current_a"),
                f"{number_text(self.map[0].current_a)} is not 0: the map begins without current",
                self.map[0].current_a,
            )
        for i in range(1, len(self.map)):
            for key in ("current_a", "torque_n_m"):
                before, here = getattr(self.map[i - 1], key), getattr(self.map[i], key)
                if here <= before:
                    yield Broken(
                        ("map", i, key),
                        f"{number_text(here)} does not rise above {number_text(before)} "
                        "of the entry before",
                        here,
                    )


class TorqueFeedback(FileModel):
    """The closed torque loop on the load cell."""

    proportional: float = Field(ge=0, le=10)
    integral_per_s: float = Field(ge=0, le=1000)


class InstantCorrection(FileModel):
    """The position correction in the instant, from the measured torque."""

    filter_hz: float = Field(ge=0.1, le=200)  # of the torque


class Homing(FileModel):
    """How the shaft is brought back to its zero between rows."""

    rate_per_s: float = Field(gt=0, le=20)  # of the way that is left
    speed_rad_per_s: float = Field(gt=0, le=2)
    duration_s: float = Field(ge=0.1, le=60)


class BenchStop(StopTiming):
    """A controlled stop: zero velocity, or damping in the torque loop, then power off."""

    damping_n_m_s_per_rad: float = Field(gt=0, le=1000)


class BenchRigFile(FileModel):
    """A rig of kind `oswec bench`."""

    name: str = Field(min_length=1, max_length=64)
    kind: Literal["oswec bench"]
    rate_hz: BenchRate
    realtime: Literal["best effort", "required"]
    limits: str = Field(min_length=1)  # file, relative to this one
    plant: str = Field(min_length=1)  # file, relative to this one; stands in for the hardware
    calibrations: Several[str] = Field(default=(), strict=False)  # files, relative to this one
    servo: Servo
    shaft_encoder: Encoder
    brake: Brake
    homing: Homing
    torque_feedback: TorqueFeedback
    instant_correction: InstantCorrection
    drive_enable_timeout_s: float = Field(ge=0.1, le=60)
    stop: BenchStop
    supervisor_timeout_s: SupervisorTimeout = SUPERVISOR_TIMEOUT
    wiring: BenchWiring | None = None  # none: it can only be rehearsed

    def broken_rules(self) -> Iterator[Broken]:
        """An encoder's counts fit its words, and the brake's current its output."""
        if self.wiring is None:
            return
        bridge = self.wiring.encoders
        for name, word, encoder, key in (
            ("motor", bridge.motor, self.servo.encoder, "servo.encoder"),
            ("shaft", bridge.shaft, self.shaft_encoder, "shaft_encoder"),
        ):
            counts = encoder.counts_per_revolution
            if counts > field_of(word):
                yield Broken(
                    ("wiring", "encoders", name, "protocol"),
                    f"{word.protocol} carries up to {field_of(word)} counts, "
                    f"{key}.counts_per_revolution is {counts}",
                    word.protocol,
                )
        most, output = self.brake.map[-1].current_a, self.wiring.analog.values[1]
        if output.high < most:
            yield Broken(
                ("wiring", "analog", "values", 1, "high"),
                f"{number_text(output.high)} A is less than brake.map asks for; "
                f"allowed from {number_text(most)} A",
                output.high,
            )
