"""What the supervisor hands to the loop process for the devices of a wired bench."""

from typing import NamedTuple

from drivers.compax3 import analog_command


class Config(NamedTuple):
    """How the loop's volts and amperes leave for the wires."""

    analog: int  # 1: the velocity command goes through the analog output, else to the drive itself
    output: analog_command.Params  # that output, volts over volts
    velocity_per_volt: float  # rad/s at the motor, what the drive is told for a volt
    torque_per_ampere: float  # N m at the motor, nominal
    brake_most: float  # A that the brake's output can give
