"""A drive in cyclic synchronous torque mode: its last status, and the command of each tick.

It owns no wire: a transport (`drivers.canopen.torque_axis`, for one) hands over the values that it
received, each with the time at which the drive sampled it, and sends what `command` returns. An
emergency message delivers the error code earlier than the process data, together with the fault.
"""

from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

from drivers.cia402 import scaling, state_machine
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import FAULT, FAULT_REACTION, decode

TORQUE_MODE = 10  # cyclic synchronous torque, 0x6060
_SAFE, _ENABLED = int(Goal.SAFE), int(Goal.ENABLED)
NEVER = -1e9  # s, earlier than any clock reading


class TorqueDriveSettings(NamedTuple):
    """Constants of one drive."""

    machine: state_machine.Params
    scale: scaling.CurrentScale
    max_slow_age: float  # s, > 0: older mode displays and error codes are ignored
    analog: tuple[float, ...] = ()  # units per raw step of each analog input, if any


class TorqueDriveReading(NamedTuple):
    """The drive's last status."""

    counts: int  # encoder, unwrapped
    current: float  # A, drive current
    acting: int  # 1: OPERATION ENABLED by our permission, in torque mode
    error: int  # 0x603F while the drive is in fault (0xFFFF: no code received), else 0
    age: float  # s since the drive sampled it; very large before the first
    analog: tuple[float, ...]  # analog inputs, scaled
    analog_age: float  # s; that of the status for a drive without analog inputs


class TorqueDrive:
    """One drive; times are those of one monotonic clock, s."""

    def __init__(self, drive: TorqueDriveSettings) -> None:
        self.limit_flags = 0  # scaling.LimitFlag set: why the sent command differs from the request
        self._drive = drive
        self._machine = state_machine.start(0, 0)
        self._arm = self._reset = 0
        self._enable = 0
        self._acting = 0
        self._counts = 0
        self._has_position = False
        self._statusword = self._raw = 0
        self._sample_time = self._slow_sample_time = self._analog_sample_time = NEVER
        self._mode_display = self._error = self._emergency_code = 0
        self._analog: tuple[float, ...] = (0.0,) * len(drive.analog)

    def take_status(self, statusword: int, torque: int, position: int, sampled: float) -> None:
        """Take the values that arrive every tick; ``torque`` and ``position`` as sent."""
        self._statusword, self._raw = statusword, torque
        self._counts = (
            scaling.unwrap_counts(self._counts, position) if self._has_position else position
        )
        self._has_position, self._sample_time = True, sampled

    def take_mode(self, mode_display: int, error: int, sampled: float) -> None:
        """Take mode display and error code, which may arrive less often."""
        self._mode_display, self._error = mode_display, error
        self._slow_sample_time = sampled

    def take_analog(self, raw: Sequence[int], sampled: float) -> None:
        """Take the analog inputs, as sent."""
        self._analog = tuple(map(mul, raw, self._drive.analog))
        self._analog_sample_time = sampled

    def take_emergency(self, code: int) -> None:
        """Take the error code of an emergency message."""
        self._emergency_code = code

    def read(self, now: float) -> TorqueDriveReading:
        """Return the last status with its ages at ``now`` (s)."""
        analog_time = self._analog_sample_time if self._drive.analog else self._sample_time
        faulty = decode(self._statusword) in (FAULT, FAULT_REACTION)
        return TorqueDriveReading(
            self._counts,
            scaling.current_feedback(self._drive.scale, self._raw),
            self._acting,
            (self._error or self._emergency_code or 0xFFFF) if faulty else 0,
            now - self._sample_time,
            self._analog,
            now - analog_time,
        )

    def command_values(self, current: float, enable: int, now: float) -> tuple[int, int]:
        """Return controlword and raw target for a current (A); ``enable`` 1: enable the drive.

        Each rising edge of ``enable`` is one request: a drive that trips or drops afterwards stays
        disabled until the next rising edge.
        """
        if enable == 1 and self._enable == 0:
            self._arm += 1
        self._enable = enable
        raw = scaling.current_command(self._drive.scale, current)
        self.limit_flags = raw.limit_flags
        self._machine, output = state_machine.step(
            self._drive.machine,
            self._machine,
            state_machine.Inputs(
                self._statusword,
                now - self._sample_time,
                self._mode_display
                if now - self._slow_sample_time <= self._drive.max_slow_age
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
        return output.controlword, output.setpoint

    def reset(self) -> None:
        """Request one fault reset, which gives no permission to enable."""
        self._reset += 1

    def explain(self) -> str:
        """Return why the drive is not enabled, for people; empty if it has permission."""
        return state_machine.explain(self._machine)
