"""The conversation with an actuator in profile position mode: moves to a target and its arrival.

It owns no bus: it receives and returns frames. Positions are in the unit of the `PositionScale`
(percent of a stator's travel, metres, ...).
"""

from typing import NamedTuple

from drivers.canopen import cia402, pdo, scaling
from drivers.canopen import profile_position as move
from drivers.canopen.cia402_table import Goal
from drivers.canopen.codec_error import CodecError
from drivers.canopen.statusword import FAULT, FAULT_REACTION, decode

_SAFE, _ENABLED = int(Goal.SAFE), int(Goal.ENABLED)
_ARRIVED = int(move.Phase.ARRIVED)
_FAILED = int(move.Phase.FAILED)
_NOT_FINITE = scaling.LimitFlag.NOT_FINITE.value
_NEVER = -1e9  # s, earlier than any clock reading


class ActuatorSettings(NamedTuple):
    """One actuator on the bus."""

    node: int  # 1 to 127
    machine: cia402.Params
    move: move.Params
    scale: scaling.PositionScale
    velocity: int  # 0x6081, in the drive's own unit, > 0
    status_divider: int = 1  # SYNCs per status


class ActuatorReading(NamedTuple):
    """The actuator's last status."""

    position: float  # in the scale's unit
    arrived: int  # 1: at rest at the last target; never for a target beyond the limits
    failed: int  # `profile_position.Failure` of the last move, 0: none
    fault: int  # 1: the drive is in fault
    age: float  # s since the SYNC that sampled it; very large before the first


class PositionActuator:
    """The conversation with one actuator."""

    def __init__(self, settings: ActuatorSettings) -> None:
        node = settings.node
        self.refused = 0  # frames of a wrong length
        self.limit_flags = 0  # scaling.LimitFlag set: why the sent target differs from the request
        self._target_out_of_reach = False  # True: they differ by more than the window
        self._settings = settings
        self._target_pdo = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        self._command_pdo = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        self._status_pdo = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        self.sync_dividers = {self._status_pdo.cob_id: settings.status_divider}
        self._machine, self._move = cia402.start(0, 0), move.start(0)
        self._arm = self._reset = self._request = 0
        self._enabled = False  # True: enabled by `command`, and not released since
        self._acting = 0
        self._target: float | None = None  # the last requested target
        self._raw_target = 0
        self._statusword = self._mode_display = self._counts = 0
        self._sample_time = _NEVER

    def receive(self, cob_id: int, data: bytes, sync_time: float) -> None:
        """Process a status frame; ``sync_time``: send time (s) of the SYNC that it answers."""
        try:
            self._statusword, self._mode_display, self._counts = pdo.unpack(self._status_pdo, data)
            self._sample_time = sync_time
        except CodecError:
            self.refused += 1

    def read(self, now: float) -> ActuatorReading:
        """Return the last status with its age at ``now`` (s)."""
        failed = self._move.failure if self._move.phase == _FAILED else 0
        return ActuatorReading(
            scaling.position_feedback(self._settings.scale, self._counts),
            1 if self._move.phase == _ARRIVED and not self._target_out_of_reach else 0,
            failed,
            1 if decode(self._statusword) in (FAULT, FAULT_REACTION) else 0,
            now - self._sample_time,
        )

    def command(self, target: float, enable: int, now: float) -> tuple[tuple[int, bytes], ...]:
        """Return COB-IDs and bytes that command a position; ``enable`` 0: hold the present one.

        The first ``enable`` is one request to enable the drive; it then holds its position until
        `release`. A failed move is repeated only for another target or after a halt. A target that
        is not finite is not sent: the actuator halts. A target beyond the limits is clamped to
        them and never counts as arrived.
        """
        settings = self._settings
        raw = scaling.position_command(settings.scale, target)
        self.limit_flags = raw.limit_flags
        moving = enable == 1 and raw.limit_flags & _NOT_FINITE == 0
        if moving:
            excess = (target - scaling.position_feedback(settings.scale, raw.value)) * (
                settings.scale.counts_per_unit
            )
            self._target_out_of_reach = raw.limit_flags != 0 and abs(excess) > settings.move.window
        if moving and not self._enabled:
            self._enabled = True
            self._arm += 1
        if moving and self._acting == 1 and target != self._target:
            self._target, self._raw_target = target, raw.value
            self._request += 1
        halt = 1 if self._enabled and not moving else 0
        if halt == 1 or self._acting == 0:
            self._target = None  # the move has ended; the target is sent again when it may continue
        self._move, move_output = move.step(
            settings.move,
            self._move,
            move.Inputs(
                self._statusword, self._counts, self._acting, self._request, self._raw_target, halt
            ),
        )
        self._machine, output = cia402.step(
            settings.machine,
            self._machine,
            cia402.Inputs(
                self._statusword,
                now - self._sample_time,
                self._mode_display,
                move.MODE,
                _ENABLED if self._enabled else _SAFE,
                self._arm,
                self._reset,
                move_output.mode_bits,
                0,
            ),
        )
        self._acting = output.acting
        return (
            (
                self._target_pdo.cob_id,
                pdo.pack(self._target_pdo, move_output.target, settings.velocity),
            ),
            (self._command_pdo.cob_id, pdo.pack(self._command_pdo, output.controlword, move.MODE)),
        )

    def release(self, now: float) -> tuple[tuple[int, bytes], ...]:
        """Remove the power; the next `command` with ``enable`` is a new request."""
        self._enabled = False
        return self.command(scaling.position_feedback(self._settings.scale, self._counts), 0, now)

    def explain(self) -> str:
        """Return why the actuator is not enabled, for people; empty if it has permission."""
        return cia402.explain(self._machine)
