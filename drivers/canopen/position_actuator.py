"""The conversation with an actuator in profile position mode on a CAN bus.

It owns no bus: it receives and returns frames.
"""

from typing import NamedTuple

from drivers.canopen import pdo
from drivers.canopen.codec_error import CodecError
from drivers.cia402.positioning_drive import (
    PositioningCommand,
    PositioningDrive,
    PositioningSettings,
)

Frames = tuple[tuple[int, bytes], ...]
"""COB-IDs and bytes."""


class ActuatorSettings(NamedTuple):
    """One actuator on the bus."""

    node: int  # 1 to 127
    drive: PositioningSettings
    status_divider: int = 1  # SYNCs per status


class PositionActuator(PositioningDrive):
    """The conversation with one actuator."""

    def __init__(self, settings: ActuatorSettings) -> None:
        super().__init__(settings.drive)
        node = settings.node
        self.refused = 0  # frames of a wrong length
        self._target_pdo = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        self._command_pdo = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        self._status_pdo = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        self.sync_dividers = {self._status_pdo.cob_id: settings.status_divider}

    def receive(self, cob_id: int, data: bytes, sync_time: float) -> None:
        """Process a status frame; ``sync_time``: send time (s) of the SYNC that it answers."""
        try:
            statusword, mode_display, position = pdo.unpack(self._status_pdo, data)
            self.take_status(statusword, mode_display, position, sync_time)
        except CodecError:
            self.refused += 1

    def command(self, target: float, enable: int, now: float) -> Frames:
        """Return the frames that command a position, as of `command_values`."""
        return self._frames(self.command_values(target, enable, now))

    def release(self, now: float) -> Frames:
        """Return the frames that remove the power, as of `release_values`."""
        return self._frames(self.release_values(now))

    def _frames(self, command: PositioningCommand) -> Frames:
        target, velocity, controlword, mode = command
        return (
            (self._target_pdo.cob_id, pdo.pack(self._target_pdo, target, velocity)),
            (self._command_pdo.cob_id, pdo.pack(self._command_pdo, controlword, mode)),
        )
