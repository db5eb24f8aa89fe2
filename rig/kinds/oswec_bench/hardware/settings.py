"""The settings of a wired bench's devices, which the supervisor sends to the loop process."""

from typing import NamedTuple

from drivers.compax3 import analog_command


class BenchDeviceSettings(NamedTuple):
    """Scales from the loop's volts and amperes to the commands on the wires."""

    analog: int  # 1: the velocity command goes through the analog output; 0: to the drive itself
    output: analog_command.Params  # calibration of the analog output, volts over volts
    velocity_per_volt: float  # rad/s at the motor per volt
    torque_per_ampere: float  # N m at the motor, nominal
    max_brake_current: float  # A, limit of the brake's output
