"""A drive in profile position mode: moves to a target, and its arrival.

It owns no wire: a transport (`drivers.canopen.position_actuator`, for one) hands over the values
that it received, each with the time at which the drive sampled it, and sends what `command_values`
returns. Positions are in the unit of the `PositionScale` (percent of travel, metres, ...).
"""

from typing import NamedTuple

from drivers.cia402 import profile_position as move
from drivers.cia402 import scaling, state_machine
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import FAULT, FAULT_REACTION, decode

_SAFE, _ENABLED = int(Goal.SAFE), int(Goal.ENABLED)
_ARRIVED = int(move.Phase.ARRIVED)
_FAILED = int(move.Phase.FAILED)
_NOT_FINITE = scaling.LimitFlag.NOT_FINITE.value
_NEVER = -1e9  # s, earlier than any clock reading


class PositioningSettings(NamedTuple):
    """Constants of one drive."""

    machine: state_machine.Params
    move: move.Params
    scale: scaling.PositionScale
    velocity: int  # 0x6081, in the drive's own unit, > 0


class PositioningReading(NamedTuple):
    """The drive's last status."""

    position: float  # in the scale's unit
    arrived: int  # 1: at rest at the last target; never for a target beyond the limits
    failed: int  # `profile_position.Failure` of the last move, 0: none
    fault: int  # 1: the drive is in fault
    age: float  # s since the drive sampled it; very large before the first


class PositioningCommand(NamedTuple):
    """The values to send, as the objects of these names (`process_data`)."""

    target: int
    velocity: int
    controlword: int
    mode: int


class PositioningDrive:
    """One drive; times are those of one monotonic clock, s."""

    def __init__(self, drive: PositioningSettings) -> None:
        self.limit_flags = 0  # scaling.LimitFlag set: why the sent target differs from the request
        self._target_out_of_reach = False  # True: they differ by more than the window
        self._drive = drive
        self._machine, self._move = state_machine.start(0, 0), move.start(0)
        self._arm = self._reset = self._request = 0
        self._enabled = False  # True: enabled by a command, and not released since
        self._acting = 0
        self._target: float | None = None  # the last requested target
        self._raw_target = 0
        self._statusword = self._mode_display = self._counts = 0
        self._sample_time = _NEVER

    def take_status(
        self, statusword: int, mode_display: int, position: int, sampled: float
    ) -> None:
        """Take the values of a status; ``position`` as sent."""
        self._statusword, self._mode_display, self._counts = statusword, mode_display, position
        self._sample_time = sampled

    def read(self, now: float) -> PositioningReading:
        """Return the last status with its age at ``now`` (s)."""
        failed = self._move.failure if self._move.phase == _FAILED else 0
        return PositioningReading(
            scaling.position_feedback(self._drive.scale, self._counts),
            1 if self._move.phase == _ARRIVED and not self._target_out_of_reach else 0,
            failed,
            1 if decode(self._statusword) in (FAULT, FAULT_REACTION) else 0,
            now - self._sample_time,
        )

    def command_values(self, target: float, enable: int, now: float) -> PositioningCommand:
        """Return the values that command a position; ``enable`` 0: hold the present one.

        The first ``enable`` is one request to enable the drive; it then holds its position until
        released. A failed move is repeated only for another target or after a halt. A target that
        is not finite is not sent: the actuator halts. A target beyond the limits is clamped to
        them and never counts as arrived.
        """
        drive = self._drive
        raw = scaling.position_command(drive.scale, target)
        self.limit_flags = raw.limit_flags
        moving = enable == 1 and raw.limit_flags & _NOT_FINITE == 0
        if moving:
            excess = (target - scaling.position_feedback(drive.scale, raw.value)) * (
                drive.scale.counts_per_unit
            )
            self._target_out_of_reach = raw.limit_flags != 0 and abs(excess) > drive.move.window
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
            drive.move,
            self._move,
            move.Inputs(
                self._statusword, self._counts, self._acting, self._request, self._raw_target, halt
            ),
        )
        self._machine, output = state_machine.step(
            drive.machine,
            self._machine,
            state_machine.Inputs(
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
        return PositioningCommand(move_output.target, drive.velocity, output.controlword, move.MODE)

    def release_values(self, now: float) -> PositioningCommand:
        """Remove the power; the next command with ``enable`` is a new request."""
        self._enabled = False
        return self.command_values(
            scaling.position_feedback(self._drive.scale, self._counts), 0, now
        )

    def explain(self) -> str:
        """Return why the actuator is not enabled, for people; empty if it has permission."""
        return state_machine.explain(self._machine)
