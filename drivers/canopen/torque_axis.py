"""The conversation with a drive in cyclic synchronous torque mode on a CAN bus.

Each tick sends one command (controlword, target) before SYNC and receives the status sampled by the
previous SYNC (statusword, torque, position); mode display and error code arrive on a divider of
SYNC. The conversation owns no bus: it receives and returns frames.
"""

from typing import NamedTuple

from drivers.canopen import emcy, pdo
from drivers.canopen.codec_error import CodecError
from drivers.cia402.process_data import ANALOG_INPUTS
from drivers.cia402.torque_drive import TorqueDrive, TorqueDriveSettings


class TorqueAxisSettings(NamedTuple):
    """One drive on the bus."""

    node: int  # 1 to 127
    drive: TorqueDriveSettings
    slow_divider: int = 1  # SYNCs per frame with mode display and error code


class AxisLayouts(NamedTuple):
    """The PDOs of a torque axis."""

    command: pdo.Layout
    status: pdo.Layout
    slow: pdo.Layout
    analog: pdo.Layout | None


def layouts(node: int, inputs: int) -> AxisLayouts:
    """Return the PDOs of a node with ``inputs`` analog inputs (0 to 4)."""
    return AxisLayouts(
        pdo.layout(pdo.rpdo_cob_id(1, node), pdo.AXIS_COMMAND),
        pdo.layout(pdo.tpdo_cob_id(1, node), pdo.AXIS_STATUS),
        pdo.layout(pdo.tpdo_cob_id(2, node), pdo.AXIS_SLOW_STATUS),
        pdo.layout(pdo.tpdo_cob_id(3, node), ANALOG_INPUTS[:inputs]) if inputs else None,
    )


class TorqueAxis(TorqueDrive):
    """The conversation with one drive."""

    def __init__(self, settings: TorqueAxisSettings) -> None:
        super().__init__(settings.drive)
        self.refused = 0  # frames of a wrong length
        self._node = settings.node
        self._layouts = layouts(settings.node, len(settings.drive.analog))
        emergency_id = emcy.BASE + settings.node
        self.sync_dividers = {
            emergency_id: 0,
            self._layouts.status.cob_id: 1,
            self._layouts.slow.cob_id: settings.slow_divider,
        }
        self._receivers = {
            emergency_id: self._receive_emergency,
            self._layouts.status.cob_id: self._receive_status,
            self._layouts.slow.cob_id: self._receive_slow_status,
        }
        if self._layouts.analog is not None:
            self.sync_dividers[self._layouts.analog.cob_id] = 1
            self._receivers[self._layouts.analog.cob_id] = self._receive_analog

    def receive(self, cob_id: int, data: bytes, sync_time: float) -> None:
        """Process a frame of the drive; ``sync_time``: send time (s) of the SYNC it answers."""
        try:
            self._receivers[cob_id](data, sync_time)
        except CodecError:
            self.refused += 1

    def _receive_status(self, data: bytes, sync_time: float) -> None:
        statusword, torque, position = pdo.unpack(self._layouts.status, data)
        self.take_status(statusword, torque, position, sync_time)

    def _receive_slow_status(self, data: bytes, sync_time: float) -> None:
        mode_display, error = pdo.unpack(self._layouts.slow, data)
        self.take_mode(mode_display, error, sync_time)

    def _receive_analog(self, data: bytes, sync_time: float) -> None:
        assert self._layouts.analog is not None
        self.take_analog(pdo.unpack(self._layouts.analog, data), sync_time)

    def _receive_emergency(self, data: bytes, _: float) -> None:
        self.take_emergency(emcy.decode(emcy.BASE + self._node, data).code)

    def command(self, current: float, enable: int, now: float) -> tuple[int, bytes]:
        """Return COB-ID and bytes that command a drive current (A), as of `command_values`."""
        command = self._layouts.command
        return command.cob_id, pdo.pack(command, *self.command_values(current, enable, now))
