"""A whole homing of one drive, outside the tick: mode 6, enable, handshake, power off.

It owns no wire: a transport gives access to statusword, mode display and controlword.
"""

import time
from collections.abc import Callable
from typing import Protocol

from drivers.cia402 import homing, state_machine
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import DriveState, decode, describe

PERIOD_S = 0.02  # between two polls; ticks of the parameters last as long
POWER_OFF_S = 2.0  # s in which a drive must confirm that it is disabled
_MODE_S = 0.5  # s in which a drive must display the mode
_ENABLED = int(Goal.ENABLED)
_HOMED, _FAILED = int(homing.Phase.HOMED), int(homing.Phase.FAILED)
_POWERED = (
    DriveState.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
    DriveState.FAULT_REACTION_ACTIVE,
    DriveState.UNKNOWN,
)


class HomingAccess(Protocol):
    """Access of a transport to a homing drive."""

    def select_mode(self) -> None:
        """Request the mode of operation 6."""
        ...

    def statusword(self) -> int | None:
        """Return the statusword; None without an answer. A sign of life may go with it."""
        ...

    def mode_display(self) -> int | None:
        """Return the mode that the drive displays; None without an answer."""
        ...

    def command(self, controlword: int) -> None:
        """Send a controlword."""
        ...

    def wait(self) -> None:
        """Let `PERIOD_S` pass; signs of life to the drive go on meanwhile."""
        ...


def is_homed(access: HomingAccess) -> bool:
    """Return True if the drive reports homed once it displays homing mode (after a delay)."""
    end = time.monotonic() + _MODE_S
    while time.monotonic() < end:
        if access.mode_display() == homing.MODE:
            status = access.statusword()
            return status is not None and homing.outcome(status) == homing.Outcome.HOMED
        access.wait()
    return False


def home(
    access: HomingAccess,
    machine: state_machine.Params,
    params: homing.Params,
    stopped: Callable[[], bool],
) -> str:
    """Home a drive in mode 6; return why it did not home, empty if it did. Its power stays on.

    ``stopped``: returns True to abort.
    """
    drive, handshake = state_machine.start(0, 0), homing.start(0)
    bits = acting = 0
    while True:
        statusword, mode_display = access.statusword(), access.mode_display()
        if statusword is None or mode_display is None:
            return "no answer"
        drive, output = state_machine.step(
            machine,
            drive,
            state_machine.Inputs(
                statusword, 0.0, mode_display, homing.MODE, _ENABLED, 1, 0, bits, 0
            ),
        )
        acting = output.acting
        if drive.armed == 0:
            return f"{describe(statusword)}; {state_machine.explain(drive)}"
        handshake, bits = homing.step(
            params, handshake, homing.Inputs(statusword, acting, acting, 0)
        )
        access.command(output.controlword)
        if handshake.phase == _HOMED:
            return ""
        if handshake.phase == _FAILED:
            return homing.Failure(handshake.failure).name.lower().replace("_", " ")
        if stopped():
            return "aborted"
        access.wait()


def remove_power(access: HomingAccess) -> bool:
    """Disable a drive until it reports to be disabled; return whether it does in time."""
    end = time.monotonic() + POWER_OFF_S
    while time.monotonic() < end:
        access.command(0)
        status = access.statusword()  # alone: it is enough to know
        if status is not None and decode(status) not in _POWERED:
            return True
        access.wait()
    return False
