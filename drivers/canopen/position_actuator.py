"""An actuator in profile position mode: go there, stand, say so; what is told and heard of it.

The conversation owns no bus: it takes frames and gives frames. Positions are in the unit of the
`PositionScale` (percent of a stator's travel, metres, ...).
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
_NOT_FINITE = scaling.Held.NOT_FINITE.value
_NEVER = -1e9  # s, before any clock began


class Settings(NamedTuple):
    """One actuator on the bus."""

    node: int  # 1 to 127
    machine: cia402.Params
    move: move.Params
    scale: scaling.PositionScale
    velocity: int  # 0x6081, in the drive's own unit, > 0
    every: int = 1  # SYNCs from one status to the next


class Reading(NamedTuple):
    """What the actuator said last."""

    position: float  # in the scale's unit
    arrived: int  # 1: at the target last given, and at rest; never for one beyond the limits
    failed: int  # `profile_position.Failure` of the last move, 0: none
    fault: int  # 1: the drive is in fault
    age: float  # s, since the SYNC that sampled it; very large before the first


class PositionActuator:
    """The conversation with one actuator."""

    def __init__(self, settings: Settings) -> None:
        node = settings.node
        self.refused = 0  # frames of a wrong length
        self.held = 0  # set of scaling.Held: why the last target is not what was asked
        self._beyond = False  # and is not near it either
        self._settings = settings
        self._target_pdo = pdo.layout(pdo.rpdo_cob_id(2, node), pdo.ACTUATOR_TARGET)
        self._command_pdo = pdo.layout(pdo.rpdo_cob_id(1, node), pdo.ACTUATOR_COMMAND)
        self._status_pdo = pdo.layout(pdo.tpdo_cob_id(1, node), pdo.ACTUATOR_STATUS)
        self.each_sync = {self._status_pdo.cob_id: settings.every}
        self._machine, self._move = cia402.start(0, 0), move.start(0)
        self._arm = self._reset = self._request = 0
        self._up = False  # asked up, and not released since
        self._acting = 0
        self._wanted: float | None = None  # the target last asked for
        self._raw_target = 0
        self._statusword = self._shown = self._counts = 0
        self._sampled = _NEVER

    def take(self, cob_id: int, data: bytes, sampled: float) -> None:
        """A frame of ours, and when (s) the SYNC was sent that it answers."""
        try:
            self._statusword, self._shown, self._counts = pdo.unpack(self._status_pdo, data)
            self._sampled = sampled
        except CodecError:
            self.refused += 1

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        failed = self._move.failure if self._move.phase == _FAILED else 0
        return Reading(
            scaling.position_feedback(self._settings.scale, self._counts),
            1 if self._move.phase == _ARRIVED and not self._beyond else 0,
            failed,
            1 if decode(self._statusword) in (FAULT, FAULT_REACTION) else 0,
            now - self._sampled,
        )

    def command(self, target: float, enable: int, now: float) -> tuple[tuple[int, bytes], ...]:
        """COB-IDs and bytes that ask for a position; ``enable`` 0: stay where you are.

        The first ``enable`` is one request to bring the drive up; from then on it holds its place
        until `release`. A move that failed is not tried again by itself: only for another target,
        or after a halt. A target that is no number is not sent: the actuator halts. One beyond the
        limits is held there, and not arrived at.
        """
        settings = self._settings
        raw = scaling.position_command(settings.scale, target)
        self.held = raw.held
        moving = enable == 1 and raw.held & _NOT_FINITE == 0
        if moving:
            off = (target - scaling.position_feedback(settings.scale, raw.value)) * (
                settings.scale.counts_per_unit
            )
            self._beyond = raw.held != 0 and abs(off) > settings.move.window
        if moving and not self._up:
            self._up = True
            self._arm += 1
        if moving and self._acting == 1 and target != self._wanted:
            self._wanted, self._raw_target = target, raw.value
            self._request += 1
        halt = 1 if self._up and not moving else 0
        if halt == 1 or self._acting == 0:
            self._wanted = None  # the move is over; the target is offered anew when it may go on
        self._move, wish = move.step(
            settings.move,
            self._move,
            move.Inputs(
                self._statusword, self._counts, self._acting, self._request, self._raw_target, halt
            ),
        )
        self._machine, told = cia402.step(
            settings.machine,
            self._machine,
            cia402.Inputs(
                self._statusword,
                now - self._sampled,
                self._shown,
                move.MODE,
                _ENABLED if self._up else _SAFE,
                self._arm,
                self._reset,
                wish.mode_bits,
                0,
            ),
        )
        self._acting = told.acting
        return (
            (self._target_pdo.cob_id, pdo.pack(self._target_pdo, wish.target, settings.velocity)),
            (self._command_pdo.cob_id, pdo.pack(self._command_pdo, told.controlword, move.MODE)),
        )

    def release(self, now: float) -> tuple[tuple[int, bytes], ...]:
        """Take the power off; the next `command` with ``enable`` asks anew."""
        self._up = False
        return self.command(scaling.position_feedback(self._settings.scale, self._counts), 0, now)

    def explain(self) -> str:
        """Why the actuator is kept down, for people; empty if it is not."""
        return cia402.explain(self._machine)
