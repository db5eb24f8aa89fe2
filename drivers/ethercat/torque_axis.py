"""A drive in cyclic synchronous torque mode as a slave of a segment."""

from typing import NamedTuple

from drivers.cia402.process_data import (
    ANALOG_INPUTS,
    CONTROLWORD,
    ERROR_CODE,
    MODE_DISPLAY,
    POSITION,
    STATUSWORD,
    TARGET_TORQUE,
    TORQUE,
    Entry,
)
from drivers.cia402.torque_drive import TorqueDrive, TorqueDriveSettings
from drivers.ethercat.process_image import Area, Values

OUTPUTS = (CONTROLWORD, TARGET_TORQUE)


def inputs(analog: int) -> tuple[Entry, ...]:
    """Return the inputs of a drive with a number of analog inputs."""
    return (STATUSWORD, TORQUE, POSITION, MODE_DISPLAY, ERROR_CODE, *ANALOG_INPUTS[:analog])


class TorqueAxisSettings(NamedTuple):
    """One drive of the segment."""

    drive: TorqueDriveSettings
    outputs: Area
    inputs: Area


class TorqueAxis(TorqueDrive):
    """The values of one drive in the images of its segment."""

    def __init__(self, settings: TorqueAxisSettings) -> None:
        super().__init__(settings.drive)
        self._has_analog = bool(settings.drive.analog)
        self._outputs = Values(OUTPUTS, settings.outputs)
        self._inputs = Values(inputs(len(settings.drive.analog)), settings.inputs)

    def take(self, image: memoryview, sampled: float) -> None:
        """Take the drive's inputs, sampled at a time (s)."""
        statusword, torque, position, mode, error, *analog = self._inputs.read(image)
        self.take_status(statusword, torque, position, sampled)
        self.take_mode(mode, error, sampled)
        if self._has_analog:
            self.take_analog(analog, sampled)

    def command(self, image: memoryview, current: float, enable: int, now: float) -> None:
        """Store the drive's outputs, as of `command_values`."""
        self._outputs.write(image, *self.command_values(current, enable, now))
