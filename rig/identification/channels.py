"""The channels of the axis that the reference moves, from a run's record.

Every axis has its encoder, its command and the current of its drive (`controllers.signals`,
`rig.config.axis`). What else there is, a kind of rig declares for each axis as `AxisChannels`, and
a run records it with its reference.
"""

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from rig.spectra.periods import Complexes, Floats


class ForceChannel(NamedTuple):
    """A logged force on the body, in N (N m of an axis that rotates), and its known delays.

    A sensor's reading is late by age and ``lag_s``. A command precedes the force: the drive holds
    it for ``hold_s``, and its current loop follows as a first-order lag of ``time_constant_s``.
    """

    name: str  # in names of responses: Y_id_<name>
    label: str  # in pictures and notes
    field: str  # log field
    age: str = ""  # log field of its age; empty: no age
    per_ampere: bool = False  # logged as the current of the drive
    lag_s: float = 0.0  # of the reading, which the age does not contain
    hold_s: float = 0.0  # each command acts for this time, from its tick on
    time_constant_s: float = 0.0  # of the drive's current loop

    def force_per_reading(self, omega: Floats) -> Complexes:
        """Return the force on the body per logged value at angular frequencies, rad/s.

        e^(i omega lag) of a lag, sin(x)/x e^(-i x) with x = omega hold / 2 of a zero-order hold,
        and 1/(1 + i omega tau) of a current loop.
        """
        hold = np.sinc(0.5 * omega * self.hold_s / np.pi) * np.exp(-0.5j * omega * self.hold_s)
        late = np.exp(1j * omega * self.lag_s)
        return np.asarray(late * hold / (1.0 + 1j * omega * self.time_constant_s), np.complex128)


class AxisChannels(NamedTuple):
    """Channels of an axis besides encoder, command and current, and columns of its rows."""

    body: ForceChannel | None = None
    """The force on the body alone; None without a sensor between drivetrain and body. The command
    where the drive acts on the body without a drivetrain."""
    drive: tuple[ForceChannel, ...] = ()
    """Sensors of the force on body and drivetrain in series, the most direct last."""
    gains: tuple[str, ...] = ()  # columns with gains of feedback: other gains, another model
    spring: str = ""  # column with the rate of a spring in the drivetrain, N/m
    saturated: str = ""  # log field that is 1 while the drive saturates
    command: ForceChannel | None = None  # the command with its delays; None: they are not known

    def as_record(self) -> dict[str, Any]:
        """Return the declaration as JSON values, as in a run's plan."""
        return {
            **self._asdict(),
            "body": self.body and self.body._asdict(),
            "drive": [channel._asdict() for channel in self.drive],
            "command": self.command and self.command._asdict(),
        }


COMMAND = "command"


def command_channel(axis: str) -> ForceChannel:
    """Return the commanded force of an axis."""
    return ForceChannel(COMMAND, "command", f"{axis}.command.force")


def position_fields(axis: str) -> tuple[str, str]:
    """Return the log fields of an axis's encoder and of its age."""
    return f"{axis}.sense.counts", f"{axis}.sense.encoder_age"


def current_channel(axis: str) -> ForceChannel:
    """Return the force by the measured current of an axis's drive."""
    return ForceChannel(
        "current", "current", f"{axis}.sense.current", f"{axis}.sense.drive_age", per_ampere=True
    )


def is_commanded(axis: str, declared: AxisChannels) -> bool:
    """Return whether the force on the body is the command."""
    return declared.body is not None and declared.body.field == command_channel(axis).field


def force_channels(axis: str, declared: AxisChannels) -> tuple[ForceChannel, ...]:
    """Return the forces on body and drivetrain in series, the most direct last."""
    if is_commanded(axis, declared):
        return ()
    return declared.command or command_channel(axis), current_channel(axis), *declared.drive


def second_reading(axis: str, declared: AxisChannels) -> ForceChannel | None:
    """Return what also measures the motor's force where command and current have known delays.

    Of a command on the body that is the current, of a current the command; None where the delays
    of the command are not known, or where a sensor measures the force on the drivetrain.
    """
    if is_commanded(axis, declared):
        return current_channel(axis)
    return None if declared.drive else declared.command


def recorded_channels(reference: Mapping[str, Any]) -> AxisChannels:
    """Return the declaration in the record of a reference; runs before 2027 have none."""
    record = reference.get("channels") or _earlier_channels().get(reference["axis"], {})
    body, command = record.get("body"), record.get("command")
    return AxisChannels(
        ForceChannel(**body) if body else None,
        tuple(ForceChannel(**channel) for channel in record.get("drive", ())),
        tuple(record.get("gains", ())),
        record.get("spring", ""),
        record.get("saturated", ""),
        ForceChannel(**command) if command else None,
    )


@cache
def _earlier_channels() -> Mapping[str, Any]:
    """Return the declarations of runs recorded before 2027, by axis."""
    text = resources.files(__package__).joinpath("earlier_channels.json").read_text()
    found: Mapping[str, Any] = json.loads(text)
    return found
