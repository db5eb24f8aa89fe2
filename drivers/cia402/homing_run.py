"""A whole homing of one drive, outside the tick: mode 6, enable, handshake, power off.

It owns no wire: a transport gives access to statusword, mode display and controlword.
"""

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from drivers.cia402 import homing, state_machine
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import DriveState, decode, describe
from drivers.errors import ServiceError

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


class HomingSettings(NamedTuple):
    """Power machine and deadlines of a homing, in ticks of `PERIOD_S`."""

    machine: state_machine.Params
    deadlines: homing.Params


class HomingAccess(Protocol):
    """Access of a transport to a homing drive."""

    def select_mode(self) -> None:
        """Request the mode of operation 6; ServiceError if the wire is not ready for it."""
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

    def force_power_off(self) -> str:
        """End the power of a drive by force; return what was done, empty if nothing can be."""
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
    name: str,
    settings: HomingSettings,
    stopped: Callable[[], bool],
) -> bool:
    """Home a drive in mode 6, then remove its power; return whether it homed now.

    A drive that reports that it is homed is left unchanged. ``stopped``: returns True to abort.
    ServiceError, with the ``name`` of the drive, says why it did not home, or that it may still be
    powered.
    """
    failure = "it did not begin"
    try:
        access.select_mode()
        if is_homed(access):
            failure = ""
            return False
        failure = _home_powered(access, settings, stopped)
    finally:
        if not remove_power(access):
            forced = access.force_power_off()
            raise ServiceError(
                f"{name} may still be powered: it did not confirm that it was disabled within "
                f"{POWER_OFF_S:g} s{', and ' if forced else ''}{forced}; press the emergency stop"
                + (f"; it did not home: {failure}" if failure else "")
            )
    if failure:
        raise ServiceError(f"{name} did not home: {failure}")
    return True


def _home_powered(
    access: HomingAccess,
    settings: HomingSettings,
    stopped: Callable[[], bool],
) -> str:
    """Home a drive; return why it did not home, empty if it did. Its power stays on."""
    drive, handshake = state_machine.start(0, 0), homing.start(0)
    bits = acting = 0
    while True:
        statusword, mode_display = access.statusword(), access.mode_display()
        if statusword is None or mode_display is None:
            return "no answer"
        drive, output = state_machine.step(
            settings.machine,
            drive,
            state_machine.Inputs(
                statusword, 0.0, mode_display, homing.MODE, _ENABLED, 1, 0, bits, 0
            ),
        )
        acting = output.acting
        if drive.armed == 0:
            return f"{describe(statusword)}; {state_machine.explain(drive)}"
        handshake, bits = homing.step(
            settings.deadlines, handshake, homing.Inputs(statusword, acting, acting, 0)
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
