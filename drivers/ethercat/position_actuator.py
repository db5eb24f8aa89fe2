"""An actuator in profile position mode as a slave of a segment."""

from typing import NamedTuple

from drivers.cia402.positioning_drive import (
    PositioningCommand,
    PositioningDrive,
    PositioningSettings,
)
from drivers.cia402.process_data import (
    CONTROLWORD,
    MODE,
    MODE_DISPLAY,
    POSITION,
    PROFILE_VELOCITY,
    STATUSWORD,
    TARGET_POSITION,
)
from drivers.ethercat.process_image import Area, Values

OUTPUTS = (TARGET_POSITION, PROFILE_VELOCITY, CONTROLWORD, MODE)
INPUTS = (STATUSWORD, MODE_DISPLAY, POSITION)


class ActuatorSettings(NamedTuple):
    """One actuator of the segment."""

    drive: PositioningSettings
    outputs: Area
    inputs: Area


class PositionActuator(PositioningDrive):
    """The values of one actuator in the images of its segment."""

    def __init__(self, settings: ActuatorSettings) -> None:
        super().__init__(settings.drive)
        self._outputs = Values(OUTPUTS, settings.outputs)
        self._inputs = Values(INPUTS, settings.inputs)

    def take(self, image: memoryview, sampled: float) -> None:
        """Take the actuator's inputs, sampled at a time (s)."""
        statusword, mode_display, position = self._inputs.read(image)
        self.take_status(statusword, mode_display, position, sampled)

    def command(self, image: memoryview, target: float, enable: int, now: float) -> None:
        """Store the actuator's outputs, as of `command_values`."""
        self._store(image, self.command_values(target, enable, now))

    def release(self, image: memoryview, now: float) -> None:
        """Store the outputs that remove the power, as of `release_values`."""
        self._store(image, self.release_values(now))

    def _store(self, image: memoryview, command: PositioningCommand) -> None:
        self._outputs.write(image, *command)
