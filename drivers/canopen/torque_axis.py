"""The conversation with a drive in cyclic synchronous torque mode.

Each tick sends one command (controlword, target) before SYNC and receives the status sampled by the
previous SYNC (statusword, torque, position); mode display and error code arrive on a divider of
SYNC. An emergency message delivers the error code earlier, together with the fault.
The conversation owns no bus: it receives and returns frames.
"""

from operator import mul
from typing import NamedTuple

from drivers.canopen import cia402, emcy, pdo, scaling
from drivers.canopen.cia402_table import Goal
from drivers.canopen.codec_error import CodecError
from drivers.canopen.statusword import FAULT, FAULT_REACTION, decode

TORQUE_MODE = 10  # cyclic synchronous torque, 0x6060
_SAFE, _ENABLED = int(Goal.SAFE), int(Goal.ENABLED)
_NEVER = -1e9  # s, earlier than any clock reading


class TorqueAxisSettings(NamedTuple):
    """One drive on the bus."""

    node: int  # 1 to 127
    machine: cia402.Params
    scale: scaling.CurrentScale
    max_slow_age: float  # s, > 0: older mode displays and error codes are ignored
    analog: tuple[float, ...] = ()  # units per raw step of each analog input in TPDO 3, if any
    slow_divider: int = 1  # SYNCs per frame with mode display and error code


class TorqueAxisReading(NamedTuple):
    """The drive's last status."""

    counts: int  # encoder, unwrapped
    current: float  # A, drive current
    acting: int  # 1: OPERATION ENABLED by our permission, in torque mode
    error: int  # 0x603F while the drive is in fault (0xFFFF: no code received), else 0
    age: float  # s since the SYNC that sampled it; very large before the first
    analog: tuple[float, ...]  # analog inputs, scaled, of the same SYNC
    analog_age: float  # s; that of the status for a drive without analog inputs


_ANALOG = tuple(pdo.Entry(0x201A, sub, "i16", f"analog input {sub}") for sub in (1, 2, 3, 4))


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
        pdo.layout(pdo.tpdo_cob_id(3, node), _ANALOG[:inputs]) if inputs else None,
    )


class TorqueAxis:
    """The conversation with one drive."""

    def __init__(self, settings: TorqueAxisSettings) -> None:
        self.refused = 0  # frames of a wrong length
        self.limit_flags = 0  # scaling.LimitFlag set: why the sent command differs from the request
        self._settings = settings
        self._layouts = layouts(settings.node, len(settings.analog))
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
        self._machine = cia402.start(0, 0)
        self._arm = self._reset = 0
        self._enable = 0
        self._acting = 0
        self._counts = 0
        self._has_position = False
        self._statusword = self._raw = 0
        self._sample_time = self._slow_sample_time = self._analog_sample_time = _NEVER
        self._mode_display = self._error = self._emergency_code = 0
        self._analog: tuple[float, ...] = (0.0,) * len(settings.analog)

    def receive(self, cob_id: int, data: bytes, sync_time: float) -> None:
        """Process a frame of the drive; ``sync_time``: send time (s) of the SYNC it answers."""
        try:
            self._receivers[cob_id](data, sync_time)
        except CodecError:
            self.refused += 1

    def _receive_status(self, data: bytes, sync_time: float) -> None:
        self._statusword, self._raw, position = pdo.unpack(self._layouts.status, data)
        self._counts = (
            scaling.unwrap_counts(self._counts, position) if self._has_position else position
        )
        self._has_position, self._sample_time = True, sync_time

    def _receive_slow_status(self, data: bytes, sync_time: float) -> None:
        self._mode_display, self._error = pdo.unpack(self._layouts.slow, data)
        self._slow_sample_time = sync_time

    def _receive_analog(self, data: bytes, sync_time: float) -> None:
        assert self._layouts.analog is not None
        raw = pdo.unpack(self._layouts.analog, data)
        self._analog = tuple(map(mul, raw, self._settings.analog))
        self._analog_sample_time = sync_time

    def _receive_emergency(self, data: bytes, _: float) -> None:
        self._emergency_code = emcy.decode(emcy.BASE + self._settings.node, data).code

    def read(self, now: float) -> TorqueAxisReading:
        """Return the last status with its ages at ``now`` (s)."""
        has_analog = self._layouts.analog is not None
        analog_time = self._analog_sample_time if has_analog else self._sample_time
        faulty = decode(self._statusword) in (FAULT, FAULT_REACTION)
        return TorqueAxisReading(
            self._counts,
            scaling.current_feedback(self._settings.scale, self._raw),
            self._acting,
            (self._error or self._emergency_code or 0xFFFF) if faulty else 0,
            now - self._sample_time,
            self._analog,
            now - analog_time,
        )

    def command(self, current: float, enable: int, now: float) -> tuple[int, bytes]:
        """Return COB-ID and bytes that command a drive current (A); ``enable`` 1: enable the drive.

        Each rising edge of ``enable`` is one request: a drive that trips or drops afterwards stays
        disabled until the next rising edge.
        """
        if enable == 1 and self._enable == 0:
            self._arm += 1
        self._enable = enable
        raw = scaling.current_command(self._settings.scale, current)
        self.limit_flags = raw.limit_flags
        self._machine, output = cia402.step(
            self._settings.machine,
            self._machine,
            cia402.Inputs(
                self._statusword,
                now - self._sample_time,
                self._mode_display
                if now - self._slow_sample_time <= self._settings.max_slow_age
                else 0,
                TORQUE_MODE,
                _ENABLED if enable == 1 else _SAFE,
                self._arm,
                self._reset,
                0,
                raw.value,
            ),
        )
        self._acting = output.acting
        command = self._layouts.command
        return command.cob_id, pdo.pack(command, output.controlword, output.setpoint)

    def reset(self) -> None:
        """Request one fault reset, which gives no permission to enable."""
        self._reset += 1

    def explain(self) -> str:
        """Return why the drive is not enabled, for people; empty if it has permission."""
        return cia402.explain(self._machine)
