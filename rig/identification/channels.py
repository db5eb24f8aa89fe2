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


class ForceChannel(NamedTuple):
    """A logged force on the body, in N."""

    name: str  # in names of responses: Y_id_<name>
    label: str  # in pictures and notes
    field: str  # log field
    age: str = ""  # log field of its age; empty: no age
    per_ampere: bool = False  # logged as the current of the drive


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

    def as_record(self) -> dict[str, Any]:
        """Return the declaration as JSON values, as in a run's plan."""
        return {
            **self._asdict(),
            "body": self.body and self.body._asdict(),
            "drive": [channel._asdict() for channel in self.drive],
        }


COMMAND = "command"


def command_channel(axis: str) -> ForceChannel:
    """Return the commanded force of an axis."""
    return ForceChannel(COMMAND, "command", f"{axis}.command.force")


def position_fields(axis: str) -> tuple[str, str]:
    """Return the log fields of an axis's encoder and of its age."""
    return f"{axis}.sense.counts", f"{axis}.sense.encoder_age"


def force_channels(axis: str, declared: AxisChannels) -> tuple[ForceChannel, ...]:
    """Return the forces on body and drivetrain in series, the most direct last."""
    command = command_channel(axis)
    if declared.body is not None and declared.body.field == command.field:
        return ()
    current = ForceChannel(
        "current", "current", f"{axis}.sense.current", f"{axis}.sense.drive_age", per_ampere=True
    )
    return command, current, *declared.drive


def recorded_channels(reference: Mapping[str, Any]) -> AxisChannels:
    """Return the declaration in the record of a reference; runs before 2027 have none."""
    record = reference.get("channels") or _earlier_channels().get(reference["axis"], {})
    body = record.get("body")
    return AxisChannels(
        ForceChannel(**body) if body else None,
        tuple(ForceChannel(**channel) for channel in record.get("drive", ())),
        tuple(record.get("gains", ())),
        record.get("spring", ""),
        record.get("saturated", ""),
    )


@cache
def _earlier_channels() -> Mapping[str, Any]:
    """Return the declarations of runs recorded before 2027, by axis."""
    text = resources.files(__package__).joinpath("earlier_channels.json").read_text()
    found: Mapping[str, Any] = json.loads(text)
    return found
