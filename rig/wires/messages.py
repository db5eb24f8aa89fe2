"""The messages between I/O processes and the loop in mailboxes; each has a time stamp.

`stamp` is on the monotonic clock (s), which all processes of a host share. The stamp of a value is
the time of the request for it, so that its age is never too small.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, get_type_hints

from controllers.signals import (
    Ampere,
    Count,
    Flag,
    Index,
    Newton,
    NewtonMetre,
    RadianPerSecond,
    Second,
)
from rig.processes.mailbox import Mailbox
from rig.processes.messages import MessageFields


class NodeHealth(NamedTuple):
    """The state of a node or slave of the bus, as the service process of the bus knows it."""

    heartbeat_time: Second  # when its last heartbeat came
    restarts: Index  # since it was set up
    stamp: Second  # time of this message


class EncodersMessage(NamedTuple):
    """Counts of the encoders at motor and shaft, latched by one edge."""

    motor: Count  # turns included, positive as the gearbox output's angle
    shaft: Count
    stamp: Second


class ServoMessage(NamedTuple):
    """The last reported state of the servo drive."""

    current: Ampere
    acting: Flag  # 1: powered by our request, and it follows set-points
    error: Index  # its error number while it is in error, -1: not read yet, else 0
    stamp: Second


class SetPointMessage(NamedTuple):
    """Set-point of the servo drive, at the motor; that of the control loop not in use is 0."""

    velocity: RadianPerSecond
    torque: NewtonMetre
    enable: Flag
    stamp: Second


class WrenchMessage(NamedTuple):
    """Values of the six-axis load cell, z along the shaft, with the rig's signs."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre
    stamp: Second


class WriteAcknowledgement(NamedTuple):
    """Acknowledgement that the device has received the outputs of the loop."""

    stamp: Second  # send time of the newest acknowledged write


# Ends the name of the mailbox in which the writing of another is acknowledged.
ACKNOWLEDGEMENT_SUFFIX = "_done"
HEALTH_SUFFIX = "_health"  # ends the name of the mailbox of a CANopen node's health

WHOLE_NUMBERS = ("flag", "index", "count")
"""Units whose values are ints in mailboxes."""
_FIRST_VALUE_TIMEOUT_S = 3.0  # s until each mailbox must have a value


def block_message(values: Iterable[tuple[str, str]]) -> MessageFields:
    """Return the message of a register block, from name and unit of each value."""
    return (*values, ("stamp", "s"))


def message_fields(message: type) -> MessageFields:
    """Return the fields of a message type, for the mailbox that holds it."""
    hints = get_type_hints(message, include_extras=True)
    return tuple((field, hint.__metadata__[0]) for field, hint in hints.items())


def open_mailboxes(slots: Mapping[str, Sequence[Any]]) -> dict[str, Mailbox]:
    """Return the mailboxes of an I/O process or the loop by name.

    ``slots``: `rig.processes.messages.Slot` of each, or its JSON values.
    """
    return {name: Mailbox(fd, message_type(fields)) for name, (fd, fields) in slots.items()}


def message_type(fields: Sequence[Sequence[str]]) -> type:
    hints = [
        (name, Annotated[int if unit in WHOLE_NUMBERS else float, unit]) for name, unit in fields
    ]
    make: Any = NamedTuple  # its static type wants literal fields
    message: type = make("Message", hints)
    return message


def wait_for_values(slots: Mapping[str, Mailbox], dt: float) -> None:
    """Wait until every mailbox has a value; OSError names those without one.

    A process that posts its first value at this moment may be interrupted halfway. ``dt`` in s
    between two looks.
    """
    until = time.monotonic() + _FIRST_VALUE_TIMEOUT_S
    while empty := [name for name, slot in slots.items() if slot.read() is None]:
        if time.monotonic() > until:
            raise OSError(f"no value from {', '.join(empty)} in {_FIRST_VALUE_TIMEOUT_S:g} s")
        time.sleep(dt)
