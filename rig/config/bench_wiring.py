"""How an OSWEC bench is wired: serial lines, the load cell's network, what hangs on Modbus.

A rehearsal needs none of it. What no manual has confirmed of a device has no default.
"""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from rig.config.model import Broken, FileModel, Whole
from rig.config.problems import number_text
from rig.config.wiring import AnyLine, Registers, line_rules

_POSITION_BITS = {"SSI1": 22, "SSI2": 22, "SSI4": 19, "SSI6": 22, "SSI9": 19}


class SerialPort(FileModel):
    """A serial port; a path under /dev/serial/by-id stays with its adapter."""

    port: str = Field(min_length=1)
    baud: Whole = Field(ge=1200, le=4_000_000)
    parity: Literal["N", "E", "O"]
    stop_bits: Literal[1, 2]
    rts_cts: bool = False  # hardware handshake
    echo: bool = False  # a two-wire RS-485 adapter that hears itself
    low_latency: bool = False  # ask the adapter's driver to hand on bytes at once


class EncoderWord(FileModel):
    """One encoder behind the bridge."""

    protocol: Literal["SSI1", "SSI2", "SSI4", "SSI6", "SSI9"]
    direction: Literal[1, -1]  # -1: it counts against the positive angle
    # Most that its own shaft ever turns: a count that needs more is refused, and so is every count
    # after a silence in which it could have turned by half a turn.
    most_rad_per_s: float = Field(gt=0, le=1000)
    slack_counts: float = Field(ge=0, le=10_000)  # noise that is no motion


class EncoderBridge(SerialPort):
    """The bridge that reads both encoders by one edge."""

    motor: EncoderWord
    shaft: EncoderWord
    least_delay_s: float = Field(ge=0, le=0.1)  # from latching edge to bytes here, at best
    window_s: float = Field(gt=0, le=60)  # of the comparison of both clocks
    silent_s: float = Field(gt=0, le=5)  # without a frame: named in the record


class ServoObject(FileModel):
    """One object of the servo drive."""

    index: Whole = Field(ge=1, le=65_535)
    sub: Whole = Field(ge=0, le=255)
    form: Literal["INT24", "REAL48", "DINT48", "U16", "U32", "F32"]
    # Drive units per SI unit, at the motor; negative: the other way.
    per_unit: float = Field(default=1.0, ge=-1e9, le=1e9)

    def broken_rules(self) -> Iterator[Broken]:
        """A scale of nothing is none."""
        if self.per_unit == 0.0:
            yield Broken(("per_unit",), "0 gives no value", 0.0)


class AnalogCommand(FileModel):
    """The velocity command through the analog output: volts = offset + gain * volts asked for."""

    offset_v: float = Field(gt=-10, lt=10)  # that commands nothing; measured
    gain: float = Field(ge=-2, le=2)  # volts at the output per volt asked for; measured
    low_v: float = Field(ge=-10, le=10)
    high_v: float = Field(ge=-10, le=10)

    def broken_rules(self) -> Iterator[Broken]:
        """The drive can be told to do nothing, and something."""
        if abs(self.gain) < 0.1:
            yield Broken(("gain",), f"{number_text(self.gain)} commands nothing", self.gain)
        if not self.low_v < self.offset_v < self.high_v:
            yield Broken(
                ("offset_v",),
                f"{number_text(self.offset_v)} is not between low_v = {number_text(self.low_v)} "
                f"and high_v = {number_text(self.high_v)} V",
                self.offset_v,
            )


class ServoDrive(SerialPort):
    """The Compax3: power, set-points and actual values over its serial line."""

    address: Whole | None = Field(ge=0, le=99)  # null: RS-232
    identity: str = Field(min_length=1)  # what its name must begin with
    enabled_word: Whole = Field(ge=1, le=65_535)  # control word that powers it and lets it move
    control: ServoObject
    status: ServoObject
    error: ServoObject
    velocity: ServoObject  # set-point, rad/s at the motor
    torque: ServoObject  # set-point, N m at the motor
    current: ServoObject  # measured, A
    most_rad_per_s: float = Field(gt=0, le=1000)  # no velocity set-point is beyond it
    most_n_m: float = Field(gt=0, le=1000)  # no torque set-point is beyond it
    expiry_s: float = Field(gt=0, le=5)  # without a command of the loop: taken down
    stale_s: float = Field(gt=0, le=5)  # age of the status: taken down
    rising_s: float = Field(gt=0, le=60)  # until an axis that is asked up says so
    answer_s: float = Field(gt=0, le=5)
    quiet_s: float = Field(gt=0.005, le=1)  # without a byte: no late answer is on its way
    # Given: velocity sessions command through the analog output, and the set-point object stays
    # at nothing. Torque sessions always command through the torque object.
    analog: AnalogCommand | None = None

    def broken_rules(self) -> Iterator[Broken]:
        """What is asked for in one record is of one family of formats."""
        plc = {"U16", "U32", "F32"}
        if (self.status.form in plc) != (self.current.form in plc):
            yield Broken(
                ("current", "form"),
                f"{self.current.form} cannot be asked for together with status' {self.status.form}",
                self.current.form,
            )


class LoadCell(FileModel):
    """The ATI cell behind a Net F/T box."""

    host: str = Field(min_length=1)  # its address in numbers: a name could make opening wait
    port: Whole = Field(ge=1, le=65_535)
    counts_per_force: float = Field(gt=0, le=1e9)
    counts_per_torque: float = Field(gt=0, le=1e9)
    force_unit: Literal["lbf", "N", "klbf", "kN", "kgf", "gf"]
    torque_unit: Literal["lbf-in", "lbf-ft", "N-m", "N-mm", "kgf-cm", "kN-m"]
    model: Literal["net_ft", "axia"]  # what the bits of its status mean
    rate_hz: float = Field(ge=0, le=100_000)  # at which it counts its samples; 0: not known
    turned_over: bool  # mounted with z away from the brake: y and z change sign
    quiet_s: float = Field(gt=0, le=5)
    silence_s: float = Field(gt=0, le=5)


class BenchWiring(FileModel):
    """The bench's wires."""

    encoders: EncoderBridge
    servo: ServoDrive
    load_cell: LoadCell
    lines: dict[str, AnyLine]
    inputs: Registers  # e_stop, limit_switch: monitoring only, the stop chain is hard-wired
    analog: Registers  # servo (V), brake (A): outputs
    brake: Registers  # current (A), measured at the brake
    output_expiry_s: float = Field(ge=0.05, le=10)  # age from which an output is let go

    def broken_rules(self) -> Iterator[Broken]:
        """Every block has its values and its line."""
        yield from line_rules(self, self.lines, BENCH_SLOT_SIGNALS)


def field_of(word: EncoderWord) -> int:
    """Most counts of one turn that an encoder's word can carry."""
    return 1 << _POSITION_BITS[word.protocol]


BENCH_SLOT_SIGNALS = {
    "inputs": ("e_stop", "limit_switch"),
    "analog": ("servo", "brake"),
    "brake": ("current",),
}
