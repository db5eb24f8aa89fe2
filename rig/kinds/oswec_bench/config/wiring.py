"""The wiring of an OSWEC bench: serial lines, the load cell's network, the Modbus devices.

A rehearsal needs no wiring. A property of a device that no manual confirms has no default.
"""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, WholeNumber
from rig.config.problems import format_number
from rig.config.wiring import PANEL_INPUTS, BlockContent, LoadCell, Registers, SerialPort, Wiring

_POSITION_BITS = {"SSI1": 22, "SSI2": 22, "SSI4": 19, "SSI6": 22, "SSI9": 19}


class EncoderChannel(FileModel):
    """One encoder channel of the bridge."""

    protocol: Literal["SSI1", "SSI2", "SSI4", "SSI6", "SSI9"]  # of the encoder
    direction: Literal[1, -1]  # -1: the count decreases with the positive angle
    # Maximum speed of the encoder's shaft: a count that implies a higher speed is refused, and so
    # is every count after a gap in which the shaft could have turned by half a turn.
    most_rad_per_s: float = Field(gt=0, le=1000)
    slack_counts: float = Field(ge=0, le=10_000)  # noise of a shaft at rest


class EncoderBridge(SerialPort):
    """The bridge that latches both encoders with one edge."""

    description: ClassVar[str] = "encoder bridge"

    motor: EncoderChannel
    shaft: EncoderChannel
    least_delay_s: float = Field(ge=0, le=0.1)  # minimum from latching edge to received bytes
    window_s: float = Field(gt=0, le=60)  # for comparing the bridge's clock with ours
    silent_s: float = Field(gt=0, le=5)  # a longer gap between frames is recorded


class ServoObject(FileModel):
    """One object of the servo drive."""

    index: WholeNumber = Field(ge=1, le=65_535)  # of the object
    sub: WholeNumber = Field(ge=0, le=255)  # subindex of the object
    form: Literal["INT24", "REAL48", "DINT48", "U16", "U32", "F32"]  # of the number
    # Drive units per SI unit, at the motor; negative: opposite direction.
    per_unit: float = Field(default=1.0, ge=-1e9, le=1e9)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the scale is not 0."""
        if self.per_unit == 0.0:
            yield RuleViolation(("per_unit",), "0 gives no value", 0.0)


class AnalogCommand(FileModel):
    """The velocity command through the analog output: volts = offset + gain * commanded volts."""

    offset_v: float = Field(gt=-10, lt=10)  # for zero velocity; measured
    gain: float = Field(ge=-2, le=2)  # volts at the output per commanded volt; measured
    low_v: float = Field(ge=-10, le=10)  # lower end of the output
    high_v: float = Field(ge=-10, le=10)  # upper end of the output

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the output can command zero velocity and a velocity other than zero."""
        if abs(self.gain) < 0.1:
            yield self.violation("gain", f"{format_number(self.gain)} commands nothing")
        if not self.low_v < self.offset_v < self.high_v:
            yield self.violation(
                "offset_v",
                f"{format_number(self.offset_v)} is not between "
                f"low_v = {format_number(self.low_v)} and high_v = {format_number(self.high_v)} V",
            )


class ServoDrive(SerialPort):
    """The Compax3: power, set-points and actual values over its serial line."""

    description: ClassVar[str] = "servo drive, Compax3"

    address: WholeNumber | None = Field(ge=0, le=99)  # null: RS-232
    identity: str = Field(min_length=1)  # what its name must begin with
    enabled_word: WholeNumber = Field(ge=1, le=65_535)  # control word: powered, motion enabled
    control: ServoObject
    status: ServoObject
    error: ServoObject
    velocity: ServoObject  # set-point, rad/s at the motor
    torque: ServoObject  # set-point, N m at the motor
    current: ServoObject  # measured, A
    most_rad_per_s: float = Field(gt=0, le=1000)  # maximum velocity set-point
    most_n_m: float = Field(gt=0, le=1000)  # maximum torque set-point
    expiry_s: float = Field(gt=0, le=5)  # power is removed this long after the last command
    stale_s: float = Field(gt=0, le=5)  # power is removed if the status is older than this
    rising_s: float = Field(gt=0, le=60)  # timeout until an enabled axis confirms its state
    answer_s: float = Field(gt=0, le=5)  # timeout of an answer
    quiet_s: float = Field(gt=0.005, le=1)  # silence after which no late answer is expected
    # If given, velocity sessions command through the analog output and the set-point object stays
    # at zero. Torque sessions always command through the torque object.
    analog: AnalogCommand | None = None

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that status and current, which one request reads, are of one family of formats."""
        plc = {"U16", "U32", "F32"}
        if (self.status.form in plc) != (self.current.form in plc):
            yield RuleViolation(
                ("current", "form"),
                f"{self.current.form} cannot be read together with {self.status.form} of status; "
                "allowed formats of one family: U16, U32, F32, or INT24, REAL48, DINT48",
                self.current.form,
            )


class BenchWiring(Wiring):
    """The wiring of the bench.

    The digital inputs are for monitoring only: the stop chain is hard-wired.
    """

    encoders: EncoderBridge
    servo: ServoDrive
    load_cell: LoadCell
    inputs: Annotated[Registers, PANEL_INPUTS]
    analog: Annotated[
        Registers,
        BlockContent(
            "I/O coupler: analog outputs for servo and brake",
            {"servo": "V", "brake": "A"},
            written=True,
        ),
    ]
    brake: Annotated[
        Registers, BlockContent("measuring amplifier: current of the brake", {"current": "A"})
    ]


def max_counts(channel: EncoderChannel) -> int:
    """Return the maximum counts per turn that the SSI word of an encoder can carry."""
    return 1 << _POSITION_BITS[channel.protocol]
